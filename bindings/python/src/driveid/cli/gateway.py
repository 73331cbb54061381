# SPDX-License-Identifier: Apache-2.0
"""driveid status | watch | record | replay | ports."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import click
from rich.table import Table
from rich.text import Text

from .. import bus as adapters
from ..client import Client, GatewayError, default_socket
from ..errors import UsageError
from ..model import Model
from ..views import units
from ..views.gateway import skew
from .common import FiniteRange, invoke_guard, progress_bar, say, stdout_console, write_document

_socket = click.option("--socket", metavar="PATH", default=default_socket, show_default="$DRIVEID_SOCKET or /run/driveid/control.sock", help="Control socket of the gateway.")


@click.command()
@_socket
@click.option("--json", "json_file", metavar="FILE", help="Write the gateway's own answer; - is standard output.")
@invoke_guard
def status(socket: str, json_file: str | None) -> None:
    """What the gateway knows right now: drives, parameters, sources."""
    with Client(socket) as client:
        answer = client.status()
    write_document(json_file, answer)
    if json_file != "-":
        show_status(answer)


def show_status(answer: dict) -> None:
    console = stdout_console()
    for drive in answer["drives"]:
        words = f"{drive['name']}: {drive['structure']}, {drive['state']} ({drive['status']}), {drive['samples']} samples at {drive['rate_Hz']:.1f} Hz"
        first = drive.get("time_to_first_trusted_s")
        if first is not None:
            words += f", first trusted after {units.duration(first)}"
        console.print(Text(words, style="bold"))
        table = Table(box=None, pad_edge=False, header_style="bold")
        for title in ("parameter", "value, 95 % interval", "valid", "age"):
            table.add_column(title)
        for p in drive["parameters"]:
            lo, hi = p["interval"] or (None, None)
            table.add_row(p["name"], units.estimate(p["value"], lo, hi, p["unit"]), "yes" if p["valid"] else "no", units.duration(p.get("age_s")) if p["value"] is not None else "")
        console.print(table)
        residual = drive.get("residual") or {}
        if residual.get("alarm"):
            console.print(Text(f"the model no longer explains this drive{': ' + residual['likely_effect'] if residual.get('likely_effect') else ''}", style="bold"))
        if lost(drive, _DRIVE_LOSSES):
            console.print(Text(f"did not go into the estimate: {lost(drive, _DRIVE_LOSSES)}"))
        if skew(drive):
            console.print(Text(f"current beside encoder: {skew(drive)}"))
        if drive.get("missing"):
            console.print(Text(f"cannot be had: {drive['missing']}"))
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("source", "address", "state", "clock", "frames", "used", "dropped", "rejected", "errors", "rate"):
        table.add_column(title)
    for s in answer["sources"]:
        counts = [str(s.get(key, 0)) for key in ("frames", "used", "dropped", "rejected", "errors")]
        table.add_row(s["name"], str(s["address"]), s["state"], s["clock"], *counts, f"{s['rate_Hz']:.1f} Hz")
    console.print(table)
    for s in answer["sources"]:
        if s.get("last_error"):
            console.print(Text(f"{s['name']}: {s['last_error']}"))


_DRIVE_LOSSES = ("dropped", "gaps", "rejected", "jumps", "duplicates", "reordered", "saturations")


def lost(of: dict, keys: tuple[str, ...]) -> str:
    """The counts that are not 0, by name; "" where all are."""
    return ", ".join(f"{of[key]} {key}" for key in keys if of.get(key))


@click.command()
@_socket
@invoke_guard
def watch(socket: str) -> None:
    """Live monitor of the gateway: parameters with intervals, validity, residual, bus. Keys are shown at the bottom."""
    if not sys.stdout.isatty():
        _watch_lines(socket)
        return
    try:
        from ..views import watch as screen
    except ImportError:
        say("the full-screen monitor needs textual (pip install 'driveid[views]'): lines instead")
        _watch_lines(socket)
        return
    screen.run(socket)


def _watch_lines(socket: str) -> None:
    """For pipes and logs: one line an estimate."""
    with Client(socket) as client:
        for event in client.events(("estimate", "event")):
            if event["event"] == "estimate":
                values = ", ".join(f"{p['name']} = {units.estimate(p['value'], *(p['interval'] or (None, None)), p['unit'])}{'' if p['valid'] else ' (not valid)'}" for p in event["parameters"])
                click.echo(f"{event['t_ns'] * 1e-9:.3f} {event['drive']} {event['state']}: {values}")
            elif event["event"] in ("away", "back"):
                click.echo(event.get("message", "the gateway is back"), err=True)
            elif event["event"] == "event":
                click.echo(f"{event.get('level', '')} {event.get('component', '')}: {event.get('text', '')} {event.get('mend', '')}".rstrip())


@click.command()
@click.argument("file", metavar="FILE")
@_socket
@click.option("--bus", metavar="INTERFACE:CHANNEL", help="Record from this adapter instead of through the gateway: socketcan:can0, slcan:/dev/ttyACM0.")
@click.option("--bitrate", type=int, help="Bit rate of the adapter's bus.")
@click.option("--fd", is_flag=True, help="CAN FD.")
@click.option("--seconds", type=click.FloatRange(min=0, min_open=True), help="Stop after so long; else Ctrl-C.")
@invoke_guard
def record(file: str, socket: str, bus: str | None, bitrate: int | None, fd: bool, seconds: float | None) -> None:
    """Record into FILE (.drec): through the gateway, into its record folder, or from an adapter of this machine."""
    if bus is None:
        _record_gateway(file, socket, seconds)
        return
    path = Path(file)
    opened = adapters.open_bus(bus, bitrate=bitrate, fd=fd)
    try:
        say(f"recording {bus} into {path}" + ("" if seconds else "; Ctrl-C ends"))
        told = adapters.record(opened, path, bus, seconds=seconds, reopen=lambda: adapters.open_bus(bus, bitrate=bitrate, fd=fd), say=say)
    finally:
        adapters.close(opened)
    say(f"{told.frames} frames, {told.bytes} bytes" + (f", {told.errors} unreadable lines" if told.errors else "") + (f", the adapter came back {told.reopened} times" if told.reopened else ""))


def _record_gateway(name: str, socket: str, seconds: float | None) -> None:
    if "/" in name:
        raise UsageError(f"{name}: the gateway records into its own folder; give a bare name, e.g. {Path(name).name}")
    with Client(socket) as client:
        path = client.request("record_start", file=name)["file"]
        say(f"the gateway records into {path}" + ("" if seconds else "; Ctrl-C ends"))
        try:
            _wait_recording(client, path, None if seconds is None else time.monotonic() + seconds)
        except KeyboardInterrupt:
            pass
        except GatewayError as e:
            raise GatewayError(f"{e}. {path} holds what was recorded until then{_come_back(socket)}") from None
        done = client.request("record_stop")
    click.echo(done["file"])
    say(f"{done['entries']} entries, {done['bytes']} bytes")


def _wait_recording(client: Client, path: str, end: float | None) -> None:
    """Until `end`, or for ever; GatewayError where the gateway goes away or does not record any more. A reload that changes what a record holds goes on in another file."""
    state = "open"
    while end is None or time.monotonic() < end:
        record = client.status()["record"]
        if record is None:
            raise GatewayError("the gateway does not record any more: somebody else has stopped it")
        if record["file"] != path:
            path = record["file"]
            say(f"the gateway was reloaded and goes on in {path}")
        if record["state"] not in ("open", state):
            say("the record is full: nothing is added any more" if record["state"] == "full" else f"the record cannot be written: {record['last_error']}")
        state = record["state"]
        time.sleep(_LOOK_S if end is None else max(min(_LOOK_S, end - time.monotonic()), 0.001))


_LOOK_S = 0.5         # between two looks at a record that runs
_COME_BACK_S = 2.0    # a service that died is started again within about so long


def _come_back(socket: str) -> str:
    """What became of a gateway that went away, as the end of a sentence."""
    end = time.monotonic() + _COME_BACK_S
    while True:
        try:
            with Client(socket) as client:
                recording = client.status()["record"]
        except GatewayError:
            if time.monotonic() >= end:
                return "; it has not come back"
            time.sleep(0.1)
            continue
        return f"; the gateway is there and records into {recording['file']}" if recording else "; the gateway is there and does not record: start the record again"


@click.command()
@click.argument("file", metavar="FILE")
@click.option("--to", "target", metavar="INTERFACE:CHANNEL", help="Send the frames to this bus.")
@click.option("--speed", type=FiniteRange(0), default=1.0, show_default=True, help="Factor on the original pace; 0: as fast as possible.")
@click.option("--bitrate", type=int, help="Bit rate of the adapter's bus.")
@click.option("--fd", is_flag=True, help="CAN FD.")
@click.option("--model", "model_file", metavar="MODEL", help="Model file, where the record's configuration does not carry it.")
@click.option("--drive", metavar="NAME", help="Which drive of the record.")
@click.option("--method", help="Estimator, instead of the recorded one: fsm, window, discrete, rls, kalman, adm.")
@click.option("--type", "real", type=click.Choice(["f64", "f32", "q31"]), help="Number type, instead of the recorded one.")
@click.option("--json", "json_file", metavar="FILE", help="Write the replayed estimates; - is standard output.")
@invoke_guard
def replay(file: str, target: str | None, speed: float, bitrate: int | None, fd: bool, model_file: str | None, drive: str | None,
           method: str | None, real: str | None, json_file: str | None) -> None:
    """Send the frames of FILE to a bus (--to), or run a gateway record through the daemon's own estimator and compare."""
    if target is not None:
        frames = adapters.load_frames(Path(file), say)
        with adapters.open_bus(target, bitrate=bitrate, fd=fd) as bus, progress_bar("replay") as progress:
            sent = adapters.send(bus, frames, speed=speed, progress=(lambda done: progress(done, "replay")) if progress else None)
        say(f"{sent.frames} frames in {sent.seconds:.3f} s" if speed == 0 else f"{sent.frames} frames in {sent.seconds:.3f} s; each late by {units.number(sent.late_median_s, 's', 3)} (median), {units.number(sent.late_max_s, 's', 3)} (worst)")
        return
    _replay_library(file, model_file, drive, {k: v for k, v in (("method", method), ("type", real)) if v}, json_file)


def _replay_library(file: str, model_file: str | None, drive: str | None, changes: dict[str, str], json_file: str | None) -> None:
    from .. import __version__
    from ..online import replay_drec

    result, check = replay_drec(file, drive=drive, model=Model.load(model_file) if model_file else None, **changes)
    final = result.final()
    if check.damage:
        say(f"{file}: {check.damage}")
    write_document(json_file, {
        "format": 1, "driveid": __version__, "file": file, "samples": len(result.status),
        "parameters": {n: {"value": _plain(v), "interval": [_plain(lo), _plain(hi)], "valid": ok} for n, (v, lo, hi, ok) in final.items()},
        "compared": check.compared, "identical": check.identical})
    console = stdout_console(json_file)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("parameter", "value, 95 % interval", "valid"):
        table.add_column(title)
    for name, (value, lo, hi, ok) in final.items():
        table.add_row(name, units.estimate(value, lo, hi, units.split_name(name)[1]), "yes" if ok else "no")
    console.print(table)
    if check.compared:
        apart = "" if check.identical == check.compared else f"; worst relative difference {check.worst:.3g}"
        if apart and not check.from_start:
            apart = "; the gateway had learnt, or restored, something before this record began: a replay has only what is in the record"
        console.print(f"{check.identical} of {check.compared} recorded estimates repeated bit for bit{apart}")


def _plain(value: float) -> float | None:
    return value if value == value else None


@click.command()
@click.option("--probe", is_flag=True, help="Ask each serial port whether an slcan adapter is there (sends a version request).")
@click.option("--json", "as_json", is_flag=True, help="As JSON on standard output.")
@invoke_guard
def ports(probe: bool, as_json: bool) -> None:
    """Serial adapters and CAN interfaces of this machine."""
    found = adapters.ports(probe)
    if as_json:
        click.echo(json.dumps([p.__dict__ for p in found], indent=2))
        return
    if not found:
        say("no serial port and no CAN interface; plug an adapter in, or load a kernel module (modprobe vcan)")
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("port", "kind", "what", "use with", "probe"):
        table.add_column(title)
    for p in found:
        table.add_row(p.device, p.kind, p.description, p.suggestion, p.answer)
    stdout_console().print(table)


COMMANDS = [status, watch, record, replay, ports]

# SPDX-License-Identifier: Apache-2.0
"""CAN adapters on a laptop: record from one into a .drec, send a log to one against absolute deadlines, list the ports."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import DriveidError, FileError, UsageError
from .records.drec import CAN, CLOCK_DAEMON, CLOCK_KERNEL, DrecWriter, of_kind, parse
from .records.frames import EFF, ERR, RTR

# What a stamp of python-can may be wrong by: the kernel's stamp through float64, or the moment at which a serial line was read.
_ERR_NS = {CLOCK_KERNEL: 1_000, CLOCK_DAEMON: 5_000_000}


def open_bus(text: str, *, bitrate: int | None = None, fd: bool = False):
    """'socketcan:can0', 'slcan:/dev/ttyACM0', 'virtual:name' as a python-can bus."""
    import can

    interface, colon, channel = text.partition(":")
    if not colon or not channel:
        raise UsageError(f"--bus {text}: write INTERFACE:CHANNEL, e.g. socketcan:can0 or slcan:/dev/ttyACM0")
    if interface not in can.VALID_INTERFACES:
        from .errors import close_names
        raise UsageError(f"--bus {text}: no interface {interface!r}. {close_names(interface, sorted(can.VALID_INTERFACES))}")
    options: dict = {"fd": True} if fd else {}
    if bitrate is not None:
        options["bitrate"] = bitrate
    try:
        return can.Bus(channel=channel, interface=interface, **options)
    except Exception as e:  # each backend raises its own
        raise DriveidError(f"{text} cannot be opened ({e})") from None


@dataclass
class Recorded:
    frames: int = 0
    errors: int = 0
    bytes: int = 0
    reopened: int = 0


def record(bus, path: Path, address: str, *, seconds: float | None = None, reopen: Callable | None = None,
           progress: Callable[[Recorded], None] | None = None, say: Callable[[str], None] = lambda text: None) -> Recorded:
    """Everything that comes over the bus, until `seconds` are over or KeyboardInterrupt.

    A bad line of an adapter is counted, never fatal. An adapter that is pulled out is waited for: `reopen` gives the bus anew; without it the
    record ends there. The caller closes `bus`; a bus that was opened anew is closed here."""
    interface = address.partition(":")[0]
    clock = CLOCK_KERNEL if interface == "socketcan" else CLOCK_DAEMON
    told = Recorded()
    try:
        writer = DrecWriter(path, [{"name": "can", "kind": interface, "address": address}])
    except FileExistsError:
        raise FileError(path, "exists already", mend="Choose another name: a record is never overwritten") from None
    except OSError as e:
        raise FileError(path, f"cannot be written ({e.strerror})") from None
    end = None if seconds is None else time.monotonic() + seconds
    said, first = time.monotonic(), bus
    with writer:
        try:
            while end is None or time.monotonic() < end:
                try:
                    message = bus.recv(timeout=0.1 if end is None else max(min(0.1, end - time.monotonic()), 0))
                except KeyboardInterrupt:
                    raise
                except Exception as e:
                    if not _gone(e):  # a damaged line on a serial adapter
                        told.errors += 1
                        _forget_line(bus)
                        continue
                    writer.event(time.monotonic_ns(), "warning", "can", f"the adapter is gone ({e})")
                    say(f"{address} is gone ({e})" + ("; it is waited for" if reopen else ""))
                    bus = _again(bus, reopen, end)
                    if bus is None:
                        break
                    told.reopened += 1
                    writer.event(time.monotonic_ns(), "info", "can", "the adapter is back")
                    say(f"{address} is back")
                    continue
                if message is not None:
                    told.frames += 1
                    _write(writer, message, clock)
                if time.monotonic() - said > 0.5:
                    said = time.monotonic()
                    writer.flush()
                    told.bytes = writer.bytes
                    if progress:
                        progress(told)
        except KeyboardInterrupt:
            pass
        finally:
            if bus is not None and bus is not first:
                close(bus)
    told.bytes = writer.bytes
    return told


def _gone(error: Exception) -> bool:
    """Whether the adapter itself failed, not one line of it (python-can wraps both alike)."""
    import can

    return isinstance(error, OSError) or (isinstance(error, can.CanError) and not isinstance(error.__cause__, ValueError))


def _forget_line(bus) -> None:
    """python-can keeps an slcan line that is no ASCII, and would fail on it for ever."""
    if hasattr(line := getattr(bus, "_buffer", None), "clear"):
        line.clear()


def close(bus) -> None:
    """Let go of a bus, also of one whose adapter is gone."""
    try:
        bus.shutdown()
    except Exception:  # closing what is gone may fail in any way
        pass


def _again(bus, reopen: Callable | None, end: float | None):
    """The bus opened anew, tried twice a second; None where time is over or nobody can open it."""
    close(bus)
    while reopen and (end is None or time.monotonic() < end):
        time.sleep(0.5)
        try:
            return reopen()
        except DriveidError:
            continue
    return None


def _write(writer: DrecWriter, message, clock: int) -> None:
    now, wall = time.monotonic_ns(), time.time_ns()
    t_ns = now if clock == CLOCK_DAEMON else now - (wall - round(message.timestamp * 1e6) * 1000)
    can_id = message.arbitration_id | (EFF if message.is_extended_id else 0) | (RTR if message.is_remote_frame else 0) | (ERR if message.is_error_frame else 0)
    flags = (1 if message.is_fd else 0) | (2 if message.bitrate_switch else 0) | (4 if message.error_state_indicator else 0)
    writer.can(t_ns, can_id, bytes(message.data), fd_flags=flags, clock=clock, err_ns=_ERR_NS[clock])


@dataclass(frozen=True)
class Sent:
    frames: int
    seconds: float
    late_median_s: float
    late_max_s: float


def load_frames(path: Path, say: Callable[[str], None] = lambda _: None) -> list[tuple[int, int, int, bytes]]:
    """(t_ns, can_id, FD flags, data) in the order of their stamps."""
    try:
        blob = path.read_bytes()
    except OSError as e:
        raise FileError(path, f"cannot be read ({e.strerror})") from None
    if blob[:8] == b"DRVIDREC":
        file = parse(path, blob)
        if file.damage:
            say(f"{path}: {file.damage}")
        rows = [(e.t_ns, *e.can()) for e in of_kind(file.entries, CAN) if len(e.payload) >= 8]
        out = [(t, can_id, flags, data) for t, can_id, flags, data in rows if not can_id & ERR]
    else:
        from .records.canlog import read_frames
        frames = read_frames(path, blob)
        out = [(t, can_id, 1 if len(data) > 8 else 0, data)
               for can_id, stamps in frames.stamps.items() for t, data in zip(stamps, frames.payloads[can_id])]
        out.sort(key=lambda row: row[0])
    if not out:
        raise FileError(path, "holds no CAN frame to send")
    return out


def send(bus, frames: list[tuple[int, int, int, bytes]], *, speed: float = 1.0, progress: Callable[[float], None] | None = None) -> Sent:
    """Each frame at start + (its stamp - first stamp) / speed; the error never adds up. speed 0: as fast as the bus takes them."""
    import can

    if speed < 0:
        raise UsageError("--speed is 1 (original pace), a factor, or 0 (as fast as possible)")
    first, start = frames[0][0], time.monotonic_ns()
    late = np.zeros(len(frames))
    for k, (t_ns, can_id, flags, data) in enumerate(frames):
        due = start if speed == 0 else start + round((t_ns - first) / speed)
        _wait(due)
        message = can.Message(arbitration_id=can_id & 0x1FFFFFFF, is_extended_id=bool(can_id & EFF), is_remote_frame=bool(can_id & RTR), data=data,
                              is_fd=bool(flags & 1), bitrate_switch=bool(flags & 2), check=False)
        _send_one(bus, message)
        late[k] = max(time.monotonic_ns() - due, 0) * 1e-9
        if progress and k % 500 == 0:
            progress(k / len(frames))
    seconds = (time.monotonic_ns() - start) * 1e-9
    return Sent(len(frames), seconds, float(np.median(late)), float(late.max()))


def _wait(due_ns: int) -> None:
    """Sleep while there is time; the last fraction of a millisecond is waited out awake."""
    while (left := due_ns - time.monotonic_ns()) > 0:
        if left > 300_000:
            time.sleep((left - 200_000) * 1e-9)


def _send_one(bus, message) -> None:
    """A full transmit queue is waited for, half a second at most; then the bus is stuck and it is said."""
    import can

    end = time.monotonic() + 0.5
    while True:
        try:
            bus.send(message)
            return
        except can.CanError as e:
            if time.monotonic() > end:
                raise DriveidError(f"the bus takes no frames ({e}); is another node on it, and the interface up?") from None
            time.sleep(0.001)


@dataclass(frozen=True)
class Port:
    device: str
    kind: str
    description: str
    suggestion: str = ""
    answer: str = ""


def ports(probe: bool = False) -> list[Port]:
    """Serial ports and CAN interfaces of this machine."""
    from serial.tools import list_ports

    out = [Port(p.device, "serial", " ".join(w for w in (p.description, p.manufacturer) if w and w != "n/a"), f"--bus slcan:{p.device}", _probe(p.device) if probe else "")
           for p in sorted(list_ports.comports())]
    net = Path("/sys/class/net")
    for interface in sorted(net.iterdir()) if net.is_dir() else []:
        try:
            if (interface / "type").read_text().strip() == "280":  # ARPHRD_CAN
                state = (interface / "operstate").read_text().strip()
                out.append(Port(interface.name, "can", f"CAN interface, {state}", f"--bus socketcan:{interface.name}"))
        except OSError:
            continue
    return out


def _probe(device: str) -> str:
    """Politely: one version request of the slcan protocol, which moves nothing on any bus; a port that is in use is left alone."""
    import serial

    try:
        with serial.Serial(device, 115200, timeout=0.3, exclusive=True) as port:
            port.reset_input_buffer()
            port.write(b"\rV\r")
            answer = port.read(32).strip(b"\r\n\a ")
    except (OSError, serial.SerialException) as e:
        return f"not opened ({e})"
    if answer.startswith(b"V") or b"\rV" in answer:
        return f"slcan adapter, version {answer.decode('ascii', 'replace').strip()}"
    return "no answer to slcan" if not answer else "answers something else than slcan"

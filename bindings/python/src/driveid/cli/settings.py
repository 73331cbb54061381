# SPDX-License-Identifier: Apache-2.0
"""driveid config new | check | import-dbc | import-eds."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import click

from .. import dbc_import, eds_import
from ..errors import UsageError
from ..files import write_text
from .common import FiniteRange, invoke_guard, say


_DT = FiniteRange(1e-5, 60)  # as the daemon has it


@click.group("config")
def config() -> None:
    """The gateway's configuration: a new one, a check, signals out of a DBC or a CANopen drive's EDS."""


@config.command("new")
@click.option("--bus", "kind", type=click.Choice(["can", "modbus", "replay"]), default="can", show_default=True, help="Where the samples come from.")
@click.option("--structure", default="rigid_axis", show_default=True, help="Known equations of the drive.")
@click.option("-o", "--output", metavar="FILE", default="-", show_default=True)
@invoke_guard
def config_new(kind: str, structure: str, output: str) -> None:
    """A configuration to start from, every line explained."""
    _known(structure)
    _write(output, dbc_import.template(kind, structure))


def _known(structure: str) -> None:
    from .._core import STRUCTURES
    from ..errors import close_names
    if structure not in STRUCTURES:
        raise UsageError(f"no structure {structure!r}. {close_names(structure, STRUCTURES)}")


@config.command("check")
@click.argument("file", metavar="FILE")
@invoke_guard
def config_check(file: str) -> None:
    """What driveidd says about FILE: the same parser, the same words."""
    program = find_daemon()
    if program is None:
        raise UsageError("driveidd is not installed here: tools/setup in a clone builds it, or set DRIVEIDD to its path")
    done = subprocess.run([program, "--check", file], check=False)
    raise click.exceptions.Exit(0 if done.returncode == 0 else 2)


def find_daemon() -> str | None:
    named = os.environ.get("DRIVEIDD")
    if named:
        return named if os.access(named, os.X_OK) else None
    built = Path(sys.prefix).parent / "build" / "daemon" / "driveidd"  # the .venv of a clone that tools/setup made
    return shutil.which("driveidd") or (str(built) if os.access(built, os.X_OK) else None)


@config.command("import-dbc")
@click.argument("dbc", metavar="DBC")
@click.option("--map", "maps", multiple=True, metavar="NAME=SIGNAL[:UNIT]", help="Which signal of the DBC is which, where its name does not say it.")
@click.option("--interface", default="can0", show_default=True, help="CAN interface of the source.")
@click.option("--structure", default="rigid_axis", show_default=True)
@click.option("--drive", default="axis1", show_default=True, help="Name of the drive.")
@click.option("--dt", "dt_s", type=_DT, default=None, help="Sample time in seconds; else from the cycle time in the DBC.")
@click.option("-o", "--output", metavar="FILE", default="-", show_default=True)
@invoke_guard
def import_dbc(dbc: str, maps: tuple[str, ...], interface: str, structure: str, drive: str, dt_s: float | None, output: str) -> None:
    """A gateway configuration with the signals of a DBC: bit fields, scales and offsets taken over, converted to SI."""
    _known(structure)
    text, notices = dbc_import.from_dbc(Path(dbc), maps, interface=interface, structure=structure, drive=drive, dt_s=dt_s)
    for notice in notices:
        say(notice)
    _write(output, text)


@config.command("import-eds")
@click.argument("eds", metavar="EDS")
@click.option("--node", type=click.IntRange(1, 127), required=True, help="Node number of the drive.")
@click.option("--counts-per-turn", type=FiniteRange(1), default=None, help="Encoder counts of one turn; else 0x608F.")
@click.option("--m-per-count", type=FiniteRange(), default=None, help="Metres of one count (linear_axis).")
@click.option("--rated-current", type=FiniteRange(0, min_open=True), default=None, metavar="A", help="Rated current; else 0x6075.")
@click.option("--rated-torque", type=FiniteRange(0, min_open=True), default=None, metavar="NM", help="Rated torque; else 0x6076.")
@click.option("--velocity-unit", type=click.Choice(["counts/s", "rpm"]), default="counts/s", show_default=True, help="What the drive means by 0x606C.")
@click.option("--interface", default="can0", show_default=True, help="CAN interface of the source.")
@click.option("--structure", type=click.Choice(["rigid_axis", "linear_axis"]), default="rigid_axis", show_default=True, help="A PDO has no voltage: the axis alone.")
@click.option("--drive", default="axis1", show_default=True, help="Name of the drive.")
@click.option("--dt", "dt_s", type=_DT, default=None, help="Sample time in seconds; else from the EDS.")
@click.option("-o", "--output", metavar="FILE", default="-", show_default=True)
@invoke_guard
def import_eds(eds: str, node: int, counts_per_turn: float | None, m_per_count: float | None, rated_current: float | None, rated_torque: float | None,
               velocity_unit: str, interface: str, structure: str, drive: str, dt_s: float | None, output: str) -> None:
    """A gateway configuration for a CANopen drive (CiA 402): position, velocity, torque and current out of its PDO mapping, the SYNC as the sampling instant."""
    ratings = eds_import.Ratings(counts_per_turn, m_per_count, rated_current, rated_torque, velocity_unit)
    text, notices = eds_import.from_eds(Path(eds), node, ratings, interface=interface, structure=structure, drive=drive, dt_s=dt_s)
    for notice in notices:
        say(notice)
    _write(output, text)


def _write(output: str, text: str) -> None:
    if output == "-":
        click.echo(text, nl=False)
    else:
        write_text(output, text)
        say(f"wrote {output}; `driveid config check {shlex.quote(output)}` looks it over")


COMMANDS = [config]

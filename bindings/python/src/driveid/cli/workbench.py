# SPDX-License-Identifier: Apache-2.0
"""driveid workbench."""

from __future__ import annotations

from pathlib import Path

import click

from ..client import default_socket
from ..errors import DriveidError, UsageError
from ..files import read_text
from ..records import HOLDS, parse_maps
from .common import DriveidCommand, invoke_guard, say


@click.command(cls=DriveidCommand, spread={"--held-out": 2, "--map": -1, "--dbc": 2})
@click.argument("model_file", metavar="[MODEL]", required=False)
@click.argument("records", metavar="[RECORD...]", nargs=-1)
@click.option("--held-out", multiple=True, metavar="RECORD...", help="Records that are never fitted: they decide.")
@click.option("--map", "maps", multiple=True, metavar="NAME=COLUMN[:UNIT]", help="What a column is: --map theta_rad=pos:counts/8192.")
@click.option("--hold", type=click.Choice(HOLDS), help="What an input column holds between stamps; else detected and said.")
@click.option("--dbc", multiple=True, metavar="FILE", help="Database of the frames in a CAN log.")
@click.option("--with", "others", multiple=True, metavar="MODEL", help="A further model to draw in Compare; may be given several times.")
@click.option("--socket", metavar="PATH", default=default_socket, show_default="$DRIVEID_SOCKET or /run/driveid/control.sock", help="Control socket of the gateway.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on. Any other than loopback opens your files to whoever has the printed address.")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="Port; 0 takes a free one.")
@click.option("--browser/--no-browser", default=True, help="Open the browser.")
@invoke_guard
def workbench(model_file, records, held_out, maps, hold, dbc, others, socket, host, port, browser) -> None:
    """See it: live signals, model over measurement, where it fails, what is missing, how the error falls.

    Without MODEL and RECORD the last project opens, or a bundled example.
    """
    try:
        from ..views.workbench import run
        from ..views.workbench.projects import Project
    except ImportError as e:
        raise DriveidError(f"the workbench needs {e.name}: pip install 'driveid[views]'") from e
    if model_file and not records:
        raise UsageError(f"which records shall {model_file} be compared with? driveid workbench {model_file} RECORD...")
    project = None
    if model_file:
        parse_maps(maps)
        where = [str(Path(r).resolve()) for r in records], [str(Path(r).resolve()) for r in held_out], [str(Path(d).resolve()) for d in dbc]
        further = tuple((Path(o).stem, read_text(o)) for o in others)
        project = Project(Path(records[0]).stem, read_text(model_file), tuple(where[0]), tuple(where[1]), tuple(maps), hold or "", tuple(where[2]), further)
    run.run(project, socket, host, port, browser, say)


COMMANDS = [workbench]

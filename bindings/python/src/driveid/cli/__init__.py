# SPDX-License-Identifier: Apache-2.0
"""The command `driveid`. Exit codes: 0 an answer, whatever its verdict; 2 usage or unreadable file; 3 bad data."""

from __future__ import annotations

import sys

import click

from .. import __version__
from ..errors import Cancelled, DriveidError
from . import analyse, gateway, models, settings, sinusoids, workbench

EXIT_USAGE, EXIT_INTERRUPTED = 2, 130


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120})
@click.version_option(__version__, message="driveid %(version)s")
def cli() -> None:
    """Identify electric drives; compare the model with measurements; learn which physical effect is missing.

    \b
    driveid model new rigid_axis --given K_t_Nm_A=0.05 -o axis.toml
    driveid fit axis.toml run1.csv -o fitted.toml
    driveid compare fitted.toml run1.csv run2.csv --html c.html
    driveid explain fitted.toml run1.csv --held-out run2.csv
    driveid improve axis.toml run1.csv --held-out run2.csv -o final.toml
    """


for part in (models, analyse, sinusoids, gateway, settings, workbench):
    for command in part.COMMANDS:
        cli.add_command(command)


def main() -> None:
    """Every error of ours is one sentence on standard error and exit code 2; a bug keeps its traceback."""
    try:
        code = cli.main(standalone_mode=False) or 0  # what ctx.exit() was given
    except click.ClickException as e:
        e.show()
        code = e.exit_code
    except (click.Abort, KeyboardInterrupt, Cancelled):
        click.echo("interrupted", err=True)
        code = EXIT_INTERRUPTED
    except DriveidError as e:
        click.echo(f"driveid: {e}", err=True)
        code = EXIT_USAGE
    except BrokenPipeError:
        sys.stderr.close()
        code = EXIT_USAGE
    sys.exit(code)

# SPDX-License-Identifier: Apache-2.0
"""driveid fit | compare | explain | improve | power."""

from __future__ import annotations

import shlex
import sys

import click

from .. import analysis
from ..errors import DataError, FileError, UsageError
from ..model import Model
from ..records import HOLDS, Record, parse_maps, read_all
from . import show
from .common import ANSWER, BAD_DATA, DriveidCommand, invoke_guard, progress_bar, say, stdout_console, write_document, write_model


def _options(function):
    """Options of every analysing command."""
    for option in reversed([
        click.argument("model_file", metavar="MODEL"),
        click.argument("records", metavar="RECORD...", nargs=-1, required=True),
        click.option("--held-out", multiple=True, metavar="RECORD...", help="Records that are never fitted: they decide. Without it contiguous blocks are set aside."),
        click.option("--map", "maps", multiple=True, metavar="NAME=COLUMN[:UNIT]",
                     help="What a column is: --map theta_rad=pos:counts/8192, --map i_A=-Iq:mA, --map omega_rad_s=y:deg/s."),
        click.option("--hold", type=click.Choice(HOLDS), help="What an input column holds between stamps; else detected and said."),
        click.option("--dbc", multiple=True, metavar="FILE", help="Database of the frames in a CAN log."),
        click.option("--drive", metavar="NAME", help="Which drive of a gateway record."),
        click.option("--json", "json_file", metavar="FILE", help="Write the whole answer as JSON; - is standard output."),
        click.option("--html", "html_file", metavar="FILE", help="Write a report, one file without outside links."),
        click.option("--seed", type=int, help="Seed of everything drawn at random."),
        click.option("--threads", type=click.IntRange(1, 64), help="Threads to use."),
    ]):
        function = option(function)
    return function


def _command(name: str, output_help: str | None, **extra):
    """A click command around one function of analysis."""
    def decorate(finish):
        @click.command(name, cls=DriveidCommand, spread={"--held-out": 2, "--map": -1, "--dbc": 2}, help=finish.__doc__, **extra)
        @_options
        @click.pass_context
        @invoke_guard
        def run(ctx, model_file, records, held_out, maps, hold, dbc, drive, json_file, html_file, seed, threads, output=None):
            if [json_file, output].count("-") > 1:
                raise UsageError("--json - and -o - both want standard output: give one of them a file name")
            options = {k: v for k, v in {"seed": seed, "threads": threads}.items() if v is not None}
            reading = {"map": parse_maps(maps), "hold": hold, "dbc": dbc, "drive": drive}
            model = Model.load(model_file)
            training, aside = _read(records, reading), _read(held_out, reading)
            ask = getattr(analysis, name)
            try:
                with progress_bar(name) as progress:
                    answer = ask(model, training, held_out=aside, progress=progress, **options)
            except DataError as e:
                _refuse(ctx, e, json_file, html_file)
            write_document(json_file, answer.document)
            if output_help is not None:   # files first: a reader of the table may close the pipe
                _write_fitted(answer, output)
            if html_file:
                _report(answer, model, [*training, *aside], html_file)
            finish(answer, stdout_console(json_file, output))
            ctx.exit(ANSWER)
        if output_help is not None:
            run.params.append(click.Option(["-o", "--output"], metavar="FILE", help=output_help))
        return run
    return decorate


def _read(paths, reading) -> list[Record]:
    out: list[Record] = []
    for path in paths:
        runs = read_all(path, **reading)
        for record in runs:
            for notice in record.notices:
                if record is runs[0]:
                    say(f"{record.name}: {notice}")
        out += runs
    return out


def _refuse(ctx: click.Context, error: DataError, json_file: str | None, html_file: str | None) -> None:
    """Bad data is an answer too: the documents are written, the exit code is 3."""
    document = error.document or analysis.bad_data(str(error))
    write_document(json_file, document)
    if html_file:
        _html(document, (), html_file)
    say(f"driveid: bad data: {error}")
    for text in show.notices(document):
        say(f"  {text}")
    ctx.exit(BAD_DATA)


def _write_fitted(answer, output: str | None) -> None:
    if output is None:
        say("the model was not written: -o FILE keeps it")
        return
    write_model(output, answer.document["model_toml"])
    if output != "-":
        say(f"wrote {output}")


def _report(answer, model: Model, records: list[Record], html_file: str) -> None:
    shown = Model(answer.document["model_toml"], model.name) if answer.document.get("model_toml") else model
    series = []
    for record in records:
        try:
            series.append(analysis.series(shown, record))
        except DataError as e:
            say(f"{record.name}: no plot in the report ({e})")
    _html(answer.document, series, html_file)


def _html(document: dict, series, html_file: str) -> None:
    from ..views import report
    from ..views.series import Series

    curves = [Series.of(s.t_s, s.header, s.data, s.record) for s in series]
    command = "driveid " + shlex.join(sys.argv[1:])
    try:
        report.write_html(document, html_file, curves, command=command)
    except OSError as e:
        raise FileError(html_file, f"cannot be written ({e.strerror})") from None
    say(f"wrote {html_file}")


@_command("fit", "Model file to write.")
def fit(answer, console) -> None:
    """Find the parameters of MODEL from the RECORDs, with 95 % intervals."""
    show.fit(answer.document, console)


@_command("compare", None)
def compare(answer, console) -> None:
    """How far MODEL is from the RECORDs, next to the noise floor, and where."""
    show.compare(answer.document, console)


@_command("explain", None)
def explain(answer, console) -> None:
    """Which physical effect MODEL lacks to follow the RECORDs."""
    show.explain(answer.document, console)


@_command("improve", "Final model file to write.")
def improve(answer, console) -> None:
    """Explain, add, fit and compare until nothing removable is left; shows each step."""
    show.improve(answer.document, console)


@_command("power", None)
def power(answer, console) -> None:
    """The smallest size of each effect that these RECORDs would reveal (inject and recover)."""
    show.power(answer.document, console)


COMMANDS = [fit, compare, explain, improve, power]

# SPDX-License-Identifier: Apache-2.0
"""driveid model new | show, add, catalogue."""

from __future__ import annotations

import click
from rich.table import Table
from rich.text import Text

from .. import _core, analysis
from ..errors import UsageError, close_names
from ..model import Model
from ..views import units as show_units
from .common import DriveidCommand, invoke_guard, say, stdout_console, write_document, write_model


@click.group()
def model() -> None:
    """Make a model file, or show one."""


@model.command("new", cls=DriveidCommand, spread={"--given": -1})
@click.argument("structure")
@click.option("--given", multiple=True, metavar="NAME=VALUE", help="A parameter that you know; fit never changes it.")
@click.option("-o", "--output", metavar="FILE", default="-", show_default=True, help="Model file to write; - is standard output.")
@invoke_guard
def model_new(structure: str, given: tuple[str, ...], output: str) -> None:
    """The known physics of STRUCTURE as a model file."""
    values: dict[str, float] = {}
    for text in given:
        name, equals, value = text.partition("=")
        try:
            values[name.strip()] = float(value)
        except ValueError:
            raise UsageError(f"--given {text}: write NAME=NUMBER, e.g. --given K_t_Nm_A=0.05") from None
        if not equals:
            raise UsageError(f"--given {text}: write NAME=NUMBER, e.g. --given K_t_Nm_A=0.05")
    write_model(output, Model.new(structure, values).toml)
    if output != "-":
        say(f"wrote {output}: {structure}")


@model.command("show")
@click.argument("file", metavar="MODEL")
@invoke_guard
def model_show(file: str) -> None:
    """Structure, parameters and effects of a model file."""
    shown = Model.load(file)
    console = stdout_console()
    console.print(f"[bold]{shown.structure}[/bold]  ({file})")
    console.print(parameter_table([(None, shown.parameters)] + [(e.name, e.parameters) for e in shown.effects]))
    for effect in shown.effects:
        if effect.formula:
            console.print(f"{effect.name}: {effect.adds_to} = {effect.formula}")


def parameter_table(groups) -> Table:
    table = Table(box=None, pad_edge=False, show_edge=False)
    for title in ("parameter", "value", "state", "effect"):
        table.add_column(title, justify="left")
    for effect, parameters in groups:
        for p in parameters.values():
            lo, hi = p.interval or (None, None)
            value = show_units.number(p.value, p.unit) if p.state == "given" else show_units.estimate(p.value, lo, hi, p.unit)
            table.add_row(p.name, value if p.value is not None else "not fitted yet", p.state, effect or "")
    return table


@click.command()
@click.argument("file", metavar="MODEL")
@click.argument("effect", required=False)
@click.option("--formula", metavar="'SIGNAL = FORMULA'", help="An effect of your own, called EFFECT: --formula 'tau_Nm = c * omega_rad_s * cos(3*theta_rad)'. Names that are no signal are its parameters.")
@click.option("-o", "--output", metavar="FILE", default="-", show_default=True, help="Model file to write; - is standard output.")
@invoke_guard
def add(file: str, effect: str | None, formula: str | None, output: str) -> None:
    """Add EFFECT to MODEL; then fit and compare again."""
    before = Model.load(file)
    if formula is None and effect is None:
        raise UsageError(f"which effect? driveid add {file} EFFECT, or --formula for one of your own; `driveid catalogue` lists them")
    if formula is None:
        after = before.add(effect)
    else:
        effect = effect or _free_name(before)
        after = before.add_own(effect, formula)
    write_model(output, after.toml)
    if output != "-":
        say(f"wrote {output}: {effect} added, its parameters are found by the next fit")


def _free_name(model: Model) -> str:
    """own, own_2, ...: the first that the model has not."""
    taken = {e.name for e in model.effects}
    return next(name for k in range(1, 100) if (name := "own" if k == 1 else f"own_{k}") not in taken)


@click.command()
@click.argument("effect", required=False)
@click.option("--json", "json_file", metavar="FILE", help="Write the catalogue as JSON; - is standard output.")
@invoke_guard
def catalogue(effect: str | None, json_file: str | None) -> None:
    """The effects that explain knows, or one of them in full."""
    effects = analysis.catalogue()
    if json_file:
        write_document(json_file, {"format": _core.format, "driveid": _core.version, "effects": effects})
        return
    console = stdout_console()
    if effect is None:
        table = Table(box=None, pad_edge=False)
        table.add_column("effect")
        table.add_column("equation")
        for e in effects:
            table.add_row(e["name"], Text(e["equation"]))
        console.print(table)
        return
    names = [e["name"] for e in effects]
    if effect not in names:
        raise UsageError(f"no effect {effect!r}. {close_names(effect, names)}")
    _describe(effects[names.index(effect)], console)


def _describe(effect: dict, console) -> None:
    console.print(Text(f"{effect['name']}: {effect['equation']}", style="bold"))
    table = Table(box=None, pad_edge=False, header_style="bold")
    for title in ("parameter", "meaning", "unit", "bounds", "typical"):
        table.add_column(title)
    for p in effect["parameters"]:
        lo, hi = p["bounds"]
        table.add_row(p["name"], p["meaning"], show_units.pretty_unit(p["unit"]), f"{lo:.4g} … {hi:.4g}", f"{p['typical']:.4g}")
    console.print(table)
    for key in ("signature", "contains", "confused_with", "separated_by", "literature"):
        value = effect.get(key)
        if value:
            console.print(Text(f"{key.replace('_', ' ')}: {', '.join(value) if isinstance(value, list) else value}"))


COMMANDS = [model, add, catalogue]

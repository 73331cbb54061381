# SPDX-License-Identifier: Apache-2.0
"""The answers as compact tables for a terminal, from the same view data that the report and the workbench draw."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..views import model as view
from ..views import units

_SHORT = {"equation": "balance", "one_step": "one step", "windows": "windows", "free_run": "free run"}


def _table(*columns: str, right: tuple[str, ...] = ()) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for c in columns:
        table.add_column(c, justify="right" if c in right else "left", no_wrap=c in ("effect", "added", "parameter", "left"))
    return table


def notices(document: dict) -> list[str]:
    return view.document(document).notices


def _notices(doc: view.Document, console: Console) -> None:
    for text in doc.notices:
        console.print(Text(f"note: {text}"))


def _records(doc: view.Document, console: Console) -> None:
    table = _table("record", "rows", "span", "role", right=("rows",))
    for r in doc.records:
        table.add_row(r.name, str(r.rows), units.duration(r.span_s), r.role)
    console.print(table)


def _parameters(parameters: list[view.Parameter], console: Console) -> None:
    table = _table("parameter", "value, 95 % interval", "", "effect")
    for p in parameters:
        table.add_row(p.name, p.text, p.state if p.state != "free" else "", p.effect)
    console.print(table)


def _error(error: view.Error | None) -> str:
    return units.number(error.rmse, error.unit, 3) if error else "-"


def _floor(error: view.Error | None) -> str:
    return f"{units.number(error.floor[0], error.unit, 3)} … {units.number(error.floor[1], error.unit, 3)}" if error and error.floor else "-"


def _errors(doc: view.Document, console: Console) -> None:
    if not doc.errors:
        return
    table = _table("error (RMS)", "of", "signal", "value", "noise floor", "fit", right=("value", "fit"))
    for name, errors in doc.errors:
        for k, (kind, error) in enumerate(errors.by_kind.items()):
            fit = "-" if error.fit_percent is None else f"{error.fit_percent:.1f} %"
            table.add_row(name if k == 0 else "", _SHORT[kind], error.signal, _error(error), _floor(error), fit)
    console.print(table)


def _tests(doc: view.Document, console: Console) -> None:
    for name, tests in doc.tests:
        failed = [t for t in tests if not t.passed]
        if not failed:
            console.print(f"{name}: the residual passes all {len(tests)} tests")
            continue
        words = ", ".join(f"{t.name} ({t.statistic:.3g} over {t.bound:.3g})" if t.statistic is not None and t.bound is not None else t.name for t in failed)
        console.print(Text(f"{name}: the residual still depends on: {words}"))


def _where(doc: view.Document, console: Console, most: int = 6) -> None:
    regimes = [r for r in doc.regimes if r.significant][:most]
    if not regimes:
        return
    table = _table("where it fails", "", "share of the error", "of the time", right=("share of the error", "of the time"))
    for r in regimes:
        table.add_row(r.axis, r.label, units.percent(r.share), units.percent(r.of_time) if r.of_time is not None else "-")
    console.print(table)


def _candidates(candidates: list[view.Candidate], console: Console) -> None:
    table = _table("effect", "share", "confidence", "parameters", "not told apart from", right=("share", "confidence"))
    for c in candidates:
        parameters = ", ".join(f"{units.symbol(p.name)} = {p.text}" for p in c.parameters)
        table.add_row(c.effect + ("" if c.accepted else " (rejected)"), units.percent(c.share), units.percent(c.confidence) if c.accepted else "-", parameters, ", ".join(c.ties))
    console.print(table)


def _verdict(doc: view.Document, console: Console) -> None:
    answer = doc.answer
    if answer is None:
        return
    console.print(Text(f"{answer.headline}. {answer.sentence}", style="bold"))
    if answer.advice:
        console.print(Text(answer.advice))


def _next(doc: view.Document, console: Console) -> None:
    motion = doc.answer.next_record if doc.answer else None
    if motion is None:
        return
    console.print(Text(f"Next record: {motion.motion}" + (f" ({motion.why})" if motion.why else "")))
    if motion.table:
        columns = list(motion.table[0])
        table = _table(*columns)
        for row in motion.table[:12]:
            table.add_row(*[f"{v:.4g}" if isinstance(v, float) else str(v) for v in (row.get(c, "") for c in columns)])
        console.print(table)


def fit(document: dict, console: Console) -> None:
    doc = view.document(document)
    _records(doc, console)
    _parameters(doc.parameters, console)
    _errors(doc, console)
    _notices(doc, console)


def compare(document: dict, console: Console) -> None:
    doc = view.document(document)
    _records(doc, console)
    _errors(doc, console)
    _tests(doc, console)
    _where(doc, console)
    _notices(doc, console)


def explain(document: dict, console: Console) -> None:
    doc = view.document(document)
    _records(doc, console)
    _verdict(doc, console)
    if doc.answer:
        shown = [*doc.answer.accepted, *doc.answer.rejected[:3]]
        if shown:
            _candidates(shown, console)
    _where(doc, console)
    _errors(doc, console)
    _next(doc, console)
    _notices(doc, console)


def improve(document: dict, console: Console) -> None:
    doc = view.document(document)
    _records(doc, console)
    stairs(doc, console)
    if doc.ends:
        console.print(Text(f"Ends here: {view.ENDS.get(doc.ends, doc.ends)}.", style="bold"))
    _parameters(doc.parameters, console)
    _next(doc, console)
    _notices(doc, console)


def stairs(doc: view.Document, console: Console) -> None:
    """One line a step: the errors fall, and the bar shows what is still removable."""
    table = _table("", "added", "training", "held out", "free run", "left", "", right=("", "training", "held out", "free run", "left"))
    for k, step in enumerate(doc.steps):
        train, held = step.training.by_kind, step.held_out.by_kind
        left = step.share_left if step.share_left is not None else (1.0 if k == 0 else None)
        table.add_row(str(k), step.effect or "(as it came)", _error(train.get("equation")), _error(held.get("equation")),
                      _error(held.get("free_run") or train.get("free_run")), units.percent(left) if left is not None else "-",
                      "█" * round(12 * min(max(left or 0.0, 0.0), 1.0)))
    console.print(table)
    console.print("training, held out: balance of the equation; left: share of the removable error still there")


def power(document: dict, console: Console) -> None:
    doc = view.document(document)
    _records(doc, console)
    table = _table("effect", "smallest size found", "RMS of its residual", "times the floor", right=("RMS of its residual", "times the floor"))
    hidden = []
    for entry in document.get("effects") or []:
        if not entry.get("found"):
            hidden.append(f"{entry['effect']}: {entry.get('why', '')}")
            continue
        sizes = ", ".join(f"{p.name} = {p.text}" for p in view.parameters_of(entry.get("smallest")))
        ratio = entry.get("times_floor")
        table.add_row(entry["effect"], sizes, units.number(entry.get("rms"), entry.get("unit", ""), 3), f"{ratio:.2f}" if ratio else "-")
    console.print(table)
    if hidden:
        console.print(Text("Not to be found in these records:", style="bold"))
        for line in hidden:
            console.print(Text(f"  {line}"))
    _notices(doc, console)

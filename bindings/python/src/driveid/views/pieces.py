# SPDX-License-Identifier: Apache-2.0
"""Pieces of HTML that the report, the notebook and the workbench share: tables, verdict, bars, staircase."""

from __future__ import annotations

import re
from html import escape

import numpy as np

from . import units
from .figure import Axis, Figure
from .model import ERROR_KINDS, Answer, Candidate, Document, Error, ErrorSet, NextRecord, Parameter, Record, Regime, Revealed, Shape, Step, Test, effect_title


def tag(text: str, kind: str = "soft") -> str:
    return f'<span class="tag {kind}">{escape(text)}</span>'


def table(head: list[str], rows: list[list[str]], numeric: set[int] = frozenset()) -> str:
    """Cells are HTML already."""
    def cell(name: str, column: int, text: str) -> str:
        kind = ' class="num"' if column in numeric else ""
        return f"<{name}{kind}>{text}</{name}>"

    top = "".join(cell("th", k, text) for k, text in enumerate(head))
    body = "".join("<tr>" + "".join(cell("td", k, text) for k, text in enumerate(row)) + "</tr>" for row in rows)
    return f'<div class="scroll"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def parameter_name(name: str) -> str:
    return f'{units.symbol_html(name)} <code class="soft">{escape(name)}</code>'


def parameters(items: list[Parameter], before: dict[str, Parameter] | None = None) -> str:
    """Table of parameters with 95 % intervals; with ``before`` also what they were."""
    if not items:
        return '<p class="soft">No parameter has a value yet: fit the model.</p>'
    rows = []
    for p in items:
        belongs = tag(effect_title(p.effect)) if p.effect else ""
        state = {"given": tag("given"), "unset": tag("unset", "warn")}.get(p.state, "")
        row = [parameter_name(p.name), escape(p.text), f"{belongs} {state}".strip()]
        if before is not None:
            row.insert(1, escape(before[p.name].text) if p.name in before else '<span class="soft">not in the model</span>')
        rows.append(row)
    head = ["parameter", "value, 95 % interval", ""] if before is None else ["parameter", "before", "after", ""]
    return table(head, rows)


def error_text(error: Error | None) -> str:
    """``12.3 mN·m, 1.4 × floor``."""
    if error is None:
        return '<span class="soft">not given</span>'
    text = escape(units.number(error.rmse, error.unit, 3))
    times = error.times_floor
    if times is not None:
        kind = "good" if times <= 1.1 else "warn" if times <= 2.0 else "bad"
        text += " " + tag("at the floor" if times <= 1.1 else f"{times:.3g} × floor", kind)
    return text


def floor_text(error: Error | None) -> str:
    if error is None or error.floor is None:
        return '<span class="soft">not known</span>'
    lo, hi = error.floor
    return escape(f"{units.number(lo, error.unit, 3)} … {units.number(hi, error.unit, 3)}")


def errors(sets: list[tuple[str, ErrorSet]]) -> str:
    """One row a record and kind of error, with the noise floor beside it."""
    rows = []
    for name, errors_of in sets:
        for kind, error in errors_of.by_kind.items():
            fit = units.percent(error.fit_percent / 100.0) if error.fit_percent is not None else ""
            rows.append([escape(name), escape(ERROR_KINDS[kind]), units.symbol_html(error.signal) if error.signal else "",
                         error_text(error), floor_text(error), fit])
            name = ""
    return table(["record", "error", "of", "root mean square", "noise floor", "fit"], rows, {5}) if rows else ""


def tests(items: list[tuple[str, list[Test]]]) -> str:
    rows = []
    for name, of_record in items:
        for test in of_record:
            verdict = tag("passed", "good") if test.passed else tag("failed", "bad")
            rows.append([escape(name), escape(test.name.replace("_", " ")), units.number(test.statistic, "", 3), units.number(test.bound, "", 3), verdict])
            name = ""
    return table(["record", "is the residual free of …", "statistic", "bound", ""], rows, {2, 3}) if rows else ""


def records(items: list[Record]) -> str:
    rows = [[escape(r.name), escape(r.role) or "", f"{r.rows:,}".replace(",", " "), escape(units.duration(r.span_s)),
             f'<code title="{escape(r.hash)}">{escape(r.hash[:16])}</code>'] for r in items]
    return table(["record", "", "rows", "length", "SHA-256"], rows, {2}) if rows else '<p class="soft">No record.</p>'


def answer(item: Answer, notices: list[str], fold: bool = False) -> str:
    """The verdict as the first thing that one reads; many notices may be folded."""
    lines = "".join(f"<li>{escape(n)}</li>" for n in notices)
    advice = f'<p class="advice">{escape(item.advice)}</p>' if item.advice else ""
    return (f'<section class="card answer {escape(item.verdict)}"><p class="headline">{escape(item.headline)}</p>'
            f"<p>{escape(item.sentence)}</p>{advice}{_notices(lines, len(notices), fold)}</section>")


def _notices(lines: str, count: int, fold: bool) -> str:
    if not lines:
        return ""
    shown = f'<ul class="notices">{lines}</ul>'
    return f"<details><summary>{count} notices about data and model</summary>{shown}</details>" if fold and count > 2 else shown


def regimes(items: list[Regime], most: int = 10) -> str:
    """Bars: which part of the record holds how much of the error."""
    if not items:
        return '<p class="soft">No regime holds more of the error than its share of the time.</p>'
    longest = max(max(r.share for r in items), 1e-12)
    cells = []
    for r in items[:most]:
        weak = "" if r.significant else " weak"
        time = f" in {units.percent(r.of_time)} of the time" if r.of_time is not None else ""
        cells.append(f'<div class="regime"><span class="coordinate{weak}">{escape(r.axis)}</span><span class="{weak.strip()}">{escape(r.label)}</span>'
                     f'<span class="track{weak}" title="{units.percent(r.share)}{time}"><span class="fill" style="display:block;width:{100 * max(r.share, 0) / longest:.1f}%"></span></span>'
                     f'<span class="share">{units.percent(r.share)}</span></div>')
    return f'<div class="bars">{"".join(cells)}</div>'


def candidate_rows(items: list[Candidate]) -> str:
    rows = []
    for c in items:
        values = "; ".join(f"{units.symbol_html(p.name)} = {escape(p.text)}" for p in c.parameters)
        ties = f'not told apart from {escape(", ".join(effect_title(t) for t in c.ties))}' if c.ties else ""
        verdict = tag("missing", "warn") if c.accepted else tag("rejected")
        rows.append([f'<b>{escape(c.title)}</b><br><code class="soft">{escape(c.equation or c.effect)}</code>', verdict, units.percent(c.share),
                     units.percent(c.confidence) if c.confidence is not None and c.accepted else "", values or escape(c.why), ties])
    return table(["effect", "", "explains", "confidence", "parameters", ""], rows, {2, 3}) if rows else ""


def power(items: list[Revealed]) -> str:
    """What these records could show: the smallest size of each effect, the easiest first, then what they would miss."""
    rows = []
    for r in sorted(items, key=lambda r: (not r.found, r.times_floor or 0.0)):
        size = "; ".join(f"{units.symbol_html(p.name)} = {escape(p.text)}" for p in r.smallest)
        times = f"{r.times_floor:.2g} × floor" if r.times_floor is not None else ""
        rows.append([f"<b>{escape(r.title)}</b>", tag("would be found", "good") if r.found else tag("would be missed", "warn"), size or escape(r.why), times])
    return table(["effect", "", "smallest size", "its part of the error"], rows, {3}) if rows else ""


def next_record(item: NextRecord) -> str:
    why = item.why
    for name in item.separates:
        why = re.sub(rf"\b{re.escape(name)}\b", effect_title(name), why)
    separates = f'<p class="soft">It tells apart: {escape(", ".join(effect_title(s) for s in item.separates))}.</p>' if len(item.separates) > 1 else ""
    return f"<p>{escape(_sentence(item.motion))}</p><p class=soft>{escape(_sentence(why))}</p>{separates}{_set_points(item.table)}"


def _sentence(text: str) -> str:
    text = text[:1].upper() + text[1:]
    return text if not text or text[-1] in ".!?" else text + "."


def _set_points(rows: list[dict]) -> str:
    """Set points as a drawn profile, with the numbers to type into a drive under it."""
    if not rows:
        return ""
    head = list(rows[0])
    numbers = table([units.symbol_html(h) + (f" / {units.split_name(h)[1]}" if units.split_name(h)[1] else "") for h in head],
                    [[escape(_cell(row.get(h))) for h in head] for row in rows], set(range(len(head))))
    if len(head) < 2 or len(rows) < 3 or not all(isinstance(row.get(h), (int, float)) for row in rows for h in head[:2]):
        return numbers
    x, y = (np.array([float(row[h]) for row in rows]) for h in head[:2])
    figure = Figure(Axis.around([x], "time", units.split_name(head[0])[1], pad=0.02), Axis.around([y], units.symbol(head[1]), units.split_name(head[1])[1], zero=True), width=560, height=150,
                    label="set points of the motion")
    figure.line([figure.x.lo, figure.x.hi], [0.0, 0.0], "zero", thin=False)
    figure.line(x, y, "model0", thin=False)
    return f"{figure.svg()}<details><summary>Set points as a table</summary>{numbers}</details>"


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)


def shape(item: Shape) -> str:
    """The unknown part: a curve over one coordinate, else a table of the largest values."""
    name = item.coordinates[0]
    text, unit = units.symbol(name), units.split_name(name)[1]
    if len(item.coordinates) == 1:
        rows = sorted(item.table)
        x, y = np.array([r[0][0] for r in rows]), np.array([r[1] for r in rows])
        figure = Figure(Axis.around([x], text, unit, pad=0.02), Axis.around([y], "residual", item.unit, zero=True), height=220, label="shape of the unknown part")
        figure.line([figure.x.lo, figure.x.hi], [0.0, 0.0], "zero", thin=False)
        figure.line(x, y, "residual", thin=False)
        figure.points(x, y, "residual")
        return figure.svg()
    rows = sorted(item.table, key=lambda r: -abs(r[1]))[:12]
    head = [units.symbol_html(c) for c in item.coordinates] + ["residual"]
    return table(head, [[escape(units.number(v, units.split_name(c)[1], 3)) for v, c in zip(at, item.coordinates, strict=True)]
                        + [escape(units.number(value, item.unit, 3))] for at, value in rows], set(range(len(head))))


def staircase_kind(steps: list[Step]) -> str | None:
    """The error that every step has, on the side of the equation if possible."""
    for kind in ("equation", "one_step", "windows", "free_run"):
        if all(kind in s.training.by_kind or kind in s.held_out.by_kind for s in steps):
            return kind
    return None


def staircase(steps: list[Step], kind: str | None = None, width: int = 860, height: int = 270) -> str:
    """Each added effect as a step, training and held-out side by side, down to the noise floor."""
    kind = kind or (staircase_kind(steps) if steps else None)
    if kind is None:
        return '<p class="soft">No step yet. Add an effect, and its step stands here.</p>'
    pairs = [(s, s.training.by_kind.get(kind), s.held_out.by_kind.get(kind)) for s in steps]
    known = [e for _, a, b in pairs for e in (a, b) if e]
    floors = [e.floor for e in known if e.floor and e.floor[1] > 0.0]
    floor = (max(f[0] for f in floors), min(f[1] for f in floors)) if floors else None  # each bracket holds the one floor of these data
    values = [e.rmse for e in known if e.rmse > 0.0] + [f for f in floor or () if f > 0.0]
    lo, hi = min(values), max(values)
    log = hi / lo > 6.0
    y = Axis(lo / 1.4, hi * 1.35, "error", known[0].unit, True) if log else Axis(0.0, hi * 1.15, "error", known[0].unit)
    marks = [(k + 0.5, ("+ " if s.effect else "") + s.title) for k, (s, _, _) in enumerate(pairs)]
    figure = Figure(Axis(0.0, max(float(len(pairs)), 4.0)), y, width=width, height=height, label="error after each added effect", x_texts=marks, bottom=26)
    if floor:
        figure.rect(0.0, figure.x.hi, max(min(floor), y.lo), max(floor), "floor", "noise floor")
    for k, (step, training, held_out) in enumerate(pairs):
        for error, a, b, cls, side in ((training, 0.16, 0.49, "train", "training"), (held_out, 0.51, 0.84, "held", "held out")):
            if error:
                figure.rect(k + a, k + b, y.lo, error.rmse, cls, f"{step.title}, {side}: {units.number(error.rmse, error.unit, 3)}")
    treads = [(k, e.rmse) for k, (_, a, b) in enumerate(pairs) if (e := b or a)]
    corners = [(x, value) for k, value in treads for x in (k, k + 1)]
    figure.line([x for x, _ in corners], [v for _, v in corners], "tread", thin=False)
    divisor, _ = units.scale_of(max(abs(y.lo), abs(y.hi)), units.pretty_unit(y.unit))
    for k, (_, training, held_out) in enumerate(pairs):
        for error, middle in ((training, 0.325), (held_out, 0.675)):
            if error:
                figure.text(k + middle, error.rmse, f"{error.rmse / divisor:.3g}", "strong", dy=-6)
    legend = '<div class="legend"><span class="box light">training</span><span class="box">held out</span><span class="box floor">noise floor</span></div>'
    return legend + figure.svg()


def overlay(t: np.ndarray, measured: np.ndarray, models: list[tuple[str, np.ndarray]], name: str, unit: str, height: int = 210) -> str:
    """Measurement over model."""
    figure = Figure(Axis(float(t[0]), float(t[-1]), "time", "s"), Axis.around([measured] + [m for _, m in models], name, unit), height=height,
                    label=f"{name}: measured and model")
    figure.line(t, measured, "measured")
    for k, (_, values) in enumerate(models[:3]):
        figure.line(t, values, f"model{k}")
    names = "".join(f'<span class="model{k}">{escape(title)}</span>' for k, (title, _) in enumerate(models[:3]))
    return f'<div class="legend"><span class="measured">measured</span>{names}</div>{figure.svg()}'


def residual(t: np.ndarray, values: np.ndarray, unit: str, floor: tuple[float, float] | None = None, height: int = 130) -> str:
    """Residual under the overlay, with the band that noise alone would fill (twice the floor)."""
    y = Axis.around([values], "residual", unit, zero=True)
    figure = Figure(Axis(float(t[0]), float(t[-1]), "time", "s"), y, height=height, label="residual against time")
    if floor:
        reach = 2.0 * floor[1]
        figure.rect(figure.x.lo, figure.x.hi, max(-reach, y.lo), min(reach, y.hi), "floor", "two noise floors")
    figure.line(t, values, "residual")
    return figure.svg()


def binned(x: np.ndarray, y: np.ndarray, bins: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Mean of y over bins of x; NaN where too few points mean nothing."""
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = x[keep], y[keep]
    if x.size < 20 or not x.max() > x.min():
        return np.empty(0), np.empty(0)
    edges = np.linspace(x.min(), x.max(), bins + 1)
    index = np.clip(np.digitize(x, edges) - 1, 0, bins - 1)
    count = np.bincount(index, minlength=bins)
    mean = np.bincount(index, y, bins) / np.maximum(count, 1)
    return (edges[:-1] + edges[1:]) / 2, np.where(count >= max(3, x.size // 5000), mean, np.nan)


def cloud(x: np.ndarray, y: np.ndarray, name: str, unit: str, y_unit: str, predicted: np.ndarray | None = None, width: int = 440, height: int = 240,
          bins: int = 60) -> str:
    """Residual against one coordinate, with its mean; ``predicted`` is what an effect says the residual is."""
    low, high = np.nanpercentile(y, [0.2, 99.8]) if np.isfinite(y).any() else (0.0, 1.0)
    figure = Figure(Axis.around([x], name, unit, pad=0.02), Axis.around([np.array([low, high])], "residual", y_unit, zero=True, pad=0.1),
                    width=width, height=height, label=f"residual against {name}")
    inside = np.where((y >= figure.y.lo) & (y <= figure.y.hi), y, np.nan)
    figure.points(x, inside, "residual")
    figure.line([figure.x.lo, figure.x.hi], [0.0, 0.0], "zero", thin=False)
    if predicted is not None:
        at, mean = binned(x, predicted, bins)
        figure.line(at, np.clip(mean, figure.y.lo, figure.y.hi), "predicted", thin=False)
    figure.line(*binned(x, y, bins), "measured", thin=False)
    return figure.svg()


def summary(doc: Document) -> str:
    """A line that says what the document is about."""
    names = ", ".join(r.name for r in doc.records[:3]) + (f" and {len(doc.records) - 3} more" if len(doc.records) > 3 else "")
    return f'<p class="soft">{escape(doc.model.title)} against {escape(names)}</p>' if names else f'<p class="soft">{escape(doc.model.title)}</p>'

# SPDX-License-Identifier: Apache-2.0
"""The report: one HTML file without outside links, small enough to mail, printable as PDF by the browser's print style."""

from __future__ import annotations

import json
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from . import model as view
from . import pieces
from .clouds import coordinates
from .series import Series, as_series

QUESTIONS = {
    "fit": "Which parameters make this model follow these records?",
    "compare": "Does this model follow these records, and where not?",
    "explain": "Which physical effect does this model lack?",
    "power": "How small an effect would these records reveal?",
    "improve": "Which effects must be added until only noise is left?",
}


def style() -> str:
    return resources.files(__package__).joinpath("static/driveid.css").read_text("utf-8")


def _card(title: str, body: str) -> str:
    return f'<section class="card"><h2>{escape(title)}</h2>{body}</section>' if body else ""


def _plots(series: list[Series], doc: view.Document) -> str:
    out = []
    for one in series:
        for pair in one.pairs():
            floor = next((e.floor for _, s in doc.errors for e in s.by_kind.values() if e.signal == pair.name and e.floor), None)
            out.append(f"<h3>{escape(one.record)}: {escape(pair.title)}</h3>"
                       + pieces.overlay(one.t_s, pair.measured, [(doc.model.title, pair.model)], pair.symbol, pair.unit)
                       + pieces.residual(one.t_s, pair.residual, pair.unit, floor))
    return "".join(out)


def _clouds(series: list[Series]) -> str:
    """Residual of the equation over what it may depend on, for the last record."""
    if not series:
        return ""
    one = series[-1]
    balance = one.balance()
    if balance is None:
        return ""
    heading = f"<h3>{escape(one.record)}, {escape(balance.title)}</h3>"
    plots = [pieces.cloud(c.values, balance.values, c.title, c.unit, balance.unit) for c in coordinates(one) if c.key != "t_s"]
    return heading + '<div style="display:grid;grid-template-columns:repeat(auto-fit,minmax(320px,1fr));gap:10px">' + "".join(plots[:6]) + "</div>"


def _found(doc: view.Document) -> str:
    if not doc.answer:
        return ""
    shown = pieces.candidate_rows(doc.answer.accepted)
    rest = pieces.candidate_rows(doc.answer.rejected[:8])
    return (shown or '<p class="soft">No effect was accepted.</p>') + (f"<h3>Looked at and rejected</h3>{rest}" if rest else "")


def _untold(doc: view.Document) -> str:
    answer = doc.answer
    if not answer:
        return ""
    ties = [c for c in answer.accepted if c.ties]
    lines = "".join(f"<p>{escape(c.title)} is not told apart from {escape(', '.join(view.effect_title(t) for t in c.ties))}.</p>" for c in ties)
    motion = pieces.next_record(answer.next_record) if answer.next_record else ""
    shape = pieces.shape(answer.shape) if answer.shape else ""
    return lines + (f"<h3>The record that would tell</h3>{motion}" if motion else "") + (f"<h3>Shape of the unknown part</h3>{shape}" if shape else "")


def body(document: dict, series: list[Series] = (), command: str = "", title: str = "") -> str:
    """The inside of the report, also used by the workbench's export."""
    doc = view.document(document)
    stairs = ""
    if len(doc.steps) > 1:
        stairs = pieces.staircase(doc.steps)
    answer = pieces.answer(doc.answer, doc.notices) if doc.answer else ""
    notices = "" if answer or not doc.notices else "<ul class=notices>" + "".join(f"<li>{escape(n)}</li>" for n in doc.notices) + "</ul>"
    model_text = document.get("model_toml") or (document.get("model") if isinstance(document.get("model"), str) and "\n" in document["model"] else "")
    reproduce = (f"<p>driveid {escape(doc.version)}, format {escape(str(document.get('format', '')))}.</p>"
                 + (f"<pre>{escape(command)}</pre>" if command else "")
                 + (f"<h3>Model file</h3><pre>{escape(model_text)}</pre>" if model_text else ""))
    parts = [
        f"<header><h1>{escape(title or QUESTIONS[doc.kind])}</h1>{pieces.summary(doc)}</header>",
        answer,
        _card("The error falls", stairs),
        _card("What would be found", pieces.power(doc.power) if doc.kind == "power" else ""),
        _card("Parameters", pieces.parameters(doc.parameters) if doc.parameters else ""),
        _card("Comparison", pieces.errors(doc.errors) + _plots(list(series), doc) + notices),
        _card("Tests of the residual", pieces.tests(doc.tests)),
        _card("Where it fails", (pieces.regimes(doc.regimes) if doc.regimes else "") + _clouds(list(series))),
        _card("What was found", _found(doc)),
        _card("What cannot be told", _untold(doc)),
        _card("Data", pieces.records(doc.records)),
        _card("How to reproduce", reproduce),
    ]
    return "".join(parts)


def html(document: dict, series: list[Series] = (), command: str = "", title: str = "") -> str:
    """A whole page as text."""
    heading = title or QUESTIONS[view.kind_of(document)]
    data = json.dumps(document, separators=(",", ":"), allow_nan=False, default=str).replace("<", "\\u003c")
    return ('<!doctype html><html lang="en" class="driveid-page"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width,initial-scale=1">'
            '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; style-src \'unsafe-inline\'; img-src data:">'
            f"<title>{escape(heading)}</title><style>{style()}</style></head>"
            f'<body><main class="driveid report">{body(document, series, command, title)}</main>'
            f'<script type="application/json" id="document">{data}</script></body></html>')


def write_html(document: dict, path: str | Path, series: list[Any] = (), command: str = "", title: str = "") -> Path:
    """Write the report of one JSON document.

    series: one Series (views.series) a record, in the order in which they are shown; may be empty.
    command: the command line that reproduces it."""
    path = Path(path)
    path.write_text(html(document, [as_series(s) for s in series], command, title), "utf-8")
    return path

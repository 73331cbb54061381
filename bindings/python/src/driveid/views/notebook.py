# SPDX-License-Identifier: Apache-2.0
"""How a fit, a comparison and an explanation draw themselves in a notebook: the report's pieces, its style, and plain text for the rest."""

from __future__ import annotations

from html import escape

from . import model as view
from . import pieces, report
from .series import as_series


def html(document: dict, series: list = ()) -> str:
    """A fragment that carries its own style; light and dark follow the reader's system."""
    doc = view.document(document)
    parts = [pieces.summary(doc)]
    if doc.answer:
        parts.append(pieces.answer(doc.answer, doc.notices))
        parts.append(pieces.candidate_rows(doc.answer.accepted))
        parts.append(pieces.shape(doc.answer.shape) if doc.answer.shape else "")
    if len(doc.steps) > 1:
        parts.append(pieces.staircase(doc.steps))
    if doc.kind in ("fit", "improve"):
        parts.append(pieces.parameters(doc.parameters))
    if doc.kind == "power":
        parts.append(pieces.power(doc.power))
    if doc.kind == "compare":
        parts.append(pieces.errors(doc.errors))
        parts.append(pieces.regimes(doc.regimes, 5))
    parts += [plot for one in series for plot in _plots(as_series(one), doc)]
    if not doc.answer and doc.notices:
        parts.append('<ul class="notices">' + "".join(f"<li>{escape(n)}</li>" for n in doc.notices) + "</ul>")
    return f'<div class="driveid notebook"><style>{report.style()}</style>{"".join(parts)}</div>'


def _plots(series, doc: view.Document) -> list[str]:
    pair = next(iter(series.pairs()), None)
    if pair is None:
        return []
    return [f"<h3>{escape(series.record)}: {escape(pair.title)}</h3>", pieces.overlay(series.t_s, pair.measured, [(doc.model.title, pair.model)], pair.symbol, pair.unit),
            pieces.residual(series.t_s, pair.residual, pair.unit)]


def text(document: dict) -> str:
    """The same in words, for consoles and for notebooks that show no HTML."""
    doc = view.document(document)
    lines = [doc.model.title]
    if doc.answer:
        lines += [doc.answer.headline, doc.answer.sentence]
    lines += [f"  {p.name} = {p.text}" for p in doc.parameters if p.value is not None]
    lines += [f"  {name}: {kind} {e.rmse:.4g} {e.unit}" for name, errors in doc.errors for kind, e in errors.by_kind.items()]
    lines += [f"  + {s.title}" for s in doc.steps if s.effect]
    return "\n".join(line for line in lines if line)


def bundle(document: dict, series: list = ()) -> dict[str, str]:
    """For ``_repr_mimebundle_``: the picture, and the words for those who show no pictures."""
    return {"text/html": html(document, series), "text/plain": text(document)}

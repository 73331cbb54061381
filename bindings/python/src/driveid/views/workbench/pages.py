# SPDX-License-Identifier: Apache-2.0
"""What each page of the workbench shows, as JSON with ready pieces of HTML. Called in a background thread."""

from __future__ import annotations

from html import escape

import numpy as np

from .. import model as view
from .. import pieces, units
from ..clouds import coordinates, spectrum
from ..decimate import Pyramid, trace
from ..series import Curve, Series
from . import chain as chains
from .chain import Chain
from .engine import Engine, Trouble
from .jobs import Progress
from .projects import Project

CLOUD_POINTS = 6000

# Coordinate in which an effect shows best.
_SHOWN_OVER = {
    "cogging": "turn", "torque_ripple": "turn", "gravity_unbalance": "turn", "eccentric_friction": "turn", "encoder_eccentricity": "turn",
    "load_dependent_friction": "current", "torque_saturation": "current", "current_offset": "current", "dead_zone": "current", "dead_time_voltage": "current",
    "inertia_change": "t_s", "friction_drift": "t_s", "resistance_drift": "t_s", "delay": "acceleration", "compliance": "acceleration", "backlash": "acceleration",
    "hysteresis": "position",
}


def project_page(engine: Engine, project: Project, chain: Chain) -> dict:
    """Name, model and records: cheap, shown at once."""
    runs = engine.records(project)
    model = view.Model.of(project.model_toml)
    return {"id": project.id, "name": project.name, "structure": model.structure.replace("_", " "), "effects": [{"name": e, "title": view.effect_title(e)} for e in model.effects],
            "chain": [{"name": e, "title": t} for e, t in zip(chain, chains.titles(chain), strict=True)], "others": [name for name, _ in project.others],
            "records": [{"name": r.name, "role": role.replace("_", " "), "rows": r.rows, "span": units.duration(_span(r)), "t0": 0.0,
                         "t1": _span(r) or 1.0, "notices": list(r.notices)} for role, r in runs],
            "signals": [{"name": n, "symbol": units.symbol(n), "unit": units.split_name(n)[1]} for n in (runs[0][1].columns if runs else [])]}


def _span(run) -> float:
    return float(run.t_ns[-1] - run.t_ns[0]) * 1e-9 if run.rows else 0.0


def _chain_name(chain: Chain) -> str:
    return "+ " + chains.titles(chain)[-1] if chain else "first model"


def compare_page(engine: Engine, project: Project, chain: Chain, record: int, tell: Progress) -> dict:
    doc = view.document(engine.compared(project, chain, tell))
    series = engine.series(project, chain, record, tell)
    pairs = [{"name": p.key, "title": p.title} for p in series.pairs()] + [{"name": c.name, "title": c.title} for c in series.balances()]
    return {"errors": side_by_side(doc), "tests": pieces.tests(doc.tests), "notices": doc.notices, "pairs": pairs, "model": doc.model.title}


def side_by_side(doc: view.Document) -> str:
    """Training and held-out errors in neighbouring columns."""
    sides = sides_of(doc)
    rows = []
    for kind, words in view.ERROR_KINDS.items():
        errors = [s.by_kind.get(kind) for s in sides.values()]
        if not any(errors):
            continue
        some = next(e for e in errors if e)
        rows.append([f"{escape(words)} ({units.symbol_html(some.signal)})" if some.signal else escape(words), *[pieces.error_text(e) for e in errors], pieces.floor_text(some)])
    return pieces.table(["error", *[escape(name) for name in sides], "noise floor"], rows) if rows else '<p class="soft">No error yet.</p>'


def sides_of(doc: view.Document) -> dict[str, view.ErrorSet]:
    """Error sets under ``training`` and ``held out``: the document's own, else the last record of each role."""
    found = {name.split(",")[0]: errors for name, errors in doc.errors if name in ("training, before", "held out, before")}
    if found:
        return found
    roles = {r.name: r.role or "training" for r in doc.records}
    out: dict[str, view.ErrorSet] = {}
    for name, errors in doc.errors:
        out[roles.get(name, name)] = errors
    return out


def sides_of_chain(engine: Engine, project: Project, chain: Chain, tell: Progress) -> dict[str, view.ErrorSet]:
    """Without a held-out record the explanation sets blocks aside, and its errors are the honest ones."""
    ask = engine.compared if project.held_out else engine.explained
    return sides_of(view.document(ask(project, chain, tell)))


def signal_trace(engine: Engine, project: Project, record: int, names: list[str], begin: float, end: float, pixels: int) -> tuple[dict, dict]:
    """Measured signals as they are in the record."""
    run = engine.records(project)[record][1]
    t, pyramids = run_pyramids(engine, project, record)
    known = [n for n in names if n in pyramids] or list(run.columns)
    times, rows = trace(t, [pyramids[n] for n in known], begin, end, pixels)
    return {"names": known, "units": [units.split_name(n)[1] for n in known], "symbols": [units.symbol(n) for n in known]}, {"t": times, **dict(zip(known, rows, strict=True))}


class RunPyramids(dict):
    """Pyramids of one record; knows its size for the memory limit."""

    @property
    def nbytes(self) -> int:
        return sum(p.samples.nbytes // 16 for p in self.values())


def run_pyramids(engine: Engine, project: Project, record: int) -> tuple[np.ndarray, RunPyramids]:
    run = engine.records(project)[record][1]

    def build() -> tuple[np.ndarray, RunPyramids]:
        return run.t_s, RunPyramids({n: Pyramid(np.asarray(v, dtype=float)) for n, v in run.columns.items()})

    return engine.jobs.once((project.id, "pyramids", record), build)


def pair_trace(engine: Engine, project: Project, chains: list[Chain], others: list[int], record: int, pair: str, begin: float, end: float, pixels: int,
               tell: Progress) -> tuple[dict, dict]:
    """Measured, each model's prediction and each residual of one signal."""
    found = [(_chain_name(c), engine.series(project, c, record, tell)) for c in chains]
    found += [(project.others[n][0], engine.other_series(project, n, record, tell)) for n in others if n < len(project.others)]
    if not found:
        raise Trouble("choose at least one model")
    arrays: dict[str, np.ndarray] = {}
    head: dict = {"models": [name for name, _ in found]}
    for k, (_, series) in enumerate(found):
        match = next((p for p in series.pairs() if p.key == pair), None)
        if match is not None:
            t, rows = trace(series.t_s, [series.pyramid(match.measured_name), series.pyramid(match.model_name), series.residual_pyramid(match)], begin, end, pixels)
            arrays |= {f"model{k}": rows[1], f"residual{k}": rows[2]} | ({"t": t, "measured": rows[0]} if k == 0 else {})
            head |= {"symbol": match.symbol, "unit": units.pretty_unit(match.unit)}
            continue
        left = series.balance(pair)
        if left is None:
            raise Trouble("this record has no signal that the model predicts")
        t, rows = trace(series.t_s, [series.pyramid(left.name)], begin, end, pixels)
        arrays |= {f"residual{k}": rows[0]} | ({"t": t} if k == 0 else {})
        head |= {"unit": units.pretty_unit(left.unit), "only": "residual"}
    return head, arrays


def cloud_page(engine: Engine, project: Project, chain: Chain, record: int, equation: str, tell: Progress) -> tuple[dict, dict]:
    """Residual of the equation against everything it may depend on, thinned to some thousand points that all views share."""
    series = engine.series(project, chain, record, tell)
    residual = series.balance(equation)
    if residual is None:
        raise Trouble("this record gives no residual: the model predicts none of its signals")
    known = coordinates(series)
    rows = len(series.t_s)
    keep = np.unique(np.linspace(0, rows - 1, min(CLOUD_POINTS, rows)).astype(int))  # with the gaps, so that they stay gaps
    frequency, amplitude = spectrum(series.t_s, residual.values)
    arrays = {"t": series.t_s[keep], "residual": residual.values[keep]}
    arrays |= {c.key: c.values[keep] for c in known if c.key != "t_s"} | {"frequency": frequency, "amplitude": amplitude}
    head = {"unit": units.pretty_unit(residual.unit), "coordinates": [{"key": c.key, "title": c.title, "unit": c.unit} for c in known],
            "points": int(keep.size), "rows": rows, "equations": [{"name": c.name, "title": c.title} for c in series.balances()], "equation": residual.name}
    return head, arrays


def regimes_page(engine: Engine, project: Project, chain: Chain, tell: Progress) -> dict:
    """Which part of the records holds the error: the explanation knows it, the clouds need not wait for it."""
    regimes = view.document(engine.explained(project, chain, tell)).regimes
    return {"html": pieces.regimes(regimes), "boxes": [_box(r) for r in regimes[:10]]}


_CLOUD_OF_AXIS = {"speed": "speed", "acceleration": "acceleration", "current": "current", "drive": "current", "temperature": "temperature", "time": "t_s", "position": "position"}


def _box(regime: view.Regime) -> dict | None:
    """The cloud and range that a regime stands for, so that a click on it selects its points."""
    if regime.axis == "direction":
        return {"key": "direction", "lo": 0.5, "hi": 1.5} if regime.label == "forward" else {"key": "direction", "lo": -1.5, "hi": -0.5}
    key = _CLOUD_OF_AXIS.get(regime.axis)
    if regime.lo is None or key is None:
        return None
    return {"key": key, "lo": regime.lo, "hi": regime.hi, "abs": regime.axis in ("speed", "acceleration", "current", "drive")}


def missing_page(engine: Engine, project: Project, chain: Chain, tell: Progress) -> dict:
    doc = view.document(engine.explained(project, chain, tell))
    answer = doc.answer
    if answer is None:
        raise Trouble("the library gave no verdict")
    return {"verdict": answer.verdict, "html": pieces.answer(answer, doc.notices, fold=True), "candidates": [_card(c, answer) for c in answer.accepted + answer.rejected[:6]],
            "rejected": pieces.candidate_rows(answer.rejected), "next": pieces.next_record(answer.next_record) if answer.next_record else "",
            "shape": pieces.shape(answer.shape) if answer.shape else ""}


def _card(candidate: view.Candidate, answer: view.Answer) -> dict:
    ties = [{"name": t, "title": view.effect_title(t)} for t in candidate.ties]
    values = "; ".join(f"{units.symbol_html(p.name)} = {escape(p.text)}" for p in candidate.parameters)
    return {"effect": candidate.effect, "title": candidate.title, "accepted": candidate in answer.accepted, "share": units.percent(candidate.share),
            "confidence": units.percent(candidate.confidence) if candidate.confidence is not None and candidate.accepted else "", "parameters": values, "ties": ties, "why": candidate.why, "equation": candidate.equation,
            "orders": chains.orders(p.name for p in candidate.parameters)}


def evidence(engine: Engine, project: Project, chain: Chain, effect: str, beside: Chain, record: int, tell: Progress) -> dict:
    """What the effect predicts of the residual, drawn over the residual that is there without it.

    beside: all effects found together; both models have the others, so that only this effect differs."""
    others = tuple(dict.fromkeys(e for e in beside if e != effect))
    before = engine.series(project, (*chain, *others), record, tell)
    after = engine.series(project, (*chain, *others, *(effect,) * max(beside.count(effect), 1)), record, tell)
    old, new = _most_explained(before, after)
    if old is None or new is None:
        return {"html": '<p class="soft">This record gives no residual to draw.</p>'}
    known = {c.key: c for c in coordinates(before)}
    at = known.get(_SHOWN_OVER.get(effect, "speed")) or known.get("speed") or known["t_s"]
    predicted = old.values - new.values
    plot = pieces.cloud(at.values, old.values, at.title, at.unit, units.pretty_unit(old.unit), predicted, bins=220 if at.key == "turn" else 60)
    legend = '<div class="legend"><span class="residual">residual</span><span class="measured">its mean</span><span class="predicted">what the effect says</span></div>'
    return {"html": legend + plot}


def _most_explained(before: Series, after: Series) -> tuple[Curve | None, Curve | None]:
    """The equation whose residual the effect lowers most: torque for friction, voltage for a resistance."""
    def left(curve: Curve) -> float:
        new = after.balance(curve.name)
        old = np.nanmean(curve.values**2)
        return float(np.nanmean(new.values**2) / old) if new is not None and new.name == curve.name and old > 0.0 else 1.0

    known = before.balances()
    best = min(known, key=left) if known else None
    return best, after.balance(best.name) if best else None


def stairs_page(engine: Engine, project: Project, chain: Chain, kind: str, tell: Progress) -> dict:
    steps = []
    for k in range(len(chain) + 1):
        tell(k / (len(chain) + 1), f"comparing {_chain_name(chain[:k])}")
        sides = sides_of_chain(engine, project, chain[:k], tell)
        steps.append(view.Step(chain[k - 1] if k else "", sides.get("training", view.ErrorSet()), sides.get("held out", view.ErrorSet()), label=chains.titles(chain[:k])[-1] if k else ""))
    kinds = [k for k in view.ERROR_KINDS if all(k in s.training.by_kind or k in s.held_out.by_kind for s in steps)]
    kind = kind if kind in kinds else pieces.staircase_kind(steps) or ""
    before = {p.name: p for p in view.Model.of(engine.model_toml(project, (), tell)).parameters}
    after = view.Model.of(engine.model_toml(project, chain, tell)).parameters
    numbers = [{"effect": s.effect, "training": _value(s.training, kind), "held_out": _value(s.held_out, kind)} for s in steps]
    return {"staircase": pieces.staircase(steps, kind or None, 1000, 250), "kind": kind, "kinds": [{"name": k, "title": view.ERROR_KINDS[k]} for k in kinds], "steps": numbers,
            "parameters": pieces.parameters(after, before if chain else None)}


def _value(errors: view.ErrorSet, kind: str) -> float | None:
    return errors.by_kind[kind].rmse if kind in errors.by_kind else None


def report_series(engine: Engine, project: Project, chain: Chain, tell: Progress) -> list[Series]:
    return [engine.series(project, chain, k, tell) for k in range(min(len(engine.records(project)), 3))]

# SPDX-License-Identifier: Apache-2.0
"""View data out of the JSON documents (docs/manual/json.md): what each screen shows, without any drawing.

Report, notebook, workbench and tests read these objects; nothing here knows HTML. A key that a document leaves out becomes
an empty value and its part of the view is left out, never guessed."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import dataclass, field
from typing import Any

from . import units

ERROR_KINDS = {
    "equation": "balance of the equation",
    "one_step": "one step ahead",
    "windows": "short windows (0.1 to 1 s)",
    "free_run": "free run from the start",
}
TITLES = {
    "coulomb": "Coulomb friction", "stribeck": "Stribeck friction", "lugre": "LuGre friction (pre-sliding)",
    "delay": "dead time", "dead_time_voltage": "inverter dead-time voltage", "torque_saturation": "torque saturation (iron)",
    "current_offset": "offset of the current reading", "constant_load": "constant load", "compliance": "compliance (two masses)",
}
VERDICTS = {
    "missing": "An effect is missing",
    "nothing_missing": "Nothing is missing",
    "cannot_tell": "Something is missing, and these data cannot tell which of two",
    "unknown": "Something is missing that the catalogue does not know",
    "bad_data": "These data cannot answer",
}
ENDS = {
    "noise_floor": "the error has reached the noise floor",
    "tie": "what is left has two explanations that these data cannot tell apart",
    "unknown": "what is left matches no effect of the catalogue",
    "nothing_missing": "nothing was missing",
}


def effect_title(name: str) -> str:
    """``quadratic_drag`` -> ``quadratic drag``; an own effect of an address is ``name:adds_to:formula``."""
    name = name.partition(":")[0]
    return TITLES.get(name, name.replace("_", " "))


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def _pair(value: Any) -> tuple[float, float] | None:
    if isinstance(value, (list, tuple)) and len(value) == 2 and all(_number(v) is not None for v in value):
        return float(value[0]), float(value[1])
    return None


@dataclass(frozen=True)
class Error:
    """One error object: root mean square in SI units beside the bracket of the noise floor."""

    rmse: float
    unit: str = ""
    signal: str = ""
    floor: tuple[float, float] | None = None
    fit_percent: float | None = None

    @property
    def times_floor(self) -> float | None:
        """How many times the upper end of the floor; None where no floor is known."""
        return self.rmse / self.floor[1] if self.floor and self.floor[1] > 0.0 else None

    @classmethod
    def of(cls, data: Any) -> Error | None:
        if not isinstance(data, dict) or _number(data.get("rmse")) is None:
            return None
        return cls(float(data["rmse"]), data.get("unit") or "", data.get("signal") or "", _pair(data.get("noise_floor")),
                   _number(data.get("fit_percent")))


@dataclass(frozen=True)
class ErrorSet:
    """The four errors of one record or of one side (training, held out)."""

    by_kind: dict[str, Error] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.by_kind)

    @classmethod
    def of(cls, data: Any) -> ErrorSet:
        errors = {kind: Error.of((data or {}).get(kind)) for kind in ERROR_KINDS} if isinstance(data, dict) else {}
        return cls({kind: error for kind, error in errors.items() if error})


@dataclass(frozen=True)
class Parameter:
    name: str
    value: float | None
    lo: float | None
    hi: float | None
    unit: str
    state: str = "free"
    effect: str = ""

    @property
    def text(self) -> str:
        if self.state == "given" and self.value is not None:
            return units.number(self.value, self.unit)
        return units.estimate(self.value, self.lo, self.hi, self.unit)

    @classmethod
    def of(cls, name: str, data: Any, effect: str = "") -> Parameter:
        if not isinstance(data, dict):
            data = {"value": data}
        lo, hi = _pair(data.get("interval")) or (None, None)
        return cls(name, _number(data.get("value")), lo, hi, data.get("unit") or units.split_name(name)[1],
                   data.get("state") or "free", effect)


def parameters_of(data: Any, effect: str = "") -> list[Parameter]:
    if isinstance(data, list):
        return [Parameter.of(p.get("name", ""), p, effect) for p in data if isinstance(p, dict)]
    return [Parameter.of(name, p, effect) for name, p in data.items()] if isinstance(data, dict) else []


@dataclass(frozen=True)
class Model:
    structure: str = ""
    parameters: list[Parameter] = field(default_factory=list)
    effects: list[str] = field(default_factory=list)
    formulas: dict[str, str] = field(default_factory=dict)

    @property
    def title(self) -> str:
        return " + ".join([self.structure.replace("_", " ")] + [effect_title(e) for e in self.effects])

    @classmethod
    def of(cls, data: Any) -> Model:
        """From a model object, or from the text of a model file."""
        if isinstance(data, str):
            try:
                data = tomllib.loads(data)
            except tomllib.TOMLDecodeError:
                return cls(structure=data)
        if not isinstance(data, dict):
            return cls()
        raw = data.get("effects") or data.get("effect") or []
        effects = [e if isinstance(e, dict) else {"name": e} for e in raw]
        parameters = parameters_of(data.get("parameters"))
        for effect in effects:
            parameters += parameters_of(effect.get("parameters"), effect.get("name", ""))
        formulas = {e.get("name", ""): e["formula"] for e in effects if e.get("formula")}
        return cls(data.get("structure") or "", parameters, [e.get("name", "") for e in effects], formulas)


@dataclass(frozen=True)
class Record:
    name: str
    rows: int = 0
    span_s: float | None = None
    hash: str = ""
    role: str = ""
    columns: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, data: dict) -> Record:
        role = data.get("role") or ("held out" if data.get("held_out") else "")
        return cls(str(data.get("name", "")), int(data.get("rows") or 0), _number(data.get("span_s")), str(data.get("hash") or ""),
                   role.replace("_", " "), list(data.get("columns") or []))


@dataclass(frozen=True)
class Test:
    name: str
    statistic: float | None
    bound: float | None
    passed: bool


@dataclass(frozen=True)
class Regime:
    """A part of the record (a speed range, a direction, ...) and how much of the removable error it holds."""

    axis: str
    label: str
    share: float
    of_time: float | None = None
    significant: bool = True
    lo: float | None = None
    hi: float | None = None


@dataclass(frozen=True)
class Candidate:
    effect: str
    accepted: bool
    share: float | None
    confidence: float | None
    parameters: list[Parameter]
    ties: list[str]
    why: str = ""
    equation: str = ""

    @property
    def title(self) -> str:
        return effect_title(self.effect)

    @classmethod
    def of(cls, data: dict) -> Candidate:
        ties = [t if isinstance(t, str) else t.get("effect", "") for t in data.get("not_told_apart_from") or []]
        return cls(data.get("effect", ""), bool(data.get("accepted", True)), _number(data.get("share")), _number(data.get("confidence")),
                   parameters_of(data.get("parameters"), data.get("effect", "")), ties, data.get("why_not") or "", data.get("equation") or "")


@dataclass(frozen=True)
class NextRecord:
    motion: str
    why: str = ""
    separates: list[str] = field(default_factory=list)
    table: list[dict] = field(default_factory=list)

    @classmethod
    def of(cls, data: Any) -> NextRecord | None:
        if not isinstance(data, dict) or not data.get("motion"):
            return None
        motion, table = data["motion"], data.get("set_points") or []
        return cls(str(motion), str(data.get("why") or ""), [str(s) for s in data.get("separates") or []],
                   [row for row in table if isinstance(row, dict)])


@dataclass(frozen=True)
class Shape:
    """The residual of an unknown effect over the coordinates in which it is regular."""

    coordinates: list[str]
    table: list[tuple[list[float], float]]
    unit: str = ""

    @classmethod
    def of(cls, data: Any) -> Shape | None:
        if not isinstance(data, dict) or not data.get("table"):
            return None
        names = data.get("coordinates") or data.get("coordinate") or []
        names = [names] if isinstance(names, str) else [str(n) for n in names]
        rows = []
        for row in data["table"]:
            values = row if isinstance(row, list) else [v for v in row.values()] if isinstance(row, dict) else []
            values = [_number(v) for v in values]
            if len(values) > len(names) and all(v is not None for v in values[: len(names) + 1]):
                rows.append((values[: len(names)], values[len(names)]))
        return cls(names, rows, data.get("unit") or "") if names and rows else None


@dataclass(frozen=True)
class Answer:
    """The verdict in words: what was found, what cannot be told, and what to do next."""

    verdict: str
    headline: str
    sentence: str
    advice: str
    accepted: list[Candidate] = field(default_factory=list)
    rejected: list[Candidate] = field(default_factory=list)
    next_record: NextRecord | None = None
    shape: Shape | None = None


@dataclass(frozen=True)
class Step:
    """One step of the staircase; the first is the model as it came."""

    effect: str
    training: ErrorSet
    held_out: ErrorSet
    parameters: list[Parameter] = field(default_factory=list)
    share_left: float | None = None
    label: str = ""

    @property
    def title(self) -> str:
        return self.label or effect_title(self.effect) if self.effect else "first model"


@dataclass(frozen=True)
class Revealed:
    """The smallest size of an effect that these records would reveal, or why none would."""

    effect: str
    found: bool
    smallest: list[Parameter]
    times_floor: float | None
    why: str = ""

    @property
    def title(self) -> str:
        return effect_title(self.effect)


@dataclass(frozen=True)
class Document:
    """Everything that one answer of driveid says, made ready to be shown."""

    kind: str
    version: str
    model: Model
    records: list[Record]
    errors: list[tuple[str, ErrorSet]]
    tests: list[tuple[str, list[Test]]]
    regimes: list[Regime]
    answer: Answer | None
    steps: list[Step]
    ends: str
    parameters: list[Parameter]
    notices: list[str]
    power: list[Revealed]
    raw: dict


def kind_of(data: dict) -> str:
    if "steps" in data:
        return "improve"
    if "ranked" in data:
        return "explain"
    if isinstance(data.get("effects"), list):
        return "power"
    if "free_run_rmse" in data or any("tests" in r or "free_run" in r for r in data.get("records") or [] if isinstance(r, dict)):
        return "compare"
    return "fit"


def _sides(data: Any) -> tuple[ErrorSet, ErrorSet]:
    data = data if isinstance(data, dict) else {}
    return ErrorSet.of(data.get("training")), ErrorSet.of(data.get("held_out"))


def _errors(data: dict) -> list[tuple[str, ErrorSet]]:
    out = [(str(r.get("name", "")), ErrorSet.of(r.get("errors") or r)) for r in data.get("records") or [] if isinstance(r, dict)]
    for key, when in (("error_before", "before"), ("error_after", "after")):
        training, held_out = _sides(data.get(key))
        out += [(f"training, {when}", training), (f"held out, {when}", held_out)]
    return [(name, errors) for name, errors in out if errors]


def _tests(data: dict) -> list[tuple[str, list[Test]]]:
    out = []
    for record in data.get("records") or []:
        tests = [Test(str(t.get("name", "")), _number(t.get("statistic")), _number(t.get("bound")), bool(t.get("passed")))
                 for t in (record.get("tests") or [] if isinstance(record, dict) else [])]
        if tests:
            out.append((str(record.get("name", "")), tests))
    return out


_RANGE = re.compile(r"^.* from [-+.\de]+ to [-+.\de]+ (\S+)$")


def _regime_text(text: str, lo: float | None, hi: float | None) -> str:
    """``speed from 0.0125 to 2.415 rad/s`` -> ``12.5 … 2415 mrad/s`` said with one prefix, or ``up to 2.42 rad/s``: the axis has the name already."""
    text = text.replace("^2", "²")
    match = _RANGE.match(text)
    if not match or lo is None or hi is None or hi <= 0.0:
        return text
    divisor, unit = units.scale_of(hi, match[1])
    if 0.0 <= lo < 1e-3 * hi:
        return f"up to {hi / divisor:.3g} {unit}"
    return f"{units.number(lo / divisor, '', 3)} … {units.number(hi / divisor, '', 3)} {unit}"


def regimes_of(where: Any) -> list[Regime]:
    """Regimes, those that chance does not explain first, by falling share of the error."""
    out = []
    for item in where if isinstance(where, list) else []:
        if not isinstance(item, dict) or _number(item.get("share")) is None:
            continue
        lo, hi = _pair(item.get("range")) or (None, None)
        out.append(Regime(str(item.get("axis") or ""), _regime_text(str(item.get("regime") or ""), lo, hi), float(item["share"]), _number(item.get("rows")), bool(item.get("significant", True)), lo, hi))
    return sorted(out, key=lambda r: (not r.significant, -r.share))


def _list(names: list[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1] if names else ""


def _words(verdict: str, accepted: list[Candidate], data: dict) -> tuple[str, str]:
    """Sentence and advice for a verdict."""
    reason = str(data.get("message") or data.get("reason") or "")
    if verdict == "missing" and accepted:
        shares = [f"{c.title} ({units.percent(c.share)} of what can be removed)" for c in accepted]
        return f"The model lacks {_list(shares)}.", f"Add {accepted[0].title} and look whether the held-out error falls."
    if verdict == "cannot_tell" and accepted:
        first = accepted[0]
        other = _list([effect_title(t) for t in first.ties]) or "another effect"
        return f"{first.title.capitalize()} explains it, and so does {other}.", "Record the motion below: it tells them apart."
    if verdict == "nothing_missing":
        return "What the model leaves is noise: no effect would lower the held-out error.", "The model is ready. Export it, or try a record with other motions."
    if verdict == "unknown":
        return ("The largest remaining part is regular, and it matches no effect of the catalogue.",
                "Its shape stands below. If you know the cause, write it as an own effect (a formula) and fit again.")
    if verdict == "bad_data":
        return reason or "The record is at fault, not the model.", "The notices say what to mend or what to record."
    return reason, ""


def _walk(data: dict) -> tuple[str, str, str]:
    """Headline, sentence and advice of an improvement: what was added, and why it ended."""
    added = [effect_title(s["effect"]) for s in data["steps"] if isinstance(s, dict) and s.get("effect")]
    headline = f"{len(added)} effects were missing and were added" if len(added) > 1 else f"One effect was missing and was added: {added[0]}" if added else "Nothing was added"
    sentence = f"The walk ended: {ENDS.get(data.get('ends') or '', data.get('ends') or 'no reason is given')}."
    if len(added) > 1:
        sentence = f"Added in this order: {_list(added)}. {sentence}"
    advice = {"tie": "Record the motion below: it tells the explanations apart.", "unknown": "If you know the cause, write it as an own effect (a formula) and fit again."}.get(
        data.get("ends") or "", "The model is ready. Try it on a record with other motions.")
    return headline, sentence, advice


def _answer(data: dict) -> Answer | None:
    verdict = data.get("verdict")
    if not verdict:
        return None
    candidates = [Candidate.of(c) for c in data.get("ranked") or [] if isinstance(c, dict)]
    accepted = [c for c in candidates if c.accepted]
    if verdict == "cannot_tell" and not accepted:
        accepted = candidates[:1]
    sentence, advice = _words(verdict, accepted, data)
    rest = [c for c in candidates if c not in accepted]
    headline = VERDICTS.get(verdict, verdict)
    if "steps" in data and verdict != "bad_data":
        headline, sentence, advice = _walk(data)
    elif verdict == "missing" and len(accepted) > 1:
        headline = f"{len(accepted)} effects are missing"
    return Answer(verdict, headline, sentence, advice, accepted, rest, NextRecord.of(data.get("next_record")), Shape.of(data.get("shape")))


def _steps(data: dict) -> list[Step]:
    out = []
    for item in data.get("steps") or []:
        training, held_out = ErrorSet.of(item.get("training")), ErrorSet.of(item.get("held_out"))
        out.append(Step(item.get("effect") or "", training, held_out, parameters_of(item.get("parameters"), item.get("effect") or ""),
                        _number(item.get("share_left"))))
    return out


def _notices(data: dict) -> list[str]:
    texts = [n if isinstance(n, str) else ": ".join(str(n[k]) for k in ("record", "text") if n.get(k)) for n in data.get("notices") or []]
    return list(dict.fromkeys(texts))


def _power(data: dict) -> list[Revealed]:
    return [Revealed(str(e.get("effect", "")), bool(e.get("found")), parameters_of(e.get("smallest")), _number(e.get("times_floor")), str(e.get("why") or ""))
            for e in data.get("effects") or [] if isinstance(e, dict)]


def document(data: dict) -> Document:
    """View data of one JSON document."""
    model = Model.of(data.get("model_toml") or data.get("final_model") or data.get("model"))
    parameters = parameters_of(data.get("parameters")) or model.parameters
    where = data.get("where") or next((r.get("where") for r in reversed(data.get("records") or []) if isinstance(r, dict) and r.get("where")), None)
    return Document(
        kind=kind_of(data), version=str(data.get("driveid", "")), model=model,
        records=[Record.of(r) for r in data.get("records") or [] if isinstance(r, dict)],
        errors=_errors(data), tests=_tests(data), regimes=regimes_of(where), answer=_answer(data), steps=_steps(data),
        ends=str(data.get("ends") or ""), parameters=parameters, notices=_notices(data), power=_power(data), raw=data)

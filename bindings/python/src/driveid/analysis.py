# SPDX-License-Identifier: Apache-2.0
"""Fit, compare, explain, improve, power: the C library's answers as light objects over its JSON documents."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from . import _core
from .errors import DataError, DriveidError, FileError, UsageError
from .model import Effect, Model, Parameter
from .records import Record

Progress = Callable[[float, str], None]
_NOT_YET, _ERR_ARGUMENT, _ERR_CONFIG, _ERR_FORMAT = 1, -1, -2, -8


@dataclass(frozen=True)
class Answer:
    """One JSON document (docs/manual/json.md), whole in `document`."""

    document: dict = field(repr=False)
    series: tuple[Series, ...] = field(default=(), repr=False)

    @property
    def notices(self) -> list[str]:
        return [n if isinstance(n, str) else n.get("text", "") for n in self.document.get("notices", [])]

    def to_json(self) -> str:
        return json.dumps(self.document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def _repr_html_(self) -> str:
        from .views import notebook
        return notebook.html(self.document, self.series)

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict[str, str]:
        from .views import notebook
        return notebook.bundle(self.document, self.series)


class _WithModel(Answer):
    @property
    def model(self) -> Model:
        return Model(self.document["model_toml"])

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Of the structure, then of the effects (an effect's parameter as 'effect.name' where names clash)."""
        model = self.model
        out = dict(model.parameters)
        for effect in model.effects:
            for name, parameter in effect.parameters.items():
                out[name if name not in out else f"{effect.name}.{name}"] = parameter
        return out


class Fit(_WithModel):
    pass


class Improvement(_WithModel):
    @property
    def steps(self) -> list[dict]:
        return self.document.get("steps", [])

    @property
    def ends(self) -> str:
        return self.document.get("ends", "")


class Comparison(Answer):
    @property
    def free_run_rmse(self) -> float | None:
        return self.document.get("free_run_rmse")


@dataclass(frozen=True)
class Candidate:
    effect: str
    accepted: bool
    share: float | None
    confidence: float | None
    parameters: dict[str, Parameter]
    not_told_apart_from: list[str]


class Explanation(Answer):
    @property
    def verdict(self) -> str:
        return self.document["verdict"]

    @property
    def ranked(self) -> list[Candidate]:
        out = []
        for c in self.document.get("ranked", []):
            parameters = {n: Parameter.of({"name": n, **p}) for n, p in (c.get("parameters") or {}).items()}
            out.append(Candidate(c["effect"], bool(c.get("accepted")), c.get("share"), c.get("confidence"), parameters, list(c.get("not_told_apart_from") or [])))
        return out


class Power(Answer):
    pass


@dataclass(frozen=True)
class Series:
    """Signals, predictions and residuals of one record, one row of `data` a series."""

    record: str
    t_s: np.ndarray
    header: dict
    data: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        for k, entry in enumerate(self.header["series"]):
            if entry["name"] == name:
                return self.data[k]
        raise KeyError(f"no series {name!r}; there are {[s['name'] for s in self.header['series']]}")


def _list(records: Record | Iterable[Record]) -> list[Record]:
    return [records] if isinstance(records, Record) else list(records)


def _ask(call, model: Model, training: Sequence[Record], held_out: Sequence[Record], progress: Progress | None, options: dict) -> dict:
    if not training:
        raise UsageError("no record was given")
    text = json.dumps(options) if options else None
    status, answer, message = call(model.toml, [r.to_core() for r in training], [r.to_core() for r in held_out], text, progress)
    document = json.loads(answer) if answer else None
    if document is not None:
        _add_notices(document, [*training, *held_out])
    if status == 0 and document is not None:
        return document
    message = message or _core.status_text(status)
    if status in (_ERR_ARGUMENT, _ERR_CONFIG):
        raise UsageError(message)
    if status == _ERR_FORMAT:
        raise FileError(model.name, message)
    if status >= _NOT_YET and document is None:
        raise DriveidError(message)
    raise DataError(message, document or bad_data(message, model, [*training, *held_out]))


def _add_notices(document: dict, records: Iterable[Record]) -> None:
    told = [{"kind": "reader", "record": r.name, "text": text} for r in records for text in r.notices]
    if told:
        document["notices"] = told + list(document.get("notices") or [])


def bad_data(message: str, model: Model | None = None, records: Iterable[Record] = ()) -> dict:
    """The document of a refusal that the library itself could not write."""
    shown = [{"name": r.name, "rows": r.rows, "span_s": float(r.t_s[-1]) if r.rows else 0.0, "hash": r.hash} for r in records]
    document = {"format": _core.format, "driveid": _core.version, "model": model.toml if model else None, "records": shown,
                "verdict": "bad_data", "message": message, "ranked": []}
    _add_notices(document, records)
    return document


def fit(model: Model, records: Record | Iterable[Record], *, held_out: Record | Iterable[Record] = (), progress: Progress | None = None, **options) -> Fit:
    """Parameters with 95 % intervals. The fitted model is `.model`; one parameter `.parameters["J_kgm2"].value`."""
    return Fit(_ask(_core.fit, model, _list(records), _list(held_out), progress, options))


def compare(model: Model, records: Record | Iterable[Record], *, held_out: Record | Iterable[Record] = (), progress: Progress | None = None, **options) -> Comparison:
    """Errors of a fitted model on records, next to the noise floor, with residual tests."""
    return Comparison(_ask(_core.compare, model, _list(records), _list(held_out), progress, options))


def explain(model: Model, records: Record | Iterable[Record], *, held_out: Record | Iterable[Record] = (), progress: Progress | None = None, **options) -> Explanation:
    """Which effect the model lacks: verdict and ranked candidates."""
    return Explanation(_ask(_core.explain, model, _list(records), _list(held_out), progress, options))


def improve(model: Model, records: Record | Iterable[Record], *, held_out: Record | Iterable[Record] = (), progress: Progress | None = None, **options) -> Improvement:
    """The whole loop: explain, add, fit, compare, until nothing removable is left."""
    return Improvement(_ask(_core.improve, model, _list(records), _list(held_out), progress, options))


def power(model: Model, records: Record | Iterable[Record], *, held_out: Record | Iterable[Record] = (), progress: Progress | None = None, **options) -> Power:
    """The smallest size of each effect that these records would reveal."""
    return Power(_ask(_core.power, model, _list(records), _list(held_out), progress, options))


def series(model: Model, record: Record) -> Series:
    """Curves for plots: signals, predictions, residuals."""
    status, header, data, message = _core.series(model.toml, record.to_core())
    if status != 0 or header is None or data is None:
        raise DataError(message or _core.status_text(status))
    t_s = record.t_s if data.shape[1] == record.rows else np.arange(data.shape[1], dtype=float)
    return Series(record.name, t_s, json.loads(header), data)


def catalogue() -> list[dict]:
    """The effects that explain() knows."""
    status, text = _core.catalogue()
    if status != 0 or text is None:
        raise DriveidError(f"no catalogue: {_core.status_text(status)}")
    document = json.loads(text)
    return document["effects"] if isinstance(document, dict) else document


__all__ = ["Answer", "Candidate", "Comparison", "Effect", "Explanation", "Fit", "Improvement", "Power", "Series", "bad_data", "catalogue",
           "compare", "explain", "fit", "improve", "power", "series"]

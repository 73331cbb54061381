# SPDX-License-Identifier: Apache-2.0
"""The daemon's own on-line estimator, run over a record: the same functions on the same samples, so the same bits."""

from __future__ import annotations

import json
import math
import os
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import _core, shifting
from .errors import FileError, UsageError, close_names
from .model import Model
from .records import Record
from .records.drec import ESTIMATE, DrecFile, of_kind, parse
from .records.gateway import drives, samples

_OPTIONS = ("bandwidth_rad_s", "forgetting_s", "gap_s", "alarm")


@dataclass(frozen=True)
class Replay:
    """Estimates over time. Row k of value, lo, hi, valid belongs to t_ns[k]; a value is NaN until it was trusted once, then held."""

    parameters: list[str]
    t_ns: np.ndarray
    value: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    valid: np.ndarray
    status: np.ndarray          # of every sample, driveid_status
    restarts: np.ndarray
    residual_rms: np.ndarray
    missing: str = ""

    def final(self) -> dict[str, tuple[float, float, float, bool]]:
        """name -> (value, lo, hi, valid) at the end."""
        if len(self.t_ns) == 0:
            return {}
        return {n: (float(self.value[-1, k]), float(self.lo[-1, k]), float(self.hi[-1, k]), bool(self.valid[-1, k])) for k, n in enumerate(self.parameters)}


@dataclass(frozen=True)
class Check:
    """Replayed estimates against those that the daemon wrote into the record."""

    compared: int
    identical: int
    worst: float = 0.0          # greatest relative difference
    names: list[str] = field(default_factory=list)
    from_start: bool = True     # False: the gateway had learnt, or restored, something before this record began, which is not in it
    damage: str = ""            # what of the record could not be read, in words


def replay(model: Model, record: Record, *, method: str = "fsm", type: str = "f64", dt_s: float | None = None, every: int = 1,
           ranges: dict[str, float] | None = None, **options: float) -> Replay:
    """Feed a record to an on-line estimator. `every`: an estimate is asked for at each `every`-th sample. `ranges`: of each signal, for type q31;
    without them the record's own largest magnitudes, doubled."""
    return _held(record, *_run(model, record, method, type, dt_s, every, options, ranges=ranges))


def frequency(record: Record, signal: str, *, highest_Hz: float, sinusoids: int = 1, type: str = "f64", dt_s: float | None = None, every: int = 1,
              ranges: dict[str, float] | None = None, **options: float) -> Replay:
    """One or two sinusoids in one signal, as the daemon's method "frequency" follows them: f1_Hz, amplitude1_..., f2_Hz, amplitude2_... over time."""
    if signal not in record.columns:
        raise UsageError(f"{record.name} has no column {signal!r}; it has {', '.join(record.columns)}")
    one = Record(record.name, record.t_ns, {signal: record.columns[signal]}, path=record.path)
    return _held(record, *_run(None, one, "frequency", type, dt_s, every, options, ranges=ranges, sinusoids=_sinusoids(sinusoids, highest_Hz)))


def _sinusoids(count: int, highest_Hz: float) -> dict:
    if count not in (1, 2):
        raise UsageError(f"sinusoids is 1 or 2, not {count}")
    if not highest_Hz > 0:
        raise UsageError(f"highest_Hz is {highest_Hz}; give the highest frequency that is expected")
    return {"sinusoids": count, "highest_rad_s": 2 * math.pi * highest_Hz}


def _run(model: Model | None, record: Record, method: str, type: str, dt_s: float | None, every: int, options: dict,
         holds: list[tuple[str, str]] | None = None, ranges: dict[str, float] | None = None, sinusoids: dict | None = None) -> tuple[_core.Online, dict]:
    for name in options:
        if name not in _OPTIONS:
            raise UsageError(f"no option {name!r}. {close_names(name, ('method', 'type', 'dt_s', 'every', *_OPTIONS))}")
    if record.rows < 2:
        raise UsageError(f"{record.name}: {record.rows} rows are too few to replay")
    columns = {n: np.ascontiguousarray(v, dtype=np.float64) for n, v in record.columns.items() if n in _core.SIGNALS}
    if dt_s is None:
        dt_s = float(np.median(np.diff(record.t_ns))) * 1e-9
    if type == "q31" and not ranges:
        ranges = _ranges(columns)
    try:
        online = _core.Online(model.toml if model else "", list(columns), method=method, type=type, dt_s=dt_s, holds=holds or [], ranges=list((ranges or {}).items()), **options, **(sinusoids or {}))
    except ValueError as e:
        raise UsageError(str(e)) from None
    parts = []
    for rows in np.split(np.arange(record.rows), np.flatnonzero(np.diff(record.t_ns) < 0) + 1):
        if parts:
            online.restart()  # a new time line, as the daemon sees it
        part = online.run(np.ascontiguousarray(record.t_ns[rows]), [(n, np.ascontiguousarray(v[rows])) for n, v in columns.items()], every)
        part["row"] = part["row"] + rows[0]
        parts.append(part)
    return online, {key: np.concatenate([p[key] for p in parts]) for key in parts[0]}


def _ranges(columns: dict[str, np.ndarray]) -> dict[str, float]:
    return {name: 2 * float(np.nanmax(np.abs(values))) or 1.0 for name, values in columns.items() if np.isfinite(values).any()}


def _held(record: Record, online: _core.Online, raw: dict, keep: np.ndarray | None = None) -> Replay:
    """keep: rows at which somebody looked; a value that was trusted only between two looks was never seen."""
    if keep is not None:
        raw = {key: values if key == "status" else values[keep] for key, values in raw.items()}
    valid = raw["valid"].astype(bool)
    held = [_hold(raw[k], valid) for k in ("value", "lo", "hi")]
    return Replay(online.parameters, record.t_ns[raw["row"]], *held, valid, raw["status"], raw["restarts"], raw["residual_rms"], online.missing)


def _hold(values: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Each column's last trusted value, NaN before the first."""
    at = np.where(valid, np.arange(len(values))[:, None], -1)
    at = np.maximum.accumulate(at, axis=0)
    return np.where(at >= 0, np.take_along_axis(values, np.maximum(at, 0), axis=0), np.nan)


def replay_drec(path: str | os.PathLike, *, drive: str | None = None, model: Model | None = None, **changes) -> tuple[Replay, Check]:
    """Replay the decoded samples of a gateway record with the settings of its configuration (`changes` override them).

    Estimates are given at the instants at which the daemon gave its own; at every sample where the record holds none."""
    path = Path(path)
    try:
        file = parse(path, path.read_bytes())
    except OSError as e:
        raise FileError(path, f"cannot be read ({e.strerror})") from None
    index, settings = _drive(path, file, drive)
    t_ns, columns = samples(file, index)
    if len(t_ns) == 0:
        raise FileError(path, "holds no decoded sample of this drive", mend="Record with record_samples = true, or read the frames with --dbc")
    record = Record(path.name, t_ns, columns, path=str(path))
    options = {k: settings[k] for k in ("method", "type", "dt_s", *_OPTIONS) if k in settings} | changes
    if settings.get("motion_rad_s") and "bandwidth_rad_s" not in changes:
        options["bandwidth_rad_s"] = shifting.suggest(order=2, dt_s=float(settings["dt_s"]), bandwidth_rad_s=float(settings["motion_rad_s"])).poles_rad_s[0]
    alone = options.get("method") == "frequency"
    online, raw = _run(None if alone else model or _model(path, settings, _recorded_model(file, index)), record, options.pop("method", "fsm"), options.pop("type", "f64"), options.pop("dt_s", None), 1, options,
                       [(signal["name"], signal["hold"]) for signal in settings.get("signal", []) if signal.get("hold")],
                       {signal["name"]: float(signal["range"]) for signal in settings.get("signal", []) if signal.get("range")},
                       _sinusoids(settings.get("sinusoids") or 1, float(settings.get("highest_Hz", 0))) if alone else None)
    told = [e.t_ns for e in of_kind(file.entries, ESTIMATE) if e.source == index]
    keep = np.flatnonzero(np.isin(t_ns, told)) if told else None
    result = _held(record, online, raw, keep)
    return result, _check(result, file, index)


def _drive(path: Path, file: DrecFile, drive: str | None) -> tuple[int, dict]:
    names = drives(file)
    tables = tomllib.loads(file.header.get("config", "")).get("drive", []) if names else []
    if not names:
        return 0, {}
    if drive is None and len(names) > 1:
        raise UsageError(f"{path}: holds {len(names)} drives, say which: --drive {names[0]} (there are: {', '.join(names)})")
    if drive is not None and drive not in names:
        raise UsageError(f"{path}: no drive {drive!r}. {close_names(drive, names)}")
    index = names.index(drive) if drive else 0
    return index, tables[index]


def _recorded_model(file: DrecFile, index: int) -> str:
    models = file.header.get("models", [])
    return models[index] if index < len(models) else ""


def _model(path: Path, settings: dict, recorded: str) -> Model:
    if recorded:
        model = Model(recorded, settings.get("model", "model"))
        for effect in settings.get("effects", []):
            model = model.add(effect)
        return model
    if "structure" in settings:
        model = Model.new(settings["structure"], {k: float(v) for k, v in settings.get("given", {}).items()})
        for effect in settings.get("effects", []):
            model = model.add(effect)
        return model
    name = settings.get("model", "")
    for place in (path.parent / name, Path(name)):
        if name and place.is_file():
            return Model.load(place)
    raise UsageError(f"{path}: the model file {name or '(none)'} of the drive is not here; give it: --model MODEL.toml")


def _check(result: Replay, file: DrecFile, index: int) -> Check:
    at = {int(t): k for k, t in enumerate(result.t_ns)}
    compared = identical = 0
    worst = 0.0
    for entry in of_kind(file.entries, ESTIMATE):
        if entry.source != index or entry.t_ns not in at:
            continue
        row = at[entry.t_ns]
        for p in json.loads(entry.payload).get("parameters", []):
            if p["name"] not in result.parameters or p["value"] is None:
                continue
            k = result.parameters.index(p["name"])
            pairs = ((p["value"], result.value[row, k]), (p["interval"][0], result.lo[row, k]), (p["interval"][1], result.hi[row, k]))
            compared += 1
            if all(a == b for a, b in pairs):
                identical += 1
                continue
            worst = max([worst, *(abs(a - b) / max(abs(a), abs(b), 1e-300) for a, b in pairs if not np.isnan(b))])
            if any(np.isnan(b) for _, b in pairs):
                worst = float("inf")
    return Check(compared, identical, worst, result.parameters, bool(file.header.get("from_start", True)), file.damage)

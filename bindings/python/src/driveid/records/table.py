# SPDX-License-Identifier: Apache-2.0
"""From raw columns of any file to one record: time in int64 ns, signals in SI, and what was noticed on the way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .. import _core, units
from ..errors import FileError, UsageError, close_names
from .mapping import Source

HOLDS = ("average", "zoh", "instant")
_RUN_NAMES = ("run", "run_id", "trial", "segment", "episode")
_TIME_NAMES = ("t", "time", "timestamp", "time_s")
# A static curve has no time: each of its rows stands for this many samples at rest, and a silence to the next.
_STEADY_ROWS, _STEADY_DT_NS, _STEADY_GAP_NS = 200, 20_000_000, 10_000_000_000


@dataclass
class RawColumn:
    """A column as the file has it. `load` gives float64 (NaN: missing), `load_ns` exact int64 ns where the column is a time."""

    name: str
    unit: str | None
    load: Callable[[], np.ndarray]
    load_ns: Callable[[float], np.ndarray] | None = None


@dataclass
class RawTable:
    path: str
    hash: str
    columns: list[RawColumn]
    rows: int
    t_ns: np.ndarray | None = None  # CAN logs and gateway records bring their own stamps
    notices: list[str] = field(default_factory=list)

    def names(self) -> list[str]:
        return [c.name for c in self.columns]

    def find(self, name: str) -> RawColumn | None:
        for c in self.columns:
            if c.name == name:
                return c
        for c in self.columns:
            if c.unit and name in (f"{c.name} [{c.unit}]", f"{c.name} ({c.unit})", f"{c.name}[{c.unit}]"):
                return c
        return None


@dataclass
class Record:
    """One recording: int64 ns stamps and signals in SI, named by symbol and unit."""

    name: str
    t_ns: np.ndarray
    columns: dict[str, np.ndarray]
    hash: str | None = None
    hold: str | None = None
    path: str | None = None
    notices: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, name: str, *, t_s=None, t_ns=None, hold: str | None = None, **columns) -> Record:
        """From arrays: Record.of("run", t_s=t, i_A=i, theta_rad=theta). Anything that numpy takes, a pandas column too."""
        if (t_s is None) == (t_ns is None):
            raise UsageError("a record has one time: give t_s or t_ns")
        stamps = np.asarray(t_ns, dtype=np.int64) if t_ns is not None else to_ns(np.asarray(t_s, dtype=np.float64), 1.0)
        values = {}
        for column, data in columns.items():
            if column not in _core.SIGNALS:
                raise UsageError(f"{column!r} is no signal. {close_names(column, _core.SIGNALS)}")
            values[column] = np.ascontiguousarray(data, dtype=np.float64)
            if values[column].shape != stamps.shape or stamps.ndim != 1:
                raise UsageError(f"{column} has shape {values[column].shape}, the time has {stamps.shape}")
        return cls(name, np.ascontiguousarray(stamps), values, hold=hold)

    @property
    def rows(self) -> int:
        return len(self.t_ns)

    @property
    def t_s(self) -> np.ndarray:
        """Seconds since the first sample (for plots; computing is done on t_ns)."""
        return (self.t_ns - self.t_ns[0]) * 1e-9 if self.rows else np.empty(0)

    def __getitem__(self, name: str) -> np.ndarray:
        if name in self.columns:
            return self.columns[name]
        raise KeyError(f"record {self.name} has no {name!r}. {close_names(name, self.columns)}")

    def to_core(self) -> _core.Record:
        """The same memory as the C library sees it."""
        columns = [(n, np.ascontiguousarray(v, dtype=np.float64)) for n, v in self.columns.items() if n in _core.SIGNALS]
        return _core.Record(self.name, np.ascontiguousarray(self.t_ns, dtype=np.int64), columns, self.hash, self.hold)

    def __repr__(self) -> str:
        span = f"{self.t_s[-1]:.3f} s" if self.rows else "empty"
        return f"Record({self.name!r}, {self.rows} rows, {span}, {', '.join(self.columns)})"


def assemble(raw: RawTable, maps: dict[str, Source], hold: str | None, name: str) -> list[Record]:
    """One record, or one a run where the table has a column that numbers runs."""
    if hold is not None and hold not in HOLDS:
        raise UsageError(f"hold {hold!r}: {close_names(hold, HOLDS)}")
    notices = list(raw.notices)
    used: set[str] = set()
    columns = _mapped(raw, maps, used)
    t_ns = _time(raw, maps, used, notices)
    _named(raw, columns, used, notices)
    if t_ns is None:
        return [_steady(raw, columns, used, hold, name, notices)]
    keep = t_ns != np.iinfo(np.int64).min
    if not keep.all():
        notices.append(f"{int((~keep).sum())} rows without a time were dropped")
        t_ns, columns = t_ns[keep], {n: v[keep] for n, v in columns.items()}
    runs = _runs(raw, keep)
    if runs is None:
        return [Record(name, t_ns, columns, raw.hash, hold, raw.path, notices)]
    return [Record(f"{name}[{label}]", t_ns[rows], {n: v[rows] for n, v in columns.items()}, raw.hash, hold, raw.path, list(notices))
            for label, rows in runs]


def _mapped(raw: RawTable, maps: dict[str, Source], used: set[str]) -> dict[str, np.ndarray]:
    out: dict[str, np.ndarray] = {}
    for name, source in maps.items():
        if name in ("t_s", "t_ns"):
            continue
        column, unit, negated = _resolve(raw, source)
        convert = units.conversion(unit or column.unit or "1", name)
        out[name] = (convert.negated() if negated else convert)(column.load())
        used.add(column.name)
    return out


def _resolve(raw: RawTable, source: Source) -> tuple[RawColumn, str | None, bool]:
    names = raw.names() + [f"{c.name} [{c.unit}]" for c in raw.columns if c.unit]
    try:
        column, unit, negated = source.resolve(names)
    except UsageError as e:
        raise UsageError(f"{raw.path}: {e}") from None
    found = raw.find(column)
    assert found is not None
    return found, unit, negated


def _time(raw: RawTable, maps: dict[str, Source], used: set[str], notices: list[str]) -> np.ndarray | None:
    for name in ("t_ns", "t_s"):
        if name in maps:
            column, unit, negated = _resolve(raw, maps[name])
            if negated:
                raise UsageError(f"--map {name}={maps[name].text}: time runs forward; take the minus sign away")
            used.add(column.name)
            return _stamps(column, unit or column.unit or name[2:])
    if raw.t_ns is not None:
        return raw.t_ns
    for name in ("t_ns", "t_s"):
        if column := raw.find(name):
            used.add(column.name)
            return _stamps(column, name[2:])
    for column in raw.columns:
        if column.name.lower() in _TIME_NAMES and (column.unit is None or units.dimension_of(column.unit) == "time"):
            used.add(column.name)
            if column.unit is None:
                notices.append(f"column {column.name!r} is read as time in seconds; --map t_s={column.name}:ms says otherwise")
            return _stamps(column, column.unit or "s")
    return None


def _stamps(column: RawColumn, unit: str) -> np.ndarray:
    factor = units.conversion(unit, "t_s").factor
    if column.load_ns is not None:
        return column.load_ns(factor)
    return to_ns(column.load(), factor)


def to_ns(values: np.ndarray, factor: float) -> np.ndarray:
    """Float times to int64 ns; a time that is missing becomes the smallest int64."""
    ns = np.rint(values * (factor * 1e9))
    good = np.abs(ns) < 9.2e18  # false for NaN too
    if good.all():
        return ns.astype(np.int64)
    out = np.full(len(values), np.iinfo(np.int64).min, dtype=np.int64)
    out[good] = ns[good].astype(np.int64)
    return out


def _named(raw: RawTable, columns: dict[str, np.ndarray], used: set[str], notices: list[str]) -> None:
    """Columns that carry a signal's name, or its symbol and another unit."""
    for column in raw.columns:
        if column.name in used:
            continue
        name = column.name if column.name in _core.SIGNALS else units.signal_of(column.name, column.unit)
        if name is None or name not in _core.SIGNALS or name in columns:
            continue
        convert = units.conversion(column.unit, name) if column.unit and name not in ("u", "y") else units.Conversion()
        if name != column.name:
            notices.append(f"column {column.name!r} in {column.unit} is read as {name}")
        columns[name] = convert(column.load())
        used.add(column.name)


def _steady(raw: RawTable, columns: dict[str, np.ndarray], used: set[str], hold: str | None, name: str, notices: list[str]) -> Record:
    for column in raw.columns:
        if column.name in used:
            continue
        try:
            values = column.load()
        except FileError:
            continue
        if len(values) > 2 and np.all(np.diff(values) > 0):
            raise FileError(raw.path, "has no time column", mend=f"If {column.name!r} is the time, say --map t_s={column.name} "
                            f"(or --map t_s={column.name}:ms)")
    if len(columns) < 2:
        raise FileError(raw.path, "has no time column and no two known signals",
                        mend=f"Name them: --map t_s=COLUMN --map i_A=COLUMN --map theta_rad=COLUMN:deg. {close_names('t_s', raw.names())}")
    notices.append(f"no time column: read as a steady map, {raw.rows} points of equilibrium")
    point = np.repeat(np.arange(raw.rows, dtype=np.int64), _STEADY_ROWS)
    inside = np.tile(np.arange(_STEADY_ROWS, dtype=np.int64), raw.rows)
    t_ns = point * (_STEADY_ROWS * _STEADY_DT_NS + _STEADY_GAP_NS) + inside * _STEADY_DT_NS
    return Record(name, t_ns, {n: np.repeat(v, _STEADY_ROWS) for n, v in columns.items()}, raw.hash, hold, raw.path, notices)


def _runs(raw: RawTable, keep: np.ndarray) -> list[tuple[str, np.ndarray]] | None:
    for column in raw.columns:
        if column.name.lower() not in _RUN_NAMES:
            continue
        values = column.load()[keep]
        if len(values) == 0 or not np.all(np.isfinite(values)) or np.any(values != np.rint(values)):
            continue
        starts = np.flatnonzero(np.diff(values)) + 1
        if 0 < len(starts) < max(2, len(values) // 4) and len(np.unique(values)) == len(starts) + 1:
            parts = np.split(np.arange(len(values)), starts)
            return [(f"{column.name}={int(values[p[0]])}", p) for p in parts]
    return None

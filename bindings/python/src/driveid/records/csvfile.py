# SPDX-License-Identifier: Apache-2.0
"""CSV as it comes: comma, semicolon, tab or blanks; decimal point or comma; units in the header, below it, or nowhere."""

from __future__ import annotations

import csv
import gzip
import re
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..units import dimension_of, split_header
from .table import RawColumn, RawTable, to_ns

_MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "--", "nil"}
_TRUTH = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0}
_INT64_MIN = np.iinfo(np.int64).min


def read_csv(path: Path, blob: bytes, digest: str) -> RawTable:
    text = _decode(path, blob)
    lines = text.splitlines()
    layout = _Layout(path, lines)
    body = [line for line in lines[layout.first_row:]]
    if layout.decimal_comma:
        body = [line.replace(",", ".") for line in body]
    numbers = _fast(body, layout)
    notices: list[str] = []
    if numbers is not None:
        cells, rows = None, len(numbers)
    else:
        cells = _slow(path, body, layout, notices)
        rows = len(cells.rows)
    columns = [_column(path, layout, k, numbers, cells, body) for k in range(len(layout.names))]
    return RawTable(str(path), digest, columns, rows, None, notices)


def _decode(path: Path, blob: bytes) -> str:
    if path.suffix == ".gz":
        try:
            blob = gzip.decompress(blob)
        except (OSError, EOFError) as e:
            raise FileError(path, f"is not a readable gzip file ({e})") from None
    if blob.startswith((b"\xff\xfe", b"\xfe\xff")):
        return blob.decode("utf-16", errors="replace")
    if b"\0" in blob[:4096]:
        raise FileError(path, "is not text", mend="Known kinds: .csv .parquet .log .asc .blf .trc .drec .mf4")
    try:
        return blob.decode("utf-8-sig")
    except UnicodeDecodeError:
        return blob.decode("latin-1")


class _Layout:
    """Delimiter, decimal sign, names, units, and the line on which numbers begin."""

    def __init__(self, path: Path, lines: list[str]):
        comment = None
        at = 0
        while at < len(lines) and (not lines[at].strip() or lines[at].lstrip()[:1] in "#%"):
            if lines[at].strip():
                comment = lines[at].lstrip().lstrip("#% ")
            at += 1
        if at == len(lines):
            raise FileError(path, "is empty", mend="A record has a header line with names and one line per sample")
        self.delimiter = _delimiter(lines[at:at + 5])
        fields = self.split(lines[at])
        if all(_number(f, self.delimiter) for f in fields):
            named = self.split(comment) if comment else []
            if len(named) == len(fields) and not any(_number(f, self.delimiter) for f in named):
                fields, self.first_row = named, at
            else:
                fields, self.first_row = [str(k + 1) for k in range(len(fields))], at  # no header: columns by number
        else:
            self.first_row = at + 1
        while len(fields) > 1 and fields[-1] == "":
            fields.pop()
        split = [split_header(f) for f in fields]
        self.names = _unique([s[0] or f"column {k + 1}" for k, s in enumerate(split)])
        self.units = [s[1] for s in split]
        if self.first_row < len(lines):
            below = self.split(lines[self.first_row])
            told = [f for f in below if f]
            if told and not any(_number(f, self.delimiter) for f in told) and any(dimension_of(f) for f in told):
                self.units = [u or (below[k] if k < len(below) and below[k] else None) for k, u in enumerate(self.units)]
                self.first_row += 1
        sample = lines[self.first_row:self.first_row + 20]
        self.decimal_comma = self.delimiter != "," and any("," in s for s in sample) and not any("." in s for s in sample)

    def split(self, line: str) -> list[str]:
        if self.delimiter is None:
            return line.split()
        return [f.strip() for f in next(csv.reader([line], delimiter=self.delimiter, skipinitialspace=True), [])]


def _delimiter(lines: list[str]) -> str | None:
    """None: blanks. A semicolon or a tab wins over commas, which may be decimal signs."""
    for sign in (";", "\t", ","):
        if all(sign in line for line in lines if line.strip()):
            return sign
    return None if len(lines[0].split()) > 1 and "," not in lines[0] else ","


def _number(text: str, delimiter: str | None) -> bool:
    if delimiter != ",":
        text = text.replace(",", ".")
    try:
        float(text)
        return text.strip().lower() not in _MISSING
    except ValueError:
        return False


def _unique(names: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    out = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        out.append(name if seen[name] == 1 else f"{name}.{seen[name]}")
    return out


def _fast(body: list[str], layout: _Layout) -> np.ndarray | None:
    """All cells are numbers: the usual case."""
    if not any(line.strip() for line in body):
        return np.empty((0, len(layout.names)))
    try:
        numbers = np.loadtxt(body, delimiter=layout.delimiter, dtype=np.float64, ndmin=2, comments=None)
    except ValueError:
        return None
    return numbers if numbers.shape[1] == len(layout.names) else None


class _Cells:
    def __init__(self) -> None:
        self.rows: list[list[str]] = []
        self.lines: list[int] = []


def _slow(path: Path, body: list[str], layout: _Layout, notices: list[str]) -> _Cells:
    cells, width = _Cells(), len(layout.names)
    last = max((k for k, line in enumerate(body) if line.strip()), default=-1)
    for k, line in enumerate(body):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        fields = layout.split(line)
        while len(fields) > width and fields[-1] == "":
            fields.pop()
        if len(fields) < width and k == last:
            notices.append(f"the last line ({layout.first_row + k + 1}) is cut off and was dropped")
            continue
        if len(fields) != width:
            raise FileError(path, f"has {len(fields)} fields where the header has {width}", line=layout.first_row + k + 1,
                            mend="Delete the line or fill it; a missing value is an empty field")
        cells.rows.append(fields)
        cells.lines.append(layout.first_row + k + 1)
    return cells


def _column(path: Path, layout: _Layout, k: int, numbers: np.ndarray | None, cells: _Cells | None, body: list[str]) -> RawColumn:
    name = layout.names[k]

    def texts() -> list[str]:
        if cells is not None:
            return [row[k] for row in cells.rows]
        return [layout.split(line)[k] for line in body if line.strip()]

    def load() -> np.ndarray:
        if numbers is not None:
            return np.ascontiguousarray(numbers[:, k])
        assert cells is not None
        return np.array([_value(path, text, line, name) for text, line in zip(texts(), cells.lines)], dtype=np.float64)

    def load_ns(factor: float) -> np.ndarray:
        if numbers is not None:
            values = numbers[:, k]
            exact = factor <= 1e-9 and np.any(np.abs(values) > 2**53) or np.any(np.abs(values) * factor > 4e6)
            if not exact:
                return to_ns(values, factor)
        lines = cells.lines if cells is not None else range(layout.first_row + 1, layout.first_row + 1 + len(body))
        return np.array([_exact_ns(path, t, factor, line, name) for t, line in zip(texts(), lines)], dtype=np.int64)

    return RawColumn(name, layout.units[k], load, load_ns)


def _value(path: Path, text: str, line: int, column: str) -> float:
    try:
        value = float(text)
        return value if np.isfinite(value) else np.nan
    except ValueError:
        low = text.lower()
        if low in _MISSING:
            return np.nan
        if low in _TRUTH:
            return _TRUTH[low]
        raise FileError(path, f"{text[:40]!r} is not a number", line=line, column=column, mend="Mend the cell, or leave it empty where the value is missing") from None


_DECIMAL = re.compile(r"([+-]?)(\d+)(?:\.(\d*))?$")


def _exact_ns(path: Path, text: str, factor: float, line: int, column: str) -> int:
    """Decimal text to ns without a detour through float64, which holds an epoch only to a quarter of a microsecond."""
    text = text.strip()
    if text.lower() in _MISSING:
        return int(_INT64_MIN)
    match = _DECIMAL.match(text)
    scale = round(factor * 1e9)
    if match and scale >= 1 and abs(scale - factor * 1e9) < 1e-6:
        digits = match.group(3) or ""
        whole = int(match.group(2) + digits) * scale
        ten = 10 ** len(digits)
        ns = (whole + ten // 2) // ten
        ns = -ns if match.group(1) == "-" else ns
    else:
        ns = _date_ns(path, text, factor, line, column)
    if not -(2**63) < ns < 2**63:
        raise FileError(path, f"time {text!r} does not fit into 64 bits of nanoseconds", line=line, column=column)
    return ns


def _date_ns(path: Path, text: str, factor: float, line: int, column: str) -> int:
    try:
        return round(float(text) * factor * 1e9)
    except (ValueError, OverflowError):
        pass
    try:
        return int(np.datetime64(text.replace(" ", "T").rstrip("Z"), "ns").astype(np.int64))
    except ValueError:
        raise FileError(path, f"{text[:40]!r} is no time", line=line, column=column, mend="Times are numbers (t_s, t_ns) or ISO 8601 dates") from None

# SPDX-License-Identifier: Apache-2.0
"""Parquet (and Arrow/Feather files) through pyarrow."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import FileError
from ..units import split_header
from .table import RawColumn, RawTable, to_ns


def read_parquet(path: Path, blob: bytes, digest: str) -> RawTable:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise FileError(path, "needs pyarrow", mend="pip install 'driveid[parquet]'") from None
    try:
        table = pyarrow.parquet.read_table(pyarrow.BufferReader(blob))
    except (pyarrow.ArrowException, OSError) as e:
        raise FileError(path, f"is not a readable Parquet file ({e})") from None
    columns = [_column(path, field.name, field.metadata, table.column(k)) for k, field in enumerate(table.schema)]
    return RawTable(str(path), digest, columns, table.num_rows)


def _column(path: Path, header: str, metadata, data) -> RawColumn:
    import pyarrow

    name, unit = split_header(header)
    if unit is None and metadata and b"unit" in metadata:
        unit = metadata[b"unit"].decode()
    kind = data.type

    def load() -> np.ndarray:
        if not (pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind) or pyarrow.types.is_boolean(kind) or pyarrow.types.is_decimal(kind)):
            raise FileError(path, f"holds {kind}, not numbers", column=header)
        values = data.cast(pyarrow.int8()) if pyarrow.types.is_boolean(kind) else data
        values = values if values.type == pyarrow.float64() else values.cast(pyarrow.float64())
        out = np.asarray(values.to_numpy(), dtype=np.float64)
        return out if np.isfinite(out).all() else np.where(np.isfinite(out), out, np.nan)

    def load_ns(factor: float) -> np.ndarray:
        if pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind):
            target = pyarrow.timestamp("ns", getattr(kind, "tz", None)) if pyarrow.types.is_timestamp(kind) else pyarrow.duration("ns")
            return _ints(data.cast(target).cast(pyarrow.int64()))
        if pyarrow.types.is_integer(kind) and abs(factor * 1e9 - round(factor * 1e9)) < 1e-6:
            out = _ints(data.cast(pyarrow.int64()))
            scale = round(factor * 1e9)
            return np.where(out == np.iinfo(np.int64).min, out, out * scale) if scale != 1 else out
        return to_ns(load(), factor)

    return RawColumn(name, unit, load, load_ns)


def _ints(data) -> np.ndarray:
    return data.fill_null(int(np.iinfo(np.int64).min)).to_numpy(zero_copy_only=False).astype(np.int64)

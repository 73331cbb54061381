# SPDX-License-Identifier: Apache-2.0
"""The one reader of records: CSV, Parquet, CAN logs with a DBC, the gateway's own .drec, MDF4."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..errors import FileError, UsageError, close_names
from .mapping import Source, parse_maps
from .table import HOLDS, RawTable, Record, assemble

CAN_LOGS = {".log", ".asc", ".blf", ".trc"}
TABLES = {".csv", ".txt", ".tsv", ".dat", ".gz"}
KINDS = sorted(CAN_LOGS | TABLES | {".parquet", ".pq", ".drec", ".mf4", ".mdf"})


def read_all(path: str | os.PathLike, map: Mapping[str, str] | Iterable[str] | None = None, *, hold: str | None = None,
             dbc: str | os.PathLike | Iterable[str | os.PathLike] | None = None, drive: str | None = None) -> list[Record]:
    """Every run of a file. A file has one run, unless a column (`run`, `trial`, ...) numbers several."""
    maps = map if isinstance(map, dict) and all(isinstance(v, Source) for v in map.values()) else parse_maps(map)
    path = Path(path)
    raw = _load(path, _paths(dbc), maps, drive)
    return assemble(raw, maps, hold, path.name)


def read(path: str | os.PathLike, map: Mapping[str, str] | Iterable[str] | None = None, **options) -> Record:
    """The one run of a file; where it has several, read_all() gives them."""
    records = read_all(path, map, **options)
    if len(records) != 1:
        raise UsageError(f"{path} holds {len(records)} runs ({records[0].name} ...): use driveid.read_all()")
    return records[0]


def _paths(dbc) -> list[Path]:
    if dbc is None:
        return []
    return [Path(dbc)] if isinstance(dbc, (str, os.PathLike)) else [Path(d) for d in dbc]


def _load(path: Path, dbc: list[Path], maps: dict[str, Source], drive: str | None) -> RawTable:
    try:
        blob = path.read_bytes()
    except FileNotFoundError:
        near = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        raise FileError(path, "no such file", mend=close_names(path.name, sorted(near)) if near else "") from None
    except OSError as e:
        raise FileError(path, f"cannot be read ({e.strerror})") from None
    if not blob:
        raise FileError(path, "is empty", mend="A record has a header line with names and one line per sample")
    digest = hashlib.sha256(blob).hexdigest()
    suffix = path.suffix.lower()
    if blob[:8] == b"DRVIDREC":
        from .gateway import read_drec
        return read_drec(path, blob, digest, dbc, maps, drive)
    if suffix == ".drec":
        raise FileError(path, "does not begin with DRVIDREC", mend="It is no record of the gateway, or its head was overwritten")
    if suffix in (".parquet", ".pq") or blob[:4] == b"PAR1":
        from .parquet import read_parquet
        return read_parquet(path, blob, digest)
    if suffix in CAN_LOGS:
        from .canlog import read_frames
        from .dbc import table_from_frames
        return table_from_frames(path, digest, read_frames(path, blob), dbc, maps)
    if suffix in (".mf4", ".mdf"):
        from .mdf import holds_frames, read_mdf
        if not holds_frames(path):
            return read_mdf(path, digest)
        from .canlog import read_frames
        from .dbc import table_from_frames
        return table_from_frames(path, digest, read_frames(path, blob), dbc, maps)
    if suffix in TABLES or suffix == "":
        from .csvfile import read_csv
        return read_csv(path, blob, digest)
    raise FileError(path, f"unknown kind {suffix!r}", mend=f"Known: {' '.join(KINDS)}")


__all__ = ["HOLDS", "KINDS", "RawTable", "Record", "parse_maps", "read", "read_all"]

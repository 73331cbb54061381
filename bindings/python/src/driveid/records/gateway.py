# SPDX-License-Identifier: Apache-2.0
"""A gateway record as a table: the decoded samples of one drive, or its raw frames through a DBC."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from .._core import SIGNALS
from ..errors import FileError, UsageError, close_names
from .dbc import table_from_frames
from .drec import CAN, SAMPLE, DrecFile, of_kind, parse
from .frames import Frames
from .mapping import Source
from .table import RawColumn, RawTable


def read_drec(path: Path, blob: bytes, digest: str, dbc: list[Path], maps: dict[str, Source], drive: str | None) -> RawTable:
    file = parse(path, blob)
    notices = [file.damage] if file.damage else []
    if dbc:
        frames = frames_of(file)
        if frames.count() == 0:
            raise FileError(path, "holds no CAN frame", mend="Leave --dbc away: the decoded samples are read")
        table = table_from_frames(path, digest, frames, dbc, maps)
        table.notices[:0] = notices
        return table
    index = _drive_index(path, file, drive)
    t_ns, columns = samples(file, index)
    if len(t_ns) == 0:
        frames = frames_of(file).count()
        raise FileError(path, f"holds no decoded sample{f' of drive {drive}' if drive else ''} ({frames} CAN frames)",
                        mend="Give the database of its frames: --dbc FILE.dbc" if frames else "")
    return RawTable(str(path), digest, [RawColumn(n, None, lambda v=v: v) for n, v in columns.items()], len(t_ns), t_ns, notices)


def drives(file: DrecFile) -> list[str]:
    """Names of the drives in the configuration that the record carries."""
    try:
        config = tomllib.loads(file.header.get("config", ""))
    except tomllib.TOMLDecodeError:
        return []
    return [str(d.get("name", k)) for k, d in enumerate(config.get("drive", []))]


def _drive_index(path: Path, file: DrecFile, drive: str | None) -> int:
    there = sorted({e.source for e in of_kind(file.entries, SAMPLE)})
    names = drives(file)
    if drive is not None:
        if drive in names:
            return names.index(drive)
        if drive.isdecimal() and int(drive) in there:
            return int(drive)
        raise UsageError(f"{path}: no drive {drive!r} in the record. {close_names(drive, names or [str(t) for t in there])}")
    if len(there) > 1:
        shown = [names[k] if k < len(names) else str(k) for k in there]
        raise UsageError(f"{path}: holds {len(there)} drives, say which: --drive {shown[0]} (there are: {', '.join(shown)})")
    return there[0] if there else 0


def samples(file: DrecFile, index: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(t_ns, signal -> values): the decoded samples of one drive, NaN where a signal was absent."""
    entries = [e for e in of_kind(file.entries, SAMPLE) if e.source == index and len(e.payload) >= 4]
    t_ns = np.array([e.t_ns for e in entries], dtype=np.int64)
    present = np.array([int.from_bytes(e.payload[:4], "little") for e in entries], dtype=np.uint32)
    table = np.full((len(entries), len(SIGNALS)), np.nan)
    for bits in np.unique(present):
        which = [s for s in range(len(SIGNALS)) if int(bits) >> s & 1]
        rows = np.flatnonzero(present == bits)
        whole = [r for r in rows if len(entries[r].payload) == 4 + 8 * int(bits).bit_count()]
        if not which or not whole:
            continue
        values = np.frombuffer(b"".join(entries[r].payload[4:4 + 8 * len(which)] for r in whole), dtype="<f8").reshape(len(whole), len(which))
        table[np.ix_(whole, which)] = values
    seen = np.bitwise_or.reduce(present) if len(present) else 0
    return t_ns, {SIGNALS[s]: np.ascontiguousarray(table[:, s]) for s in range(len(SIGNALS)) if int(seen) >> s & 1}


def frames_of(file: DrecFile) -> Frames:
    frames = Frames()
    for entry in of_kind(file.entries, CAN):
        if len(entry.payload) >= 8:
            can_id, _, data = entry.can()
            frames.add(can_id, entry.t_ns, data)
    return frames

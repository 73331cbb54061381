# SPDX-License-Identifier: Apache-2.0
"""The gateway's own record (docs/manual/record-format.md): reading what is whole, counting what is not, and writing."""

from __future__ import annotations

import json
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path

from .._core import version
from ..errors import FileError

MAGIC, VERSION = b"DRVIDREC", 1
CAN, MODBUS, SAMPLE, EVENT, MARK, ESTIMATE = range(1, 7)
CLOCK_UNKNOWN, CLOCK_HARDWARE, CLOCK_KERNEL, CLOCK_DAEMON, CLOCK_DEVICE, CLOCK_RECORD = range(6)
_HEAD = struct.Struct("<IBBHqII")  # payload_len, kind, clock, source, t_ns, err_ns, crc32
_ZERO_CRC = b"\0\0\0\0"
PAYLOAD_MAX = 65535


@dataclass(frozen=True)
class Entry:
    kind: int
    clock: int
    source: int
    t_ns: int
    err_ns: int
    payload: bytes

    def can(self) -> tuple[int, int, bytes]:
        """(can_id with Linux flags, FD flags, data)"""
        can_id, flags, length = struct.unpack_from("<IBB", self.payload)
        return can_id, flags, self.payload[8:8 + length]

    def json(self) -> dict:
        return json.loads(self.payload)


@dataclass
class DrecFile:
    header: dict
    entries: list[Entry] = field(default_factory=list)
    skipped: int = 0        # entries with a wrong CRC, or stretches that are no entry
    lost_bytes: int = 0     # bytes of them

    @property
    def damage(self) -> str:
        """What was skipped, in words; "" where all is whole."""
        return f"{self.skipped} damaged stretch{'es' * (self.skipped > 1)} ({self.lost_bytes} bytes) {'were' if self.skipped > 1 else 'was'} skipped" if self.skipped else ""


def parse(path: Path, blob: bytes) -> DrecFile:
    if blob[:8] != MAGIC or len(blob) < 16:
        raise FileError(path, "is no record of the gateway (it must begin with DRVIDREC and a header)")
    version_, length = struct.unpack_from("<II", blob, 8)
    if version_ != VERSION:
        raise FileError(path, f"has format version {version_}, this program reads {VERSION}", mend="Use the driveid that wrote it")
    try:
        header = json.loads(blob[16:16 + length])
        if not isinstance(header, dict) or 16 + length > len(blob):
            raise ValueError("cut off")
    except ValueError as e:
        raise FileError(path, f"has a damaged header ({e})") from None
    out = DrecFile(header)
    at, damaged_from = 16 + length, None
    while at < len(blob):
        entry = _entry_at(blob, at)
        if entry is None:
            damaged_from = at if damaged_from is None else damaged_from
            at = _next_entry(blob, at)
            continue
        if damaged_from is not None:
            out.skipped += 1
            out.lost_bytes += at - damaged_from
            damaged_from = None
        out.entries.append(entry)
        at += _HEAD.size + len(entry.payload)
    if damaged_from is not None:
        out.skipped += 1
        out.lost_bytes += len(blob) - damaged_from
    return out


def _entry_at(blob: bytes, at: int) -> Entry | None:
    if at + _HEAD.size > len(blob):
        return None
    length, kind, clock, source, t_ns, err_ns, crc = _HEAD.unpack_from(blob, at)
    end = at + _HEAD.size + length
    if length > PAYLOAD_MAX or not 1 <= kind <= 6 or end > len(blob):
        return None
    head = blob[at:at + _HEAD.size - 4]
    payload = blob[at + _HEAD.size:end]
    if zlib.crc32(payload, zlib.crc32(head + _ZERO_CRC)) != crc:
        return None
    return Entry(kind, clock, source, t_ns, err_ns, payload)


def _next_entry(blob: bytes, at: int) -> int:
    """The next place that looks like an entry's head; the caller checks its CRC."""
    for at in range(at + 1, len(blob) - _HEAD.size + 1):
        if 1 <= blob[at + 4] <= 6 and blob[at + 5] <= 5 and blob[at + 2] == 0 and blob[at + 3] == 0:
            return at
    return len(blob)


class DrecWriter:
    """Appends entries; each is written whole. Used where Python itself records from a bus."""

    def __init__(self, path: str | os.PathLike, sources: list[dict], config: str = ""):
        self.path = Path(path)
        self.entries = self.bytes = 0
        header = json.dumps({"driveid": version, "created": datetime.now(timezone.utc).isoformat(timespec="seconds"), "clock": "monotonic",
                             "sources": sources, "config": config}).encode()
        self._file = open(self.path, "xb")
        self._write(MAGIC + struct.pack("<II", VERSION, len(header)) + header)
        self._file.flush()

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self.bytes += len(data)

    def add(self, kind: int, t_ns: int, payload: bytes, *, source: int = 0, clock: int = CLOCK_KERNEL, err_ns: int = 0) -> None:
        err_ns = min(err_ns, 0xFFFFFFFF)
        head = _HEAD.pack(len(payload), kind, clock, source, t_ns, err_ns, 0)
        crc = zlib.crc32(payload, zlib.crc32(head))
        self._write(head[:-4] + struct.pack("<I", crc) + payload)
        self.entries += 1

    def can(self, t_ns: int, can_id: int, data: bytes, *, fd_flags: int = 0, source: int = 0, clock: int = CLOCK_KERNEL, err_ns: int = 0) -> None:
        self.add(CAN, t_ns, struct.pack("<IBBH", can_id, fd_flags, len(data), 0) + data, source=source, clock=clock, err_ns=err_ns)

    def mark(self, t_ns: int, text: str) -> None:
        self.add(MARK, t_ns, json.dumps({"text": text}).encode())

    def event(self, t_ns: int, level: str, component: str, text: str) -> None:
        self.add(EVENT, t_ns, json.dumps({"event": "event", "t_ns": t_ns, "level": level, "component": component, "text": text, "mend": "", "count": 1}).encode())

    def flush(self) -> None:
        self._file.flush()

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> DrecWriter:
        return self

    def __exit__(self, *_) -> None:
        self.close()


def of_kind(entries: list[Entry], *kinds: int) -> Iterator[Entry]:
    return (e for e in entries if e.kind in kinds)

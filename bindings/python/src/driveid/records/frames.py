# SPDX-License-Identifier: Apache-2.0
"""CAN frames in bulk: per identifier the stamps and the payloads as arrays, and bit fields taken out of all of them at once."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

EFF, RTR, ERR = 0x80000000, 0x40000000, 0x20000000  # flag bits of a Linux can_id


def pgn_of(can_id: int) -> int:
    """J1939 parameter group of a 29-bit identifier; in addressed groups (PDU format below 240) the destination is no part of it."""
    pgn = can_id >> 8 & 0x3FFFF
    return pgn & 0x3FF00 if pgn >> 8 & 0xFF < 240 else pgn


@dataclass
class Frames:
    """can_id (with EFF flag) -> (t_ns, payload rows, payload lengths)."""

    stamps: dict[int, list[int]] = field(default_factory=dict)
    payloads: dict[int, list[bytes]] = field(default_factory=dict)
    notices: list[str] = field(default_factory=list)
    bad_lines: int = 0
    error_frames: int = 0
    remote_frames: int = 0

    def add(self, can_id: int, t_ns: int, data: bytes) -> None:
        if can_id & ERR:
            self.error_frames += 1
        elif can_id & RTR:
            self.remote_frames += 1
        else:
            self.stamps.setdefault(can_id, []).append(t_ns)
            self.payloads.setdefault(can_id, []).append(data)

    def count(self) -> int:
        return sum(len(s) for s in self.stamps.values())

    def group(self, pgn: int) -> list[int]:
        """Identifiers of a J1939 parameter group: any priority, sender and destination."""
        return [i for i in self.stamps if i & EFF and pgn_of(i) == pgn]

    def of_all(self, can_ids: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same as of() for several identifiers, in the order of their stamps."""
        if len(can_ids) == 1:
            return self.of(can_ids[0])
        merged = Frames()
        for t_ns, payload in sorted((row for i in can_ids for row in zip(self.stamps[i], self.payloads[i])), key=lambda row: row[0]):
            merged.add(0, t_ns, payload)
        return merged.of(0)

    def of(self, can_id: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(t_ns[n], data[n, width] zero padded, length[n])"""
        payloads = self.payloads[can_id]
        length = np.fromiter((len(p) for p in payloads), dtype=np.int64, count=len(payloads))
        width = max(int(length.max(initial=0)), 1)
        data = np.frombuffer(b"".join(p.ljust(width, b"\0") for p in payloads), dtype=np.uint8).reshape(len(payloads), width)
        return np.array(self.stamps[can_id], dtype=np.int64), data, length

    def tell(self) -> list[str]:
        out = list(self.notices)
        if self.bad_lines:
            out.append(f"{self.bad_lines} lines that are no frames were skipped")
        if self.error_frames:
            out.append(f"{self.error_frames} error frames on the bus")
        return out


def bit_positions(start: int, length: int, little: bool) -> list[int]:
    """Positions (byte * 8 + bit, bit 0 the least) of a field, least significant first; start is numbered as in a DBC."""
    if little:
        return list(range(start, start + length))
    positions, at = [], start
    for _ in range(length):
        positions.append(at)
        at = at - 1 if at % 8 else at + 15
    return positions[::-1]


def extract(data: np.ndarray, lengths: np.ndarray, start: int, length: int, little: bool, signed: bool) -> tuple[np.ndarray, np.ndarray]:
    """(raw int64, ok): the bit field of every payload; ok is False where the payload is too short. 64-bit unsigned wraps into int64."""
    positions = np.array(bit_positions(start, length, little))
    ok = lengths > int(positions.max()) // 8
    if positions.max() >= data.shape[1] * 8:
        return np.zeros(len(data), dtype=np.int64), np.zeros(len(data), dtype=bool)
    bits = np.unpackbits(data, axis=1, bitorder="little")[:, positions].astype(np.uint64)
    raw = (bits << np.arange(length, dtype=np.uint64)).sum(axis=1, dtype=np.uint64).view(np.int64)
    if signed and length < 64:
        raw = raw << (64 - length) >> (64 - length)
    return raw, ok


def unwrap(raw: np.ndarray, period: int) -> np.ndarray:
    """A counter that runs over, made continuous: each step is the shortest one."""
    if len(raw) == 0:
        return raw
    step = np.diff(raw)
    step = (step + period // 2) % period - period // 2
    return np.concatenate(([raw[0]], raw[0] + np.cumsum(step)))

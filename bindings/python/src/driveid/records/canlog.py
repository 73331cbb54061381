# SPDX-License-Identifier: Apache-2.0
"""CAN logs. candump's files are read here (exact microseconds, a million lines in seconds); ASC, BLF and TRC through python-can."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import FileError
from .frames import EFF, ERR, RTR, Frames

# candump -L / -l:   (1700000000.123456) can0 181#1122       and FD: 181##1<flags nibble>1122
# candump on screen: (000.000000)  can0  181   [8]  11 22 33
_SCREEN = re.compile(r"^\s*\(([^)]+)\)\s+(\S+)\s+([0-9A-Fa-f]{3,8})\s+\[(\d+)\]\s*((?:[0-9A-Fa-f]{2}\s*)*)(?:'.*)?$")


def read_frames(path: Path, blob: bytes) -> Frames:
    frames = _candump(blob) if path.suffix.lower() == ".log" else _python_can(path)
    if frames.count() == 0:
        raise FileError(path, "holds no CAN data frame", mend="Expected lines as candump -L writes them: (1700000000.123456) can0 181#1122334455667788")
    return frames


def _candump(blob: bytes) -> Frames:
    frames = Frames()
    for line in blob.decode("ascii", errors="replace").splitlines():
        if not line.strip():
            continue
        try:
            parts = line.split(None, 3)
            can_id, data = parse_frame(parts[2])
            frames.add(can_id, stamp_ns(parts[0][1:-1]), data)
        except (ValueError, IndexError):
            if not _screen_line(line, frames):
                frames.bad_lines += 1
    return frames


def stamp_ns(text: str) -> int:
    """'1700000000.123456' to ns, exactly."""
    whole, _, fraction = text.partition(".")
    if not whole.isdecimal() or (fraction and not fraction.isdecimal()):
        raise ValueError(text)
    return int(whole) * 1_000_000_000 + int((fraction + "000000000")[:9])


def parse_frame(text: str) -> tuple[int, bytes]:
    """'181#1122', '18FEF100#R', '181##01122' to (can_id with Linux flags, data)."""
    ident, mark, rest = text.partition("#")
    if not mark or len(ident) not in (3, 8):
        raise ValueError(text)
    can_id = int(ident, 16)
    if len(ident) == 8 and not can_id & ERR:
        can_id |= EFF
    if rest.startswith("#"):
        data = bytes.fromhex(rest[2:])
        if len(data) > 64:
            raise ValueError(text)
        return can_id, data
    if rest[:1] in ("R", "r"):
        return can_id | RTR, b""
    data = bytes.fromhex(rest.partition("_")[0].replace(".", ""))
    if len(data) > 8:
        raise ValueError(text)
    return can_id, data


def _screen_line(line: str, frames: Frames) -> bool:
    match = _SCREEN.match(line)
    if not match:
        return False
    try:
        can_id = int(match.group(3), 16) | (EFF if len(match.group(3)) == 8 else 0)
        data = bytes.fromhex(match.group(5))
        if len(data) != int(match.group(4)):
            return False
        frames.add(can_id, stamp_ns(match.group(1)), data)
        return True
    except ValueError:
        return False


def _python_can(path: Path) -> Frames:
    import can

    frames = Frames()
    try:
        with can.LogReader(str(path)) as reader:
            for m in reader:
                can_id = m.arbitration_id | (EFF if m.is_extended_id else 0) | (RTR if m.is_remote_frame else 0) | (ERR if m.is_error_frame else 0)
                frames.add(can_id, round(m.timestamp * 1e6) * 1000, bytes(m.data))
    except FileError:
        raise
    except Exception as e:  # a reader of python-can may raise anything on a damaged file; what was read before stays
        if frames.count() == 0:
            raise FileError(path, f"is not a readable {path.suffix[1:].upper()} log ({type(e).__name__}: {e})") from None
        frames.notices.append(f"the log is damaged behind frame {frames.count()} ({type(e).__name__}: {e})")
    return frames

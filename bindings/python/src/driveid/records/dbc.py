# SPDX-License-Identifier: Apache-2.0
"""Frames and a DBC to one table: the fastest wanted message gives the instants, the others are brought to them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .. import _core
from ..dbc_wrap import wrap_counts
from ..errors import FileError, UsageError
from ..units import conversion, signal_of
from .frames import EFF, Frames, extract, pgn_of, unwrap
from .mapping import Source
from .table import RawColumn, RawTable

_ANGLES = ("theta_rad", "theta_l_rad", "x_m")
_GAP_PERIODS = 5  # a longer silence of a message leaves its signals missing


@dataclass
class Track:
    """One signal over time, at its own instants."""

    name: str
    unit: str | None
    message: str
    t_ns: np.ndarray
    values: np.ndarray


def load_dbc(paths: list[Path]):
    import cantools

    database = cantools.database.Database(strict=False)
    for path in paths:
        try:
            text = path.read_bytes()
        except OSError as e:
            raise FileError(path, f"cannot be read ({e.strerror})") from None
        try:
            suffix = path.suffix.lower().lstrip(".")
            if suffix == "dbc" or not suffix:
                database.add_dbc_string(text.decode("cp1252"))
            elif suffix in ("kcd", "sym", "arxml"):
                getattr(database, f"add_{suffix}_string")(text.decode("utf-8"))
            else:
                raise FileError(path, f"unknown kind {path.suffix!r}", mend="Known: .dbc .kcd .sym .arxml")
        except FileError:
            raise
        except Exception as e:  # cantools raises its own and textparser's errors; both name the line
            raise FileError(path, f"is not a readable database ({e})") from None
    return database


def table_from_frames(path: Path, digest: str, frames: Frames, dbc: list[Path], maps: dict[str, Source]) -> RawTable:
    if not dbc:
        ids = ", ".join(f"{i & 0x1FFFFFFF:X} ({len(s)})" for i, s in sorted(frames.stamps.items())[:12])
        raise UsageError(f"{path}: frames need a database: --dbc FILE.dbc. Identifiers in the log: {ids}")
    tracks = decode(frames, load_dbc(dbc), path, maps)
    return align(path, digest, tracks, maps, frames.tell())


def decode(frames: Frames, database, path: Path, maps: dict[str, Source]) -> list[Track]:
    angles = _angles(database, maps)
    tracks: list[Track] = []
    for message in database.messages:
        ids = identifiers(message, frames)
        if not ids:
            continue
        if len(ids) > 1:
            frames.notices.append(f"message {message.name} (PGN {pgn_of(message.frame_id)}) comes from {len(ids)} identifiers ({', '.join(f'{i & 0x1FFFFFFF:X}' for i in ids[:4])}): taken together")
        t_ns, data, lengths = frames.of_all(ids)
        for signal in message.signals:
            place = f"{message.name}.{signal.name}"
            track = _track(message, signal, t_ns, data, lengths, _period(signal, angles.get(place) or angles.get(signal.name), place, frames.notices))
            if len(track.t_ns):
                tracks.append(track)
    if not tracks:
        there = ", ".join(f"{i & 0x1FFFFFFF:X}" for i in sorted(frames.stamps)[:12])
        known = ", ".join(f"{m.frame_id:X}" for m in database.messages[:12])
        raise FileError(path, f"no identifier of the log is in the database: log {there}; database {known}", mend="Is it the DBC of this bus?")
    return tracks


def identifiers(message, frames: Frames) -> list[int]:
    """The identifiers under which a message is in the log; a J1939 group has any priority and sender."""
    if message.protocol == "j1939":
        return frames.group(pgn_of(message.frame_id))
    can_id = message.frame_id | (EFF if message.is_extended_frame else 0)
    return [can_id] if can_id in frames.stamps else []


def j1939_last(length: int) -> int:
    """The last raw number of a J1939 value; above it are error and 'not available' (SAE J1939-71 keeps 0xFB and up of the top byte)."""
    return (0xFB << (length - 8)) - 1 if length in (8, 16, 24, 32) else (1 << length) - 2


def _pages(message, signal, data, lengths) -> np.ndarray:
    """Rows whose selectors, one inside another, show the page of a multiplexed signal."""
    ok = np.ones(len(data), dtype=bool)
    while signal.multiplexer_ids is not None and signal.multiplexer_signal is not None:
        mux = message.get_signal_by_name(signal.multiplexer_signal)
        selector, there = extract(data, lengths, mux.start, mux.length, mux.byte_order == "little_endian", False)
        ok &= there & np.isin(selector, signal.multiplexer_ids)
        signal = mux
    return ok


def _angles(database, maps: dict[str, Source]) -> dict[str, tuple[str, str]]:
    """{signal: (our name, unit)} of the counters that run over: the map or their own name or unit calls them a position."""
    found = [(m, s) for m in database.messages for s in m.signals]
    names = [s.name for _, s in found] + [f"{m.name}.{s.name}" for m, s in found]
    out = {}
    for _, s in found:
        ours = s.name if s.name in _ANGLES else signal_of(s.name, s.unit)
        if ours in _ANGLES or "counts" in (s.unit or ""):
            out[s.name] = (ours or "", s.unit or "")
    for name in set(maps) & set(_ANGLES):
        try:
            column, unit, _ = maps[name].resolve(names)
        except UsageError:
            continue  # told when the table is made
        out[column] = (name, unit or out.get(column, ("", ""))[1])
    return out


def _period(signal, angle: tuple[str, str] | None, place: str, notices: list[str]) -> int | None:
    """Counts after which a position starts again, 0 where it does not; None: it is no position."""
    if angle is None:
        return None
    room = 1 << min(signal.length, 63)
    name, unit = angle
    if signal.is_float or signal.length >= 53 or name not in ("theta_rad", "theta_l_rad"):
        return room
    try:
        factor = conversion(unit or signal.unit or "rad", name).factor
    except UsageError:
        return room  # told when the table is made
    period = wrap_counts(signal, float(signal.scale) * factor, unit.startswith("count"), place, [])
    if period not in (0, room):
        notices.append(f"{place}: an angle that starts again after {period} counts")
    return period


def _track(message, signal, t_ns, data, lengths, period: int | None) -> Track:
    little = signal.byte_order == "little_endian"
    raw, ok = extract(data, lengths, signal.start, signal.length, little, signal.is_signed and not signal.is_float)
    ok &= _pages(message, signal, data, lengths)
    if message.protocol == "j1939" and not signal.is_signed and not signal.is_float and period is None:
        ok &= (raw >= 0) & (raw <= j1939_last(signal.length))
    t_ns, raw = t_ns[ok], raw[ok]
    scale, offset = float(signal.scale), float(signal.offset)
    if signal.is_float:
        values = _floats(raw, signal.length)
    else:
        if period and signal.length < 63:
            raw = unwrap(raw, period)
        values = raw.astype(np.float64)
        if not signal.is_signed and signal.length == 64:
            values = raw.view(np.uint64).astype(np.float64)
    return Track(signal.name, signal.unit or None, message.name, t_ns, values * scale + offset if (scale, offset) != (1.0, 0.0) else values)


def _floats(raw: np.ndarray, length: int) -> np.ndarray:
    kind = {16: ("u2", "f2"), 32: ("u4", "f4"), 64: ("u8", "f8")}[length]
    values = raw.view(np.uint64).astype(kind[0]).view(kind[1]).astype(np.float64)
    return np.where(np.isfinite(values), values, np.nan)


def align(path: Path, digest: str, tracks: list[Track], maps: dict[str, Source], notices: list[str]) -> RawTable:
    names = _track_names(tracks)
    wanted = [t for t, n in zip(tracks, names) if _wanted(n, t, maps, names)] or tracks
    base = max(wanted, key=lambda t: (len(t.t_ns), -int(t.t_ns[0])))
    t_ns = base.t_ns
    if np.any(np.diff(t_ns) < 0):
        order = np.argsort(t_ns, kind="stable")
        t_ns = t_ns[order]
        notices.append(f"stamps of message {base.message} go back in time: sorted")
    columns, told = [], {base.message}
    for track, name in zip(tracks, names):
        if track in wanted and track.message not in told:
            told.add(track.message)
            notices.append(f"message {track.message} ({len(track.t_ns)} frames) is interpolated to the instants of {base.message} ({len(base.t_ns)} frames)")
        columns.append(RawColumn(name, track.unit, _loader(track, base, t_ns)))
    return RawTable(str(path), digest, columns, len(t_ns), t_ns, notices)


def _track_names(tracks: list[Track]) -> list[str]:
    """A name that several messages use is told apart by its message."""
    plain = [t.name for t in tracks]
    return [f"{t.message}.{t.name}" if plain.count(t.name) > 1 else t.name for t in tracks]


def _wanted(name: str, track: Track, maps: dict[str, Source], names: list[str]) -> bool:
    if name in _core.SIGNALS or signal_of(name, track.unit):
        return True
    for source in maps.values():
        try:
            if source.resolve(names)[0] == name:
                return True
        except UsageError:
            continue
    return False


def _loader(track: Track, base: Track, t_ns: np.ndarray):
    def load() -> np.ndarray:
        if len(track.t_ns) == len(t_ns) and np.array_equal(track.t_ns, t_ns):
            return track.values
        return bring(track.t_ns, track.values, t_ns)
    return load


def bring(source_ns: np.ndarray, values: np.ndarray, t_ns: np.ndarray) -> np.ndarray:
    """Linear between the source's stamps; missing outside them and in silences of more than five periods."""
    order = np.argsort(source_ns, kind="stable")
    source_ns, values = source_ns[order], values[order]
    origin = source_ns[0]
    out = np.interp((t_ns - origin).astype(np.float64), (source_ns - origin).astype(np.float64), values, left=np.nan, right=np.nan)
    if len(source_ns) < 2:
        return out
    period = float(np.median(np.diff(source_ns)))
    right = np.clip(np.searchsorted(source_ns, t_ns, side="left"), 1, len(source_ns) - 1)
    silent = (source_ns[right] - source_ns[right - 1] > _GAP_PERIODS * period) & (t_ns != source_ns[right]) & (t_ns != source_ns[right - 1])
    out[silent] = np.nan
    return out

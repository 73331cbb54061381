# SPDX-License-Identifier: Apache-2.0
"""A configuration for driveidd out of a CANopen drive's EDS or DCF (CiA 402), read by the package canopen."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from pathlib import Path

from .dbc_import import HEAD, can_source, drive_head
from .errors import UsageError

POSITION, VELOCITY, TORQUE, CURRENT = 0x6064, 0x606C, 0x6077, 0x6078
MEASURED = {POSITION: "position", VELOCITY: "velocity", TORQUE: "torque", CURRENT: "current"}


@dataclass
class Ratings:
    """What the user says; else what the EDS says."""
    counts_per_turn: float | None = None
    m_per_count: float | None = None
    rated_current_A: float | None = None
    rated_torque_Nm: float | None = None
    velocity_unit: str = "counts/s"


def from_eds(path: Path, node_id: int, ratings: Ratings, *, interface: str, structure: str, drive: str, dt_s: float | None) -> tuple[str, list[str]]:
    """(TOML, what to look at)"""
    od, maps = _transmitted(path, node_id)
    found = {v.index: (m, v) for m in maps for v in m if v.index in MEASURED}
    if POSITION not in found and VELOCITY not in found:
        raise UsageError(f"{path}: no transmit PDO of node {node_id} maps the position 0x6064 or the velocity 0x606C. Map them in the drive (0x1A00 ..), save, and export the DCF")
    if TORQUE not in found and CURRENT not in found:
        raise UsageError(f"{path}: no transmit PDO of node {node_id} maps the torque 0x6077 or the current 0x6078. Map one of them in the drive (0x1A00 ..), save, and export the DCF")
    notices: list[str] = []
    chosen = _kinematic(path, od, found, ratings, structure, notices) + [_driving(path, od, found, ratings, structure, notices)]
    used = {id(found[index][0]): found[index][0] for index, _, _ in chosen}.values()
    sync = _sync(od, used, notices)
    dt_s = dt_s or _period(od, used, notices)
    text = HEAD + can_source(interface) + drive_head(drive, structure, dt_s)
    if sync is not None:
        text += f"instant_can_id = 0x{sync:X}  # SYNC: the values after it were taken at its instant\n"
    return text + "".join(_signal(*found[index], name, lines) for index, name, lines in chosen), notices


def _transmitted(path: Path, node_id: int):
    """Object dictionary, and the transmit PDOs that are on."""
    try:
        import canopen
    except ImportError:
        raise UsageError("an EDS is read by the package canopen: pip install driveid[eds]") from None
    if path.suffix.lower() not in (".eds", ".dcf"):
        raise UsageError(f"{path}: neither .eds nor .dcf")
    logging.getLogger("canopen").setLevel(logging.ERROR)
    try:
        node = canopen.Network().add_node(node_id, str(path))  # of a network that is never connected
        node.tpdo.read(from_od=True)
    except OSError as e:
        raise UsageError(f"{path}: {e.strerror or e}") from None
    except Exception as e:  # canopen raises what its parsers raise
        raise UsageError(f"{path}: not a readable EDS: {type(e).__name__}: {e}") from None
    return node.object_dictionary, [m for m in node.tpdo.map.values() if m.enabled and m.cob_id]


def _number(od, index: int, sub: int | None = None) -> float | None:
    """Value of a DCF, else default of an EDS."""
    try:
        entry = od[index] if sub is None else od[index][sub]
    except (KeyError, IndexError):
        return None
    value = getattr(entry, "value", None)
    value = getattr(entry, "default", None) if value is None else value
    return float(value) if isinstance(value, (int, float)) and value else None


def _counts(path: Path, od, ratings: Ratings) -> float:
    """Units of 0x6064 in one turn of the motor: CiA 402 shows increments times feed constant over resolution and gear ratio."""
    if ratings.counts_per_turn:
        return ratings.counts_per_turn
    feed, gear = _number(od, 0x6092, 1), (_number(od, 0x6091, 1) or 1.0) / (_number(od, 0x6091, 2) or 1.0)
    if feed:
        return feed / (_number(od, 0x6092, 2) or 1.0) / gear
    if gear != 1.0:
        raise UsageError(f"{path}: has a gear ratio (0x6091) and no feed constant (0x6092): say --counts-per-turn N, the units of 0x6064 in one turn of the motor")
    counts, turns = _number(od, 0x608F, 1), _number(od, 0x608F, 2) or 1.0
    if not counts:
        raise UsageError(f"{path}: tells no encoder resolution (0x608F): say --counts-per-turn N")
    return counts / turns


def _kinematic(path, od, found, ratings: Ratings, structure: str, notices):
    if structure == "linear_axis":
        if not ratings.m_per_count:
            raise UsageError("a linear axis needs --m-per-count, the metres of one count of 0x6064")
        out = [(POSITION, "x_m", [f"scale = {ratings.m_per_count!r}", "wrap_counts = 4294967296"])] if POSITION in found else []
        return out + ([(VELOCITY, "v_m_s", [f"scale = {ratings.m_per_count!r}"])] if VELOCITY in found and not out else [])
    counts = _counts(path, od, ratings) if POSITION in found or ratings.velocity_unit == "counts/s" else None
    if POSITION in found:
        if VELOCITY in found:
            notices.append("velocity 0x606C left out: the drive derives it from the position, which is taken")
        return [(POSITION, "theta_rad", [f"counts_per_turn = {counts!r}"])]
    scale = 2 * math.pi / 60 if ratings.velocity_unit == "rpm" else 2 * math.pi / counts
    notices.append(f"velocity 0x606C is read as {ratings.velocity_unit}: --velocity-unit says otherwise")
    return [(VELOCITY, "omega_rad_s", [f"scale = {scale!r}"])]


def _driving(path, od, found, ratings: Ratings, structure: str, notices):
    """Both are given in thousandths of a rated value. The current has K_t as its unknown or given; the torque is the drive's own product."""
    current_A = ratings.rated_current_A or (_number(od, 0x6075) or 0) * 1e-3
    torque_Nm = ratings.rated_torque_Nm or (_number(od, 0x6076) or 0) * 1e-3
    if CURRENT in found and current_A:
        if TORQUE in found:
            notices.append("torque 0x6077 left out: the current 0x6078 is taken")
        return CURRENT, "i_q_A", [f"scale = {current_A / 1000!r}  # thousandths of {current_A:g} A"]
    if TORQUE in found and torque_Nm:
        return TORQUE, "F_N" if structure == "linear_axis" else "tau_Nm", [f"scale = {torque_Nm / 1000!r}  # thousandths of {torque_Nm:g}"]
    raise UsageError(f"{path}: tells no rated value: say --rated-current A (0x6075) for 0x6078" + (" or" if TORQUE in found else "") + (" --rated-torque N·m (0x6076) for 0x6077" if TORQUE in found else ""))


def _sync(od, maps, notices) -> int | None:
    synchronous = [m for m in maps if m.trans_type is not None and m.trans_type <= 240]
    if not synchronous:
        notices.append("the PDOs are sent by event, not after a SYNC: the instant of a sample is its frame's arrival")
        return None
    if len(synchronous) < len(list(maps)):
        notices.append("some PDOs follow the SYNC and others an event: set all to synchronous (0x1800 .. sub 2)")
    return int(_number(od, 0x1005) or 0x80) & 0x7FF


def _period(od, maps, notices) -> float:
    cycle_us, longest = _number(od, 0x1006), max((m.trans_type or 1 for m in maps if m.trans_type is not None and m.trans_type <= 240), default=0)
    timers = [m.event_timer for m in maps if m.event_timer]
    if longest and cycle_us:
        return cycle_us * 1e-6 * longest
    if not longest and timers:
        return max(timers) * 1e-3
    notices.append("the EDS tells no period (0x1006, or the PDO's event timer): dt_s = 0.001 is a guess, say --dt")
    return 0.001


def _signal(pdo, variable, name: str, lines: list[str]) -> str:
    wide = pdo.cob_id > 0x7FF
    head = [f'  name = "{name}"  # 0x{variable.index:X} {MEASURED[variable.index]}', '  source = "can0"', f"  can_id = 0x{pdo.cob_id & 0x1FFFFFFF:X}"]
    head += ["  extended = true"] * wide + [f"  start_bit = {variable.offset}", f"  length = {variable.length}", "  signed = true"]
    return "\n  [[drive.signal]]\n" + "\n".join(head + [f"  {line}" for line in lines]) + "\n"

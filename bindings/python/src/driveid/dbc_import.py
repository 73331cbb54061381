# SPDX-License-Identifier: Apache-2.0
"""Configurations for driveidd: a template, and one whose signals come out of a DBC."""

from __future__ import annotations

import json
import math
from pathlib import Path

from . import units
from .dbc_wrap import wrap_counts
from ._core import SIGNALS
from .errors import UsageError, close_names
from .records.dbc import j1939_last, load_dbc
from .records.frames import pgn_of
from .records.mapping import Source, parse_maps

HEAD = """# Configuration of driveidd. `driveidd --check FILE` says what is wrong; `driveidd --manual` lists every key.
format = 1

[control]
socket = "/run/driveid/control.sock"     # $DRIVEID_SOCKET of the command line
write_group = ""                         # group that may record and restart; "" is nobody

[record]
folder = "/var/lib/driveid/records"
"""

_SOURCES = {
    "can": '''
[[source]]
name = "can0"
kind = "socketcan"
interface = "can0"
fd = false                               # true: CAN FD frames too
''',
    "modbus": '''
[[source]]
name = "plc"
kind = "modbus_tcp"
host = "192.168.0.10"
port = 502
unit = 1
poll_s = 0.005
''',
    "replay": '''
[[source]]
name = "file"
kind = "replay"
file = "run.drec"                        # .drec, or a candump .log
speed = 1.0                              # 0: as fast as possible
''',
}

_CAN_SIGNALS = '''
  [[drive.signal]]
  name = "i_q_A"                         # symbol and SI unit; see docs/manual/configuration.md
  source = "{source}"
  can_id = 0x181
  start_bit = 0                          # numbered as in a DBC
  length = 16
  byte_order = "little"
  signed = true
  scale = 0.001                          # value in SI = raw * scale + offset

  [[drive.signal]]
  name = "theta_rad"
  source = "{source}"
  can_id = 0x181
  start_bit = 16
  length = 32
  counts_per_turn = 65536                # an encoder: replaces scale, unwraps
'''

_MODBUS_SIGNALS = '''
  [[drive.signal]]
  name = "i_q_A"                         # symbol and SI unit; see docs/manual/configuration.md
  source = "{source}"
  address = 100                          # counted from 0
  registers = 2
  table = "input"
  encoding = "f32"
  word_order = "big"

  [[drive.signal]]
  name = "theta_rad"
  source = "{source}"
  address = 102
  registers = 2
  table = "input"
  encoding = "i32"
  counts_per_turn = 65536                # an encoder: replaces scale, unwraps
'''


def template(kind: str, structure: str) -> str:
    source = {"can": "can0", "modbus": "plc", "replay": "file"}[kind]
    signals = (_MODBUS_SIGNALS if kind == "modbus" else _CAN_SIGNALS).format(source=source)
    if structure == "linear_axis":
        signals = signals.replace("i_q_A", "F_N").replace("theta_rad", "x_m").replace("counts_per_turn = 65536                # an encoder: replaces scale, unwraps",
                                                                                       "scale = 1e-6                           # one count in metres\n  wrap_counts = 4294967296")
    given = '# given = { K_t_Nm_A = 0.05 }            # what you know; without K_t the parameters are per ampere\n' if structure == "rigid_axis" else ""
    return f'''{HEAD}{_SOURCES[kind]}
[[drive]]
name = "axis1"
structure = "{structure}"                 # or model = "axis1.toml", a model file
{given}dt_s = 0.001                             # nominal time between two samples
{signals}'''


def from_dbc(path: Path, maps, *, interface: str, structure: str, drive: str, dt_s: float | None) -> tuple[str, list[str]]:
    """(TOML, what to look at)"""
    database = load_dbc([path])
    found = [(m, s) for m in database.messages for s in m.signals]
    chosen, notices = _choose(path, found, parse_maps(maps))
    if not chosen:
        names = ", ".join(f"{s.name} [{s.unit or '-'}]" for _, s in found[:20])
        raise UsageError(f"{path}: no signal is known by name or unit. Say which is which: --map i_q_A=SIGNAL --map theta_rad=SIGNAL:deg. There are: {names}")
    cycle = [m.cycle_time for m, _, _, _ in chosen if m.cycle_time]
    if dt_s is None:
        dt_s = min(cycle) / 1000 if cycle else 0.001
        if not cycle:
            notices.append("the DBC tells no cycle time: dt_s = 0.001 is a guess, mend it")
    blocks = [_signal(m, s, name, unit, notices) for m, s, name, unit in chosen]
    text = HEAD + can_source(interface)
    if any(m.is_fd for m, _, _, _ in chosen):
        text += "fd = true\n"
    return text + drive_head(drive, structure, dt_s) + "".join(blocks), notices


def quoted(text: str) -> str:
    """A TOML basic string: JSON's, but for DEL."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def can_source(interface: str) -> str:
    return f'\n[[source]]\nname = "can0"\nkind = "socketcan"\ninterface = {quoted(interface)}\n'


def drive_head(drive: str, structure: str, dt_s: float) -> str:
    return f"\n[[drive]]\nname = {quoted(drive)}\nstructure = {quoted(structure)}\ndt_s = {dt_s!r}\n"


def _remark(text: str) -> str:
    """Fit for a comment: one line, nothing that does not print."""
    return "".join(c if c.isprintable() else " " for c in text)


def _choose(path: Path, found, maps: dict[str, Source]):
    """[(message, signal, our name, unit)]: mapped ones first, then those whose name or symbol and unit say it."""
    names = [s.name for _, s in found] + [f"{m.name}.{s.name}" for m, s in found]
    chosen, notices, used = [], [], set()
    for name, source in maps.items():
        column, unit, negated = source.resolve(names)
        hits = [(m, s) for m, s in found if column in (s.name, f"{m.name}.{s.name}")]
        if len(hits) > 1:
            raise UsageError(f"{path}: {column!r} is in several messages: write {hits[0][0].name}.{column}")
        chosen.append((*hits[0], name, ("-" if negated else "") + (unit or hits[0][1].unit or "")))
        used.add(name)
    for message, signal in found:
        name = signal.name if signal.name in SIGNALS else units.signal_of(signal.name, signal.unit or None)
        if name is None:
            continue
        if name in used:
            notices.append(f"{message.name}.{signal.name} could be {name} as well: left out")
            continue
        chosen.append((message, signal, name, signal.unit or ""))
        used.add(name)
    return chosen, notices


def _signal(message, signal, name: str, unit: str, notices: list[str]) -> str:
    negated = unit.startswith("-")
    unit = unit.lstrip("-")
    try:
        convert = units.conversion(unit, name) if unit else units.Conversion()
    except UsageError as e:
        raise UsageError(f"signal {signal.name}: {e}. Say it: --map {name}={signal.name}:UNIT. {close_names(unit, units.ALIASES)}") from None
    if negated:
        convert = convert.negated()
    scale = float(signal.scale) * convert.factor
    offset = float(signal.offset) * convert.factor + convert.offset
    lines = [f'\n  [[drive.signal]]\n  name = "{name}"  # {message.name}.{signal.name}' + (f" [{_remark(signal.unit)}]" if signal.unit else ""),
             '  source = "can0"']
    if message.protocol == "j1939":
        lines.append(f"  pgn = {pgn_of(message.frame_id)}  # any priority and sender")
    else:
        lines += [f"  can_id = 0x{message.frame_id:X}"] + ["  extended = true"] * message.is_extended_frame
    lines += [f"  start_bit = {signal.start}", f"  length = {signal.length}", f'  byte_order = "{"little" if signal.byte_order == "little_endian" else "big"}"']
    if signal.is_float:
        lines.append(f'  encoding = "f{signal.length}"')
    elif signal.is_signed:
        lines.append("  signed = true")
    wrap = 0
    if name in ("theta_rad", "theta_l_rad", "x_m") and not signal.is_float and signal.length < 53:
        wrap = 1 << signal.length if name == "x_m" else wrap_counts(signal, scale, unit.lower().startswith("count"), f"{message.name}.{signal.name}", notices)
    lines.append(f"  scale = {scale!r}")
    if offset:
        lines.append(f"  offset = {offset!r}")
    if wrap:
        lines.append(f"  wrap_counts = {wrap}")
    elif message.protocol == "j1939" and not signal.is_signed and not signal.is_float:
        lines.append(f"  {'max' if scale > 0 else 'min'} = {(j1939_last(signal.length) + 0.5) * scale + offset!r}  # beyond it: error, or not available")
    if signal.multiplexer_ids:
        lines.append(_mux(message, signal, notices))
    assert math.isfinite(scale)
    return "\n".join(lines) + "\n"


def _mux(message, signal, notices: list[str]) -> str:
    mux = message.get_signal_by_name(signal.multiplexer_signal)
    if mux.multiplexer_ids:
        raise UsageError(f"{message.name}.{signal.name} stands on a page of a page ({mux.multiplexer_signal}, then {mux.name}); the gateway reads one selector: choose another signal with --map")
    if len(signal.multiplexer_ids) > 1:
        notices.append(f"{message.name}.{signal.name} stands on pages {', '.join(map(str, signal.multiplexer_ids))} of {mux.name}: page {signal.multiplexer_ids[0]} is read")
    start = mux.start
    if mux.byte_order != signal.byte_order:  # the gateway reads the selector in the signal's order
        if (mux.start % 8 + 1 < mux.length) if mux.byte_order == "big_endian" else (mux.start % 8 + mux.length > 8):
            raise UsageError(f"{message.name}.{mux.name} spans bytes in another order than {signal.name}: choose another signal with --map")
        start += (1 - mux.length) if mux.byte_order == "big_endian" else mux.length - 1
    return f"  mux = {{ start_bit = {start}, length = {mux.length}, value = {signal.multiplexer_ids[0]} }}"

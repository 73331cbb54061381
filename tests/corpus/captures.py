# SPDX-License-Identifier: Apache-2.0
"""What was on a wire, and what it means: frames and replies with their fate by the manual, decoded by cantools and pymodbus.

Shares no code with driveidd. The fate of a frame is known to whoever put it on the wire:
use (a message of a drive, it carries values), quiet (a message of a drive that carries none: repeated, late, another page), unused (nobody's), reject (too
short, remote, out of its limits), error (an error frame)."""
from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import cantools
from pymodbus.client.mixin import ModbusClientMixin as Registers

START_US = 1_700_000_000_000_000
EFF, RTR, ERR = 0x80000000, 0x40000000, 0x20000000
SOURCE = '[[source]]\nname = "bus"\nkind = "socketcan"\ninterface = "can0"\n'


def drive(*signals, structure="rigid_axis", dt_s=0.004, name="axis1", more=""):
    given = "given = { K_t_Nm_A = 0.05 }\n" if structure == "rigid_axis" else ""
    return f'\n[[drive]]\nname = "{name}"\nstructure = "{structure}"\n{given}dt_s = {dt_s}\n' + more + "".join(signals)


def signal(name, can_id=0x181, start=0, length=16, signed=True, scale=0.001, **keys):
    """One [[drive.signal]]; can_id None: a parameter group or a register, by its key."""
    known = {"name": name, "source": "bus", "can_id": can_id} | ({} if "address" in keys else {"start_bit": start, "length": length}) | {"scale": scale} | keys
    if signed and "encoding" not in keys:
        known["signed"] = True
    lines = "".join(f"  {key} = {inline(value)}\n" for key, value in known.items() if value is not None)
    return f"\n  [[drive.signal]]\n{lines}"


def inline(value):
    return "{ " + ", ".join(f"{k} = {v}" for k, v in value.items()) + " }" if isinstance(value, dict) else json.dumps(value)


@dataclass
class Frame:
    t_us: int
    can_id: int
    data: bytes
    fd: bool = False
    fate: str = "use"
    sample: int | None = None

    def candump(self):
        digits = 8 if self.can_id & (EFF | ERR) else 3
        number = self.can_id & (0x1FFFFFFF | (ERR if self.can_id & ERR else 0))
        body = "R" if self.can_id & RTR else ("#0" if self.fd else "") + self.data.hex().upper()
        return f"({self.t_us // 1_000_000}.{self.t_us % 1_000_000:06d}) can0 {number:0{digits}X}#{body}"

    def slcan(self):
        kind = "T" if self.can_id & EFF else "t"
        return f"{kind}{self.can_id & 0x1FFFFFFF:0{8 if kind == 'T' else 3}X}{len(self.data)}{self.data.hex().upper()}\r".encode()


@dataclass
class Session:
    name: str
    about: str
    config: str                                    # drives, and the source as it stood where it was recorded
    capture: bytes                                 # the file as it was recorded
    kind: str = "can"                              # can, log, drec, slcan, modbus_tcp, modbus_rtu
    rows: list = field(default_factory=list)       # (drive, seconds since the first frame or None, {signal: value})
    source: dict = field(default_factory=dict)     # what status says of the source
    drive: dict = field(default_factory=dict)      # and of the first drive
    dbc: str = ""

    SUFFIX = {"can": "log", "log": "log", "drec": "drec", "slcan": "slcan", "modbus_tcp": "replies", "modbus_rtu": "replies"}

    def write(self, folder: Path):
        folder.mkdir(exist_ok=True)
        (folder / f"capture.{self.SUFFIX[self.kind]}").write_bytes(self.capture)
        (folder / "driveidd.toml").write_text(f"# {self.about}\nformat = 1\n\n{self.config}")
        if self.dbc:
            (folder / "frames.dbc").write_text(self.dbc)
        head = {"about": self.about, "kind": self.kind, "source": self.source, "drive": self.drive}
        rows = [json.dumps([d, None if t is None else round(t, 9), v]) for d, t, v in self.rows]
        (folder / "expected.json").write_text(json.dumps(head)[:-1] + ',\n "samples": [\n' + ",\n".join(rows) + "\n]}\n")


def counted(frames):
    fates = Counter(f.fate for f in frames)
    used = fates["use"] + fates["quiet"]
    return {"frames": len(frames) - fates["error"], "used": used, "unused": fates["unused"], "rejected": fates["reject"], "errors": fates["error"]}


def samples(frames, dbc, wanted, wraps=(), drive=0):
    """Rows of one drive: all used frames of one sample number together, the stamp of the earliest; counters in `wraps` run over after that many counts."""
    database = cantools.database.load_string(dbc, "dbc", strict=False)
    by_key = {(m.frame_id, m.is_extended_frame): m for m in database.messages}
    wraps, last, turns, rows = dict(wraps), {}, {}, {}
    for f in frames:
        message = by_key.get((f.can_id & 0x1FFFFFFF, bool(f.can_id & EFF)))
        if f.fate != "use" or message is None or f.sample is None:
            continue
        t, values = rows.setdefault(f.sample, (f.t_us, {}))
        raw = message.decode(f.data, scaling=False)
        for name, value in message.decode(f.data, allow_truncated=True).items():
            if name not in wanted:
                continue
            if name in wraps:
                period = wraps[name]
                step = (raw[name] - last.get(name, raw[name]) + period // 2) % period - period // 2
                turns[name] = turns.get(name, raw[name]) + step
                last[name] = raw[name]
                definition = message.get_signal_by_name(name)
                value = turns[name] * definition.scale + definition.offset
            values[name] = float(value)
        rows[f.sample] = (min(t, f.t_us), values)
    first = min(f.t_us for f in frames)
    return [(drive, (t - first) * 1e-6, values) for t, values in sorted(rows.values(), key=lambda row: row[0]) if set(values) == set(wanted)]


def can(name, about, dbc, config, frames, wanted, kind="can", source=SOURCE, capture=None, wraps=(), stamps=True, rows=None, **told):
    """A session of frames; a sample lacks nothing of `wanted`, or it is none."""
    rows = samples(frames, dbc, wanted, wraps) if rows is None else rows
    if not stamps:
        rows = [(d, None, v) for d, _, v in rows]
    capture = capture if capture is not None else "".join(f.candump() + "\n" for f in frames).encode()
    return Session(name, about, source + config, capture, kind, rows, told.get("counters", counted(frames)), told.get("drive", {}), dbc)


def registers_of(table, pdu, word_order="big"):
    """{signal: value} of one reply by pymodbus. table: {signal: (register in the reply, type, scale)}."""
    words = [int.from_bytes(pdu[2 + k:4 + k], "big") for k in range(0, pdu[1], 2)]
    out = {}
    for name, (at, kind, scale) in table.items():
        value = Registers.convert_from_registers(words[at:at + kind.value[1]], kind, word_order)
        out[name] = float(value) * scale
    return out

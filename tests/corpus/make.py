# SPDX-License-Identifier: Apache-2.0
"""Make the corpus anew: python tests/corpus/make.py. Deterministic; the diff shows what changed. See captures.py for what is decoded by whom."""
from __future__ import annotations

import json
import math
import struct
import sys
import zlib
from pathlib import Path

import cantools
from captures import EFF, ERR, RTR, SOURCE, START_US, Frame, Registers, Session, can, drive, registers_of, samples, signal

HERE = Path(__file__).resolve().parent
N, STEP_US = 60, 4000
HEAD = 'VERSION ""\nBU_: drive\n'
PLAIN = HEAD + '''BO_ 385 axis: 8 drive
 SG_ i_q_A : 0|16@1- (0.001,0) [0|0] "A" x
 SG_ theta_rad : 16|32@1- (0.0001,0) [0|0] "rad" x
 SG_ count : 48|8@1+ (1,0) [0|0] "" x
'''
AXIS = drive(signal("i_q_A"), signal("theta_rad", start=16, length=32, scale=1e-4))
COUNTED = AXIS + '\n  [drive.counter]\n  source = "bus"\n  can_id = 0x181\n  start_bit = 48\n  length = 8\n'
WANTED = ("i_q_A", "theta_rad")


def motion(k):
    """A current and an angle that nobody could mistake for another instant."""
    return round(2.0 * math.sin(0.21 * k) + 0.003 * k, 3), round(3.0 * math.sin(0.05 * k) + 0.01 * k, 4)


def message(dbc, k, values, t_us=0, can_id=None, sample=True, fd=False, which=0):
    definition = cantools.database.load_string(dbc, "dbc", strict=False).messages[which]
    identifier = can_id if can_id is not None else definition.frame_id | (EFF if definition.is_extended_frame else 0)
    return Frame(START_US + k * STEP_US + t_us, identifier, bytes(definition.encode(values, strict=False)), fd, sample=k if sample else None)


def plain(n=N):
    return [message(PLAIN, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1], "count": k % 256}) for k in range(n)]


def sources():
    """What a healthy bus carries."""
    yield can("can-plain", "current and angle in one frame, Intel", PLAIN, AXIS, plain(), WANTED)

    big = HEAD + 'BO_ 385 axis: 8 drive\n SG_ i_q_A : 7|16@0- (0.002,0) [0|0] "A" x\n SG_ theta_rad : 23|32@0- (0.0001,0) [0|0] "rad" x\n'
    config = drive(signal("i_q_A", start=7, byte_order="big", scale=0.002), signal("theta_rad", start=23, length=32, byte_order="big", scale=1e-4))
    yield can("can-big-endian", "Motorola fields", big, config, [message(big, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1]}) for k in range(N)], WANTED)

    odd = HEAD + 'BO_ 385 axis: 8 drive\n SG_ i_q_A : 3|13@1- (0.002,-1) [0|0] "A" x\n SG_ theta_rad : 35|21@0- (0.00005,0.5) [0|0] "rad" x\n'
    config = drive(signal("i_q_A", start=3, length=13, scale=0.002, offset=-1.0), signal("theta_rad", start=35, length=21, byte_order="big", scale=5e-5, offset=0.5))
    yield can("can-odd-fields", "13 and 21 bits across bytes, in both orders, with offsets", odd, config, [message(odd, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1]}) for k in range(N)], WANTED)

    wide = HEAD + 'BO_ 2566844926 axis: 8 drive\n SG_ i_q_A : 0|16@1- (0.001,0) [0|0] "A" x\n SG_ theta_rad : 16|32@1- (0.0001,0) [0|0] "rad" x\n'
    identifier = 2566844926 & 0x1FFFFFFF
    config = drive(signal("i_q_A", identifier, extended=True), signal("theta_rad", identifier, 16, 32, scale=1e-4, extended=True))
    frames = [message(wide, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1]}) for k in range(N)]
    frames += [Frame(START_US + k * STEP_US + 500, identifier & 0x7FF, bytes(8), fate="unused") for k in range(0, N, 5)]
    yield can("can-29-bit", "29-bit identifiers; an 11-bit one with the same last bits is another", wide, config, sorted(frames, key=lambda f: f.t_us), WANTED)

    floats = HEAD + 'BO_ 385 axis: 8 drive\n SG_ i_q_A : 0|32@1- (1,0) [0|0] "A" x\n SG_ theta_rad : 39|32@0- (1,0) [0|0] "rad" x\nSIG_VALTYPE_ 385 i_q_A : 1;\nSIG_VALTYPE_ 385 theta_rad : 1;\n'
    config = drive(signal("i_q_A", length=32, encoding="f32", scale=1.0), signal("theta_rad", start=39, length=32, encoding="f32", byte_order="big", scale=1.0))
    yield can("can-floats", "floating point in both orders", floats, config, [message(floats, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1]}) for k in range(N)], WANTED)

    long = HEAD + 'BO_ 385 axis: 32 drive\n SG_ i_q_A : 0|32@1- (1,0) [0|0] "A" x\n SG_ theta_rad : 128|64@1- (1,0) [0|0] "rad" x\nSIG_VALTYPE_ 385 i_q_A : 1;\nSIG_VALTYPE_ 385 theta_rad : 2;\n'
    config = drive(signal("i_q_A", length=32, encoding="f32", scale=1.0), signal("theta_rad", start=128, length=64, encoding="f64", scale=1.0))
    yield can("can-fd", "CAN FD, a double behind byte 16", long, config, [message(long, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1]}, fd=True) for k in range(N)], WANTED, source=SOURCE + "fd = true\n")

    turn = HEAD + f'BO_ 385 axis: 8 drive\n SG_ i_q_A : 0|16@1- (0.001,0) [0|0] "A" x\n SG_ theta_rad : 16|12@1+ ({2 * math.pi / 4096!r},0) [0|0] "rad" x\n'
    config = drive(signal("i_q_A"), signal("theta_rad", start=16, length=12, signed=False, scale=None, counts_per_turn=4096))
    raw = [(4000 + round(900 * math.sin(0.11 * k)) * 3) % 4096 for k in range(N)]
    frames = [message(turn, k, {"i_q_A": motion(k)[0], "theta_rad": raw[k] * 2 * math.pi / 4096}) for k in range(N)]
    yield can("can-encoder-wraps", "a 12-bit encoder that runs over in both directions", turn, config, frames, WANTED, wraps={"theta_rad": 4096})

    config = drive(signal("i_q_A"), signal("theta_rad", start=16, length=12, signed=False, scale=None, counts_per_turn=4096, gear_ratio=-2.5))
    rows = [(d, t, v | {"theta_rad": v["theta_rad"] * -2.5}) for d, t, v in samples(frames, turn, WANTED, {"theta_rad": 4096})]
    yield can("can-gear", "the axis turns 2.5 times, the other way", turn, config, frames, WANTED, rows=rows)

    two = PLAIN.replace(' SG_ theta_rad : 16|32@1- (0.0001,0) [0|0] "rad" x\n', "") + 'BO_ 641 angle: 4 drive\n SG_ theta_rad : 0|32@1- (0.0001,0) [0|0] "rad" x\n'
    config = drive(signal("i_q_A"), signal("theta_rad", 0x281, 0, 32, scale=1e-4), more="align_tolerance_s = 0.001\n")
    frames = [f for k in range(N) for f in sorted((message(two, k, {"i_q_A": motion(k)[0], "count": 0}, 0 if k % 3 else 300), message(two, k, {"theta_rad": motion(k)[1]}, 120, which=1)), key=lambda f: f.t_us)]
    yield can("can-two-messages", "a sample in two messages that come in either order", two, config, frames, WANTED)

    sync = drive(signal("i_q_A"), signal("theta_rad", start=16, length=32, scale=1e-4), more="instant_can_id = 0x80\n")
    frames, rows = [], []
    for k in range(N):
        frames += [Frame(START_US + k * STEP_US, 0x80, b"", fate="quiet"), message(PLAIN, k, {"i_q_A": motion(k)[0], "theta_rad": motion(k)[1], "count": 0}, 700 + 13 * (k % 5))]
        rows.append((0, k * STEP_US * 1e-6, dict(zip(WANTED, motion(k)))))
    yield can("can-sync-instant", "CANopen: the SYNC is the sampling instant, whenever the values follow", PLAIN, sync, frames, WANTED, rows=rows)

    pages = HEAD + 'BO_ 385 axis: 8 drive\n SG_ page M : 0|8@1+ (1,0) [0|0] "" x\n SG_ i_q_A m3 : 8|16@1- (0.001,0) [0|0] "A" x\n SG_ theta_rad m4 : 8|32@1- (0.0001,0) [0|0] "rad" x\n SG_ T_degC m9 : 8|16@1- (0.1,0) [0|0] "degC" x\n'
    config = drive(signal("i_q_A", start=8, mux={"start_bit": 0, "length": 8, "value": 3}), signal("theta_rad", start=8, length=32, scale=1e-4, mux={"start_bit": 0, "length": 8, "value": 4}))
    frames = []
    for k in range(N):
        frames += [message(pages, k, {"page": 3, "i_q_A": motion(k)[0]}), message(pages, k, {"page": 4, "theta_rad": motion(k)[1]}, 100), message(pages, k, {"page": 9, "T_degC": 99.0}, 200)]
        frames[-1].fate = "quiet"
    yield can("can-pages", "multiplexed signals; another page never shines through", pages, config, frames, WANTED)

    group = HEAD + 'BO_ 2364540158 axis: 8 drive\n SG_ i_q_A : 0|16@1+ (0.05,-1600) [0|0] "A" x\n SG_ theta_rad : 16|32@1- (0.0001,0) [0|0] "rad" x\n'
    pgn = (2364540158 & 0x1FFFFFFF) >> 8 & 0x3FFFF
    config = drive(signal("i_q_A", None, signed=False, pgn=pgn, scale=0.05, offset=-1600.0), signal("theta_rad", None, 16, 32, pgn=pgn, scale=1e-4))
    frames = [message(group, k, {"i_q_A": 0.05 * round(20 * motion(k)[0]), "theta_rad": motion(k)[1]}) for k in range(N)]
    rows = samples(frames, group, WANTED)
    for k, f in enumerate(frames):
        f.can_id = EFF | (3 + k % 4) << 26 | pgn << 8 | (k * 7) % 250
    frames += [Frame(START_US + k * STEP_US + 900, EFF | 6 << 26 | (pgn + 1) << 8 | 5, bytes(8), fate="unused") for k in range(0, N, 3)]
    yield can("can-j1939", "a J1939 group from changing senders with changing priority; its neighbour is another", group, config, sorted(frames, key=lambda f: f.t_us), WANTED, rows=rows)

    both = PLAIN + PLAIN.partition(HEAD)[2].replace("BO_ 385 axis", "BO_ 386 second")
    config = AXIS + drive(signal("i_q_A", 0x182), signal("theta_rad", 0x182, 16, 32, scale=1e-4), name="axis2")
    first, other = plain(), [message(both, k, {"i_q_A": -motion(k)[0], "theta_rad": 2.0 - motion(k)[1], "count": 0}, 900, which=1) for k in range(N)]
    frames = sorted(first + other, key=lambda f: f.t_us)
    rows = [(0, *row[1:]) for row in samples(first, both, WANTED)] + [(1, row[1] + 900e-6, row[2]) for row in samples(other, both, WANTED)]
    yield can("can-two-drives", "two drives on one bus", both, config, frames, WANTED, rows=rows)

    rpm = HEAD + 'BO_ 385 axis: 8 drive\n SG_ i_q_A : 0|16@1- (0.01,0) [0|0] "A" x\n SG_ omega_rad_s : 16|16@1- (0.25,0) [0|0] "rad/s" x\n SG_ T_degC : 32|8@1+ (0.5,-40) [0|0] "degC" x\n'
    config = drive(signal("i_q_A", scale=0.01), signal("omega_rad_s", start=16, scale=0.25), signal("T_degC", start=32, length=8, signed=False, scale=0.5, offset=-40.0))
    frames = [message(rpm, k, {"i_q_A": motion(k)[0], "omega_rad_s": 100 * motion(k)[1], "T_degC": -20 + k / 2}) for k in range(N)]
    yield can("can-temperature", "speed instead of angle, and a temperature below zero", rpm, config, frames, ("i_q_A", "omega_rad_s", "T_degC"))


def faults():
    """One thing that goes wrong in each."""
    frames = [f for k, f in enumerate(plain()) if k not in (20, 21, 22, 40)]
    yield can("fault-lost", "four frames lost, three of them in a row; the drive's own counter tells", PLAIN, COUNTED, frames, WANTED, drive={"dropped": 4})

    frames = plain()
    for k in (50, 30, 10):
        frames.insert(k + 1, Frame(frames[k].t_us + 50, frames[k].can_id, frames[k].data, fate="quiet"))
    yield can("fault-repeated", "three frames repeated", PLAIN, COUNTED, frames, WANTED, drive={"duplicates": 3, "dropped": 0})

    frames = plain()
    late = frames.pop(30)
    late.t_us, late.fate = frames[30].t_us + 60, "quiet"
    frames.insert(31, late)
    yield can("fault-reordered", "one frame overtaken by the next: it is missing, and when it comes it is old", PLAIN, COUNTED, frames, WANTED, drive={"reordered": 1, "dropped": 1})

    frames = plain()
    for k in (5, 25, 45):
        frames[k].data, frames[k].fate = frames[k].data[:k % 6], "reject"
    yield can("fault-short", "frames that are shorter than their fields", PLAIN, AXIS, frames, WANTED, drive={"rejected": 3})

    frames = plain()
    frames[12].can_id, frames[12].data, frames[12].fate = 0x181 | RTR, b"", "reject"
    yield can("fault-remote", "a remote request with the drive's identifier", PLAIN, AXIS, frames, WANTED)

    frames = plain()
    for k, what in ((50, 0x40), (35, 0x04), (20, 0x04)):  # bus off, controller problems
        frames.insert(k, Frame(frames[k].t_us - 900, ERR | what, bytes(8), fate="error"))
    yield can("fault-error-frames", "error frames: controller problems, bus off", PLAIN, AXIS, frames, WANTED)

    frames = plain()
    frames += [Frame(START_US + k * STEP_US + 200 + j, 0x200 + (k * 37 + j) % 0x300, bytes([k, j]), fate="unused") for k in range(N) for j in range(3)]
    yield can("fault-foreign", "three frames of others for each of the drive's", PLAIN, AXIS, sorted(frames, key=lambda f: f.t_us), WANTED)

    frames = plain()
    for k in (15, 33):
        frames[k] = message(PLAIN, k, {"i_q_A": 31.0, "theta_rad": motion(k)[1], "count": k})
        frames[k].fate = "reject"
    config = drive(signal("i_q_A", min=-5.0, max=5.0), signal("theta_rad", start=16, length=32, scale=1e-4))
    yield can("fault-out-of-limits", "a current that cannot be", PLAIN, config, frames, WANTED, drive={"rejected": 2})

    frames = plain()
    for f in frames[40:]:
        f.t_us += 500_000
    yield can("fault-silence", "half a second of silence", PLAIN, AXIS, frames, WANTED, drive={"gaps": 1})

    turn = HEAD + f'BO_ 385 axis: 8 drive\n SG_ i_q_A : 0|16@1- (0.001,0) [0|0] "A" x\n SG_ theta_rad : 16|32@1- ({2 * math.pi / 65536!r},0) [0|0] "rad" x\n'
    config = drive(signal("i_q_A"), signal("theta_rad", start=16, length=32, scale=None, counts_per_turn=65536, max_rate=100.0))
    counts = [1_000_000 + 40 * k for k in range(30)] + [40 * k for k in range(30)]  # switched off and on: the encoder begins at zero
    frames = [message(turn, k, {"i_q_A": motion(k)[0], "theta_rad": c * 2 * math.pi / 65536}) for k, c in enumerate(counts)]
    goes_on = [1_000_000 + 40 * k for k in range(30)] + [1_000_000 + 40 * 29 + 40 * k for k in range(30)]
    rows = [(d, t, v | {"theta_rad": c * 2 * math.pi / 65536}) for (d, t, v), c in zip(samples(frames, turn, WANTED), goes_on, strict=True)]
    yield can("fault-encoder-reset", "the encoder begins at zero: a jump is told, the angle goes on from its last value", turn, config, frames, WANTED, rows=rows, drive={"jumps": 1})

    two = PLAIN.replace(' SG_ theta_rad : 16|32@1- (0.0001,0) [0|0] "rad" x\n', "") + 'BO_ 641 angle: 4 drive\n SG_ theta_rad : 0|32@1- (0.0001,0) [0|0] "rad" x\n'
    config = drive(signal("i_q_A"), signal("theta_rad", 0x281, 0, 32, scale=1e-4), more="align_tolerance_s = 0.001\n")
    frames = [f for k in range(N) for f in (message(two, k, {"i_q_A": motion(k)[0], "count": 0}), message(two, k, {"theta_rad": motion(k)[1]}, 120, which=1)) if not (k in (8, 28) and f.can_id == 0x281)]
    yield can("fault-half-a-sample", "twice one of two messages is lost: the sample is none", two, config, frames, WANTED, drive={"dropped": 2})

    text = "".join(f.candump() + ("\r\n" if k % 2 else "\n") + {10: "no frame at all\n", 20: "(1.5 can0 181#\n", 30: "(1700000000.0) can0 181#12345\n", 40: "\n", 50: "\xff\xfe\x00#\n"}.get(k, "") for k, f in enumerate(plain()))
    yield can("log-garbage", "a candump log with lines that are none, and two kinds of line ends", PLAIN, AXIS, plain(), WANTED, "log", capture=text.encode("latin-1"), counters={"used": N, "errors": 4})

    text = "".join(f.candump() + "\n" for f in plain())
    yield can("log-cut-off", "a log that ends in the middle of a line", PLAIN, AXIS, plain()[:-1], WANTED, "log", capture=text[:-9].encode(), counters={"used": N - 1})


def serial():
    """Adapters that speak slcan: the stamp is when the line was read, so that only values are compared, and the instants are the drive's own."""
    AXIS = drive(signal("i_q_A"), signal("theta_rad", start=16, length=32, scale=1e-4), more="paced = true\ngap_s = 5.0\n")
    text = b"".join(f.slcan() for f in plain())
    yield can("slcan-plain", "an slcan adapter", PLAIN, AXIS, plain(), WANTED, "slcan", capture=text, stamps=False)

    noise = {7: b"z\r", 13: b"V1013\r", 21: b"t18\r", 29: b"\xff\xfe\x00\r", 37: b"t1816ZZ\r", 51: b"x" * 400 + b"\r"}
    text = b"".join(noise.get(k, b"") + f.slcan() for k, f in enumerate(plain()))
    yield can("slcan-garbage", "answers of the adapter, and lines that are none", PLAIN, AXIS, plain(), WANTED, "slcan", capture=text, stamps=False, counters={"used": N, "rejected": 4})

    frames = plain()
    frames += [Frame(f.t_us + 10, EFF | 0x181, f.data, fate="unused") for f in frames[::4]]
    frames.sort(key=lambda f: f.t_us)
    yield can("slcan-29-bit", "29-bit frames of others between the drive's own", PLAIN, AXIS, frames, WANTED, "slcan", capture=b"".join(f.slcan() for f in frames), stamps=False)

    text = b"".join(f.slcan()[:-1] + f"{k * 4:04X}".encode() + b"\r" for k, f in enumerate(plain()))
    yield can("slcan-stamps", "an adapter that appends its own time to each line", PLAIN, AXIS, plain(), WANTED, "slcan", capture=text, stamps=False)


def drec_entry(kind, t_ns, payload, source=0):
    head = struct.pack("<IBBHqI", len(payload), kind, 2, source, t_ns, 0)
    return head + struct.pack("<I", zlib.crc32(head + bytes(4) + payload)) + payload


def records():
    """The gateway's own record, written from docs/manual/record-format.md."""
    header = json.dumps({"driveid": "0.1.0", "created": "2023-11-14T22:13:20+00:00", "clock": "monotonic", "sources": [{"name": "bus", "kind": "socketcan", "address": "can0"}], "drives": ["axis1"], "config": ""}).encode()
    start = b"DRVIDREC" + struct.pack("<II", 1, len(header)) + header
    entries = [drec_entry(1, f.t_us * 1000, struct.pack("<IBBH", f.can_id, 0, len(f.data), 0) + f.data) for f in plain()]
    yield can("drec-plain", "frames out of a record", PLAIN, AXIS, plain(), WANTED, "drec", capture=start + b"".join(entries))

    frames = [f for k, f in enumerate(plain()) if k not in (17, 18)]
    bad = bytearray(entries[17])
    bad[30] ^= 0x10
    damaged = start + b"".join(entries[:17]) + bytes(bad) + entries[18][:20] + b"".join(entries[19:]) + entries[0][:15]
    yield can("drec-damaged", "a flipped bit, a torn entry and a torn end: what is whole is replayed", PLAIN, AXIS, frames, WANTED, "drec", capture=damaged, counters={"used": N - 2})

    kinds = Registers.DATATYPE
    table, rows, entries = {"i_q_A": (0, kinds.INT16, 0.001), "theta_rad": (1, kinds.INT32, 1e-4)}, [], []
    for k in range(N):
        pdu = bytes([4, 6]) + struct.pack(">hi", round(motion(k)[0] * 1000), round(motion(k)[1] * 1e4))
        words = struct.unpack(">3H", pdu[2:])
        entries.append(drec_entry(2, (START_US + k * STEP_US) * 1000, struct.pack("<BBHHH3H", 1, 4, 10, 3, 0, *words)))
        rows.append((0, k * STEP_US * 1e-6, registers_of(table, pdu)))
    yield Session("drec-modbus", "Modbus replies out of a record", modbus_source("modbus_tcp") + modbus_drive(kinds.INT16, kinds.INT32), start + b"".join(entries), "drec", rows, {"used": N, "rejected": 0})


def modbus_source(kind):
    where = 'host = "127.0.0.1"\nport = 502\n' if kind == "modbus_tcp" else 'device = "/dev/ttyUSB0"\nbaud = 115200\nparity = "none"\n'
    return f'[[source]]\nname = "bus"\nkind = "{kind}"\n{where}unit = 1\npoll_s = 0.004\ntimeout_s = 0.2\n'


def modbus_drive(current, angle, **keys):
    words = {"INT16": "i16", "UINT16": "u16", "INT32": "i32", "FLOAT32": "f32", "FLOAT64": "f64", "INT64": "i64", "UINT32": "u32"}
    scales = [1.0 if k.name.startswith("FLOAT") else s for k, s in ((current, 0.001), (angle, 1e-4))]
    at = 10 + current.value[1]
    return drive(signal("i_q_A", None, address=10, encoding=words[current.name], scale=scales[0], **keys), signal("theta_rad", None, address=at, encoding=words[angle.name], scale=scales[1], **keys))


def poll(name, about, kind, current, angle, faults=None, word_order="big", function=4, **keys):
    """A session of replies, one a line; a line before a reply may say what goes wrong first (see test_corpus.py)."""
    scale = [1.0 if k.name.startswith("FLOAT") else s for k, s in ((current, 0.001), (angle, 1e-4))]
    table = {"i_q_A": (0, current, scale[0]), "theta_rad": (current.value[1], angle, scale[1])}
    lines, rows = [], []
    for k in range(N):
        words = []
        for kind_of, value, step in zip((current, angle), motion(k), scale, strict=True):
            words += Registers.convert_to_registers(value if step == 1.0 else round(value / step), kind_of, word_order)
        pdu = bytes([function, 2 * len(words)]) + struct.pack(f">{len(words)}H", *words)
        lines += [(faults or {}).get(k), pdu.hex()]
        rows.append((0, None, registers_of(table, pdu, word_order)))
    keys |= {"word_order": word_order} if word_order != "big" else {}
    told = {"errors": len(faults)} if faults else {"errors": 0}
    return Session(name, about, modbus_source(kind) + modbus_drive(current, angle, **keys), "".join(f"{x}\n" for x in lines if x).encode(), kind, rows, told)


def modbus():
    t = Registers.DATATYPE
    yield poll("modbus-integers", "16-bit current, 32-bit angle", "modbus_tcp", t.INT16, t.INT32)
    yield poll("modbus-floats", "floats and doubles", "modbus_tcp", t.FLOAT32, t.FLOAT64)
    yield poll("modbus-low-word-first", "the low word first, in holding registers", "modbus_tcp", t.INT32, t.FLOAT32, word_order="little", function=3, table="holding")
    yield poll("modbus-exceptions", "the device is busy, and says so", "modbus_tcp", t.INT16, t.INT32, {9: "exception 6", 30: "exception 4", 31: "exception 6"})
    yield poll("modbus-silent", "twice no answer", "modbus_tcp", t.INT16, t.INT32, {20: "silent", 45: "silent"})
    yield poll("modbus-wrong-transaction", "an answer to another request", "modbus_tcp", t.INT16, t.INT32, {15: "other 0406" + "7fff" * 3})
    yield poll("modbus-closed", "the device closes the connection", "modbus_tcp", t.INT16, t.INT32, {25: "close"})
    yield poll("rtu-plain", "Modbus RTU", "modbus_rtu", t.INT16, t.INT32)
    yield poll("rtu-bad-crc", "a disturbed line: one checksum is wrong", "modbus_rtu", t.INT16, t.INT32, {22: "crc 0406" + "7fff" * 3})


def main():
    made = [s for part in (sources, faults, serial, records, modbus) for s in part()]
    names = {s.name for s in made}
    assert len(names) == len(made)
    stale = [p for p in HERE.iterdir() if p.is_dir() and (p / "expected.json").exists() and p.name not in names]
    for session in made:
        session.write(HERE / session.name)
        print(f"{session.name:26} {session.kind:10} {len(session.rows):4} samples  {session.about}")
    print(f"{len(made)} sessions" + (f"; no longer made: {', '.join(p.name for p in stale)}" if stale else ""))


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""Recorded sessions of every source and every fault, put before driveidd as they stood on the wire: it must decode what cantools and pymodbus decode.

A folder a session: capture.* (candump log, bytes of an slcan adapter, Modbus replies, the gateway's record), driveidd.toml as it was there, expected.json.
make.py makes them; nothing in them comes out of driveidd."""
from __future__ import annotations

import json
import os
import re
import select
import socket
import struct
import sys
import threading
import time
import tty
from pathlib import Path

import pytest
import tomlkit

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "daemon"), str(HERE.parent / "golden")]
import drec  # noqa: E402
from gateway import Gateway, frame  # noqa: E402

SESSIONS = sorted(p.parent.name for p in HERE.glob("*/expected.json"))
DUMP = re.compile(r"\((\d+)\.(\d{6})\) \S+ ([0-9A-F]+)#(#[0-9A-F])?(R|[0-9A-F]*)")


@pytest.fixture
def gateway(tmp_path):
    gateway = Gateway(tmp_path)
    yield gateway
    gateway.close()


def start(gateway, folder, buses=0, **source):
    """The daemon with the session's configuration, its source replaced by the test's."""
    document = tomlkit.parse((folder / "driveidd.toml").read_text())
    if source:
        same_kind = document["source"][0]["kind"] == source["kind"]
        kept = {k: v for k, v in document["source"][0].items() if k == "name" or same_kind}
        document["source"][0] = tomlkit.item(kept | source)
    del document["format"]
    text = f'[record]\nfolder = "{gateway.folder}"\nfile = "out.drec"\n' + tomlkit.dumps(document)
    gateway.start(text, buses=buses)


def frames_of(text):
    """The socketpair's messages of a candump log, shifted to end now."""
    rows = [match.groups() for match in map(DUMP.match, text.splitlines())]
    stamps = [int(s) * 10**9 + int(us) * 1000 for s, us, *_ in rows]
    shift = time.monotonic_ns() - stamps[-1]
    for stamp, (_, _, identifier, fd, data) in zip(stamps, rows, strict=True):
        can_id = int(identifier, 16) | (0x80000000 if len(identifier) == 8 and not int(identifier, 16) & 0x20000000 else 0) | (0x40000000 if data == "R" else 0)
        yield frame(can_id, b"" if data == "R" else bytes.fromhex(data), stamp + shift, fd=bool(fd))


def feed_can(gateway, folder, expected):
    fd = "##" in (folder / "capture.log").read_text()
    start(gateway, folder, 1, kind="socketpair", descriptor=10, **({"fd": True} if fd else {}))
    messages = list(frames_of((folder / "capture.log").read_text()))
    for message in messages:
        gateway.bus[0].send(message)


def feed_file(gateway, folder, expected):
    start(gateway, folder, kind="replay", file=str(next(folder.glob("capture.*"))), speed=0.0)


class Pty:
    """A serial port under a fixed name; what the daemon writes is taken away."""

    def __init__(self, link):
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        link.symlink_to(os.ttyname(self.slave))
        self.device = str(link)

    def read(self, seconds=0.2):
        return os.read(self.master, 4096) if select.select([self.master], [], [], seconds)[0] else b""


def feed_slcan(gateway, folder, expected):
    port = Pty(gateway.folder / "ttyACM0")
    start(gateway, folder, kind="slcan", device=port.device, bitrate=500000)
    assert b"O\r" in port.read(10)
    data = (folder / "capture.slcan").read_bytes()
    for at in range(0, len(data), 37):  # lines are split anywhere
        os.write(port.master, data[at:at + 37])
        time.sleep(0.004)  # about the pace of the drive


class Script:
    """What the device does at each request: a reply, or first something that goes wrong."""

    def __init__(self, text):
        self.lines, self.lock = text.split("\n")[:-1], threading.Lock()

    def next(self):
        with self.lock:
            return self.lines.pop(0) if self.lines else "silent"


def tcp_reply(line, request):
    """Bytes of the answer, b"" for none, None to close."""
    what, _, rest = line.partition(" ")
    transaction, unit, function = struct.unpack_from(">H", request)[0], request[6], request[7]
    if what in ("silent", "close"):
        return b"" if what == "silent" else None
    pdu = bytes([function | 0x80, int(rest)]) if what == "exception" else bytes.fromhex(rest or what)
    return struct.pack(">HHHB", (transaction + (what == "other")) & 0xFFFF, 0, len(pdu) + 1, unit) + pdu


def feed_modbus_tcp(gateway, folder, expected):
    script = Script((folder / "capture.replies").read_text())
    listener = socket.create_server(("127.0.0.1", 0))

    def serve():
        while True:
            try:
                peer, _ = listener.accept()
            except OSError:
                return
            with peer:
                while len(request := peer.recv(260)) >= 12:
                    if (reply := tcp_reply(script.next(), request)) is None:
                        break
                    peer.sendall(reply)

    threading.Thread(target=serve, daemon=True).start()
    gateway.closing = listener
    start(gateway, folder, kind="modbus_tcp", host="127.0.0.1", port=listener.getsockname()[1])


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return struct.pack("<H", crc)


def feed_modbus_rtu(gateway, folder, expected):
    script, port = Script((folder / "capture.replies").read_text()), Pty(gateway.folder / "ttyUSB0")

    def serve():
        while True:
            try:
                request = port.read(30)
            except OSError:
                return
            if len(request) != 8 or request[6:] != crc16(request[:6]):
                continue
            what, _, rest = script.next().rpartition(" ")
            if rest == "silent":
                continue
            adu = request[:1] + bytes.fromhex(rest)
            os.write(port.master, adu + (b"\0\0" if what == "crc" else crc16(adu)))

    threading.Thread(target=serve, daemon=True).start()
    start(gateway, folder, kind="modbus_rtu", device=port.device)


FEED = {"can": feed_can, "log": feed_file, "drec": feed_file, "slcan": feed_slcan, "modbus_tcp": feed_modbus_tcp, "modbus_rtu": feed_modbus_rtu}


def decoded(path):
    """[(drive, t_ns, {signal: value})] out of the record that the daemon wrote."""
    out = []
    for kind, source, t_ns, payload in drec.entries(path):
        if kind == drec.SAMPLE:
            present = struct.unpack_from("<I", payload)[0]
            names = [name for bit, name in enumerate(drec.SIGNALS) if present >> bit & 1]
            out.append((source, t_ns, dict(zip(names, struct.unpack_from(f"<{len(names)}d", payload, 4), strict=True))))
    return out


def same(a, b):
    """A scale is applied by one multiplication here and there: the last few bits may differ."""
    return abs(a - b) <= 4e-15 * max(abs(a), abs(b), 1e-3)


def test_every_source_and_fault_has_a_session():
    kinds = [json.loads((HERE / name / "expected.json").read_text())["kind"] for name in SESSIONS]
    assert len(SESSIONS) >= 30 and set(kinds) == set(FEED)


@pytest.mark.parametrize("name", SESSIONS)
def test_session(gateway, name):
    expected = json.loads((HERE / name / "expected.json").read_text())
    FEED[expected["kind"]](gateway, HERE / name, expected)
    want = expected["source"]
    status = gateway.until(lambda s: s["sources"][0]["used"] >= want.get("used", len(expected["samples"])) and all(s["sources"][0][k] >= v for k, v in want.items()), 30, f"{want}")
    for key, value in want.items():
        assert status["sources"][0][key] == value, (key, status["sources"][0])
    for key, value in expected["drive"].items():
        assert status["drives"][0][key] == value, (key, status["drives"][0])
    gateway.stop()
    got = decoded(gateway.folder / "out.drec")
    for drive in {row[0] for row in expected["samples"]}:
        mine, theirs = ([row for row in rows if row[0] == drive] for rows in (got, expected["samples"]))
        assert len(mine) == len(theirs), f"{len(mine)} samples of drive {drive}, {len(theirs)} were on the wire"
        for k, ((_, t_ns, values), (_, t_s, wanted)) in enumerate(zip(mine, theirs, strict=True)):
            assert set(values) == set(wanted) and all(same(values[n], wanted[n]) for n in wanted), f"sample {k}: {values}, on the wire {wanted}"
            if t_s is not None:
                assert abs((t_ns - mine[0][1]) * 1e-9 - (t_s - theirs[0][1])) < 2e-9, f"sample {k}: at {t_ns - mine[0][1]} ns"

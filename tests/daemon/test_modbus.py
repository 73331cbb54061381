# SPDX-License-Identifier: Apache-2.0
"""Modbus TCP: pymodbus as an independent device and as an independent client; peers that misbehave on purpose."""
import csv
import io
import math
import socket
import struct
import subprocess
import threading
import time

import pytest
from faults import recovery
from gateway import DAEMON, SOCKETPAIR, Axis, drive, near_truth, parameters
from pymodbus.client import ModbusTcpClient


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Device(threading.Thread):
    """A Modbus TCP device, written from the specification: an axis in its input registers. `mood` makes it misbehave."""

    def __init__(self, port=None, mood="good", dt_s=0.004):
        super().__init__(daemon=True)
        self.mood, self.requests, self.connections = mood, 0, 0
        self.axis, self.axis_start = Axis(dt_s=dt_s), time.monotonic()
        self.listener = socket.socket()
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.listener.bind(("127.0.0.1", port or 0))
        self.listener.listen(8)
        self.port = self.listener.getsockname()[1]
        self.running = True
        self.start()

    def registers(self):
        """Current and angle of the last sample, its number; and, from 12 on, the angle now. All from the exact solution."""
        now = time.monotonic() - self.axis_start
        while (self.axis.k + 1) * self.axis.dt_s <= now:
            self.axis.sample(0)
        i, theta, omega = self.axis.current(), self.axis.theta, self.axis.omega
        sampled = math.floor(theta / (2 * math.pi) * (1 << 20)) & 0xFFFFFFFF
        rest = now - self.axis.k * self.axis.dt_s
        a, end = self.axis.friction / self.axis.inertia, 0.05 * i / self.axis.friction
        theta += end * rest + (omega - end) * (1 - math.exp(-a * rest)) / a
        counts = math.floor(theta / (2 * math.pi) * (1 << 20)) & 0xFFFFFFFF
        return {10: round(i * 1000) & 0xFFFF, 12: counts >> 16, 13: counts & 0xFFFF, 14: self.axis.k & 0xFFFF, 15: sampled >> 16, 16: sampled & 0xFFFF}

    def run(self):
        while self.running:
            try:
                peer, _ = self.listener.accept()
            except OSError:
                return
            self.connections += 1
            threading.Thread(target=self.serve, args=(peer,), daemon=True).start()

    def serve(self, peer):
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        with peer:
            while self.running:
                request = b""
                while len(request) < 12:
                    try:
                        part = peer.recv(12 - len(request))
                    except OSError:
                        return
                    if not part:
                        return
                    request += part
                self.requests += 1
                transaction, _, _, unit, function, address, count = struct.unpack(">HHHBBHH", request)
                values = self.registers()
                body = struct.pack(f">{count}H", *(values.get(address + k, 0) for k in range(count)))
                reply = struct.pack(">HHHBBB", transaction, 0, 3 + len(body), unit, function, len(body)) + body
                mood = self.mood
                try:
                    if mood == "silent":
                        continue
                    if mood == "late":
                        time.sleep(0.6)
                    elif mood == "wrong transaction":
                        reply = struct.pack(">H", transaction ^ 0x5555) + reply[2:]
                    elif mood == "exception":
                        reply = struct.pack(">HHHBBB", transaction, 0, 3, unit, function | 0x80, 2)
                    elif mood == "drip":
                        for byte in reply:
                            peer.sendall(bytes([byte]))
                            time.sleep(0.2)
                        continue
                    elif mood == "garbage":
                        reply = bytes(range(256)) * 4
                    elif mood == "hang up":
                        return
                    elif mood == "short":
                        reply = reply[:-1]
                    elif mood == "other count":
                        reply = struct.pack(">HHHBBBH", transaction, 0, 5, unit, function, 2, 7)
                    peer.sendall(reply)
                except OSError:
                    return

    def stop(self):
        self.running = False
        self.listener.close()


def source(name, port, keys=""):
    return f'[[source]]\nname = "{name}"\nkind = "modbus_tcp"\nhost = "127.0.0.1"\nport = {port}\nunit = 1\npoll_s = 0.004\ntimeout_s = 0.25\n{keys}\n'


def axis(name, bus, keys="", angle=12):
    return f"""
[[drive]]
name = "{name}"
structure = "rigid_axis"
given = {{ K_t_Nm_A = 0.05 }}
dt_s = 0.004
gap_s = 0.2
{keys}
  [[drive.signal]]
  name = "i_A"
  source = "{bus}"
  address = 10
  encoding = "i16"
  scale = 0.001
  hold = "zoh"
  [[drive.signal]]
  name = "theta_rad"
  source = "{bus}"
  address = {angle}
  encoding = "u32"
  counts_per_turn = 1048576
"""


@pytest.fixture
def device():
    made = []

    def make(*arguments, **keywords):
        made.append(Device(*arguments, **keywords))
        return made[-1]

    yield make
    for d in made:
        d.stop()


def test_a_drive_is_identified_over_modbus(gateway, device):
    """Its sample counter is the clock: device, master and this test share a busy machine, and replies are stamped late by milliseconds."""
    plc = device(dt_s=0.01)
    counter = 'paced = true\ncount_s = 0.01\n  [drive.counter]\n  source = "plc"\n  address = 14\n  encoding = "u16"'
    gateway.start(source("plc", plc.port) + axis("axis1", "plc", counter, angle=15), buses=0)
    status = gateway.until(lambda s: all(p["valid"] for p in parameters(s).values()) and abs(parameters(s)["J_kgm2"]["value"] / 2e-4 - 1) < 0.05, 20, "the true inertia over Modbus")
    bus = status["sources"][0]
    assert bus["state"] == "open" and bus["clock"] == "daemon" and bus["frames"] == bus["used"]
    assert plc.connections == 1 and status["drives"][0]["duplicates"] > 0 and status["drives"][0]["dropped"] == 0


@pytest.mark.parametrize("mood", ["silent", "late", "wrong transaction", "exception", "drip", "garbage", "hang up", "short", "other count"])
def test_a_misbehaving_device_is_told_costs_nobody_else_and_comes_back(gateway, device, mood):
    bad, good = device(mood=mood), device()
    gateway.start(source("bad", bad.port) + source("good", good.port) + axis("a", "bad") + axis("b", "good"), buses=0)
    gateway.until(lambda s: s["sources"][1]["frames"] > 50 and s["sources"][0]["errors"] >= 2, 20)
    began, before = time.monotonic(), gateway.status()["sources"][1]["frames"]
    status = gateway.until(lambda s: s["sources"][1]["frames"] > before + 150, 15)
    assert status["sources"][0]["state"] == "down" and status["sources"][0]["last_error"]
    assert status["sources"][0]["frames"] == 0 and not any(p["valid"] for p in parameters(status).values()), "a wrong reply is no value"
    assert time.monotonic() - began < 10
    bad.mood = "good"
    with recovery(f"Modbus peer: {mood}", "replies again"):
        gateway.until(lambda s: s["sources"][0]["state"] == "open" and s["sources"][0]["frames"] > 20, 20, "the device coming back")


def test_refused_connection_and_a_device_that_appears_late(gateway, device):
    port = free_port()
    gateway.start(source("plc", port) + axis("axis1", "plc"), buses=0)
    status = gateway.until(lambda s: s["sources"][0]["errors"] >= 2)
    assert "refused" in status["sources"][0]["last_error"].lower()
    device(port)
    with recovery("Modbus connection refused", "replies"):
        gateway.until(lambda s: s["sources"][0]["frames"] > 20, 15)


def test_words_bytes_and_tables_against_pymodbus_server(gateway, tmp_path):
    """An independent server; signals decoded from all orders must be the numbers that were put in."""
    port = free_port()
    script = tmp_path / "server.py"
    script.write_text(f"""
import asyncio, struct
from pymodbus.server import StartAsyncTcpServer
from pymodbus.simulator import SimData, SimDevice, DataType
value = struct.unpack(">2H", struct.pack(">f", 1.25))
holding = [value[1], value[0], 0, 0, 0x3412, 0x7856] + [0] * 10
asyncio.run(StartAsyncTcpServer(context=SimDevice(id=1, simdata=[SimData(0, values=holding, datatype=DataType.REGISTERS)]), address=("127.0.0.1", {port})))
""")
    import sys
    server = subprocess.Popen([sys.executable, script], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        text = source("plc", port) + """
[record]
folder = "."
file = "a.drec"
[[drive]]
name = "axis1"
structure = "rigid_axis"
dt_s = 0.004
  [[drive.signal]]
  name = "tau_Nm"
  source = "plc"
  table = "holding"
  address = 0
  encoding = "f32"
  word_order = "little"
  [[drive.signal]]
  name = "omega_rad_s"
  source = "plc"
  table = "holding"
  address = 4
  encoding = "u32"
  byte_order = "little"
"""
        gateway.start(text, buses=0, control='write_group = ""')
        control = gateway.control()
        control.ask("subscribe", topics=["sample"])
        event = control.line()
        while event.get("event") != "sample":
            event = control.line()
        assert event["values"] == {"tau_Nm": 1.25, "omega_rad_s": 0x12345678}
    finally:
        server.kill()
        _, error = server.communicate()
        if error and b"Error" in error:
            print(error.decode()[-2000:])


def float_of(high, low):
    return struct.unpack(">f", struct.pack(">HH", high, low))[0]


def test_parameters_are_served_as_the_published_table_says(gateway):
    port = free_port()
    gateway.start(SOCKETPAIR + drive(keys="stale_s = 1000") + f'[[sink]]\nname = "regs"\nkind = "modbus_server"\nport = {port}\nunit = 3\naddress = 100\n')
    gateway.feed(Axis(), 6000)
    status = gateway.settle(6000)
    assert near_truth(status)
    table = subprocess.run([DAEMON, "gw.toml", "--registers", "-"], cwd=gateway.folder, capture_output=True, text=True, check=True).stdout
    rows = {row["name"]: row for row in csv.DictReader(io.StringIO(table))}
    client = ModbusTcpClient("127.0.0.1", port=port)
    assert client.connect()
    for name, p in parameters(status).items():
        value = client.read_input_registers(int(rows[name]["address"]), count=2, device_id=3).registers
        assert math.isclose(float_of(*value), p["value"], rel_tol=1e-6)
        half = client.read_input_registers(int(rows[f"{name}.half_width"]["address"]), count=2, device_id=3).registers
        assert math.isclose(float_of(*half), (p["interval"][1] - p["interval"][0]) / 2, rel_tol=1e-5)
        assert client.read_input_registers(int(rows[f"{name}.valid"]["address"]), count=1, device_id=3).registers == [1]
    for refused in (lambda: client.read_input_registers(99, count=1, device_id=3), lambda: client.read_input_registers(100, count=17, device_id=3),
                    lambda: client.read_holding_registers(100, count=1, device_id=3), lambda: client.write_register(100, 1, device_id=3),
                    lambda: client.read_coils(100, count=1, device_id=3), lambda: client.read_input_registers(100, count=1, device_id=1)):
        assert refused().isError()
    client.close()


def test_hostile_clients_of_the_server(gateway):
    import random

    port = free_port()
    gateway.start(SOCKETPAIR + drive() + f'[[sink]]\nname = "regs"\nkind = "modbus_server"\nport = {port}\nclients = 4\n')
    rng = random.Random(3)

    def connect():
        s = socket.create_connection(("127.0.0.1", port), timeout=5)
        return s

    for _ in range(60):
        with connect() as s:
            try:
                s.sendall(rng.choice([rng.randbytes(rng.randrange(1, 400)), struct.pack(">HHHBBHH", 1, 0, 6, 1, 4, rng.randrange(65536), rng.randrange(65536)),
                                      struct.pack(">HHHBB", 1, 0, rng.randrange(65536), 1, rng.randrange(256))]))
            except OSError:
                pass
    held = []
    for _ in range(4):
        held.append(connect())
        held[-1].sendall(b"\0\1\0\0\0\6")                       # half a request, and silence
    time.sleep(0.3)
    gateway.feed(Axis(), 1000)
    gateway.settle(1000)
    for s in held:
        s.close()
    time.sleep(0.2)
    client = ModbusTcpClient("127.0.0.1", port=port)
    assert client.connect() and not client.read_input_registers(0, count=4, device_id=1).isError()
    client.close()


def test_metrics_page(gateway):
    import urllib.error
    import urllib.request

    port = free_port()
    gateway.start(SOCKETPAIR + drive(keys="stale_s = 1000") + f'[system]\nmetrics = "127.0.0.1:{port}"\n')
    gateway.feed(Axis(), 6000)
    gateway.settle(6000)
    page = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10).read().decode()
    lines = dict(line.rsplit(" ", 1) for line in page.splitlines())
    assert float(lines['driveid_source_used_total{source="bus"}']) == 6000
    assert abs(float(lines['driveid_parameter{drive="axis1",parameter="J_kgm2"}']) / 2e-4 - 1) < 0.05
    with pytest.raises(urllib.error.HTTPError):
        urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=10)

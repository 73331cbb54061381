# SPDX-License-Identifier: Apache-2.0
"""Serial ports over a pty: an slcan adapter that stutters, is unplugged and comes back; Modbus RTU units on one line."""
import os
import select
import struct
import termios
import threading
import time
import tty

import pytest
from faults import recovery
from gateway import Axis, drive
from test_shim import SHIM


class Port:
    """One end of a pty under a fixed name, as a USB adapter has it."""

    def __init__(self, link):
        self.link, self.master = link, None
        self.plug()

    def plug(self):
        self.master, slave = os.openpty()
        tty.setraw(slave, termios.TCSANOW)
        name = os.ttyname(slave)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(name)
        self.slave = slave                       # kept open until the daemon has it, so that nothing hangs up

    def ready(self):
        os.close(self.slave)

    def unplug(self):
        os.close(self.master)
        self.link.unlink()

    def write(self, data):
        while data:
            data = data[os.write(self.master, data[:512]):]

    def read(self, seconds=5.0):
        return os.read(self.master, 4096) if select.select([self.master], [], [], seconds)[0] else b""


def slcan(device):
    return f'[[source]]\nname = "bus"\nkind = "slcan"\ndevice = "{device}"\nbitrate = 250000\n'


def lines(axis, n):
    for message in axis.frames(n, 0):
        yield b"t1816" + message[8:14].hex().upper().encode() + b"\r"


def test_slcan_adapter(gateway, tmp_path):
    port = Port(tmp_path / "ttyACM0")
    gateway.start(slcan(port.link) + drive() + '[[sink]]\nname = "out"\nkind = "can"\nsource = "bus"\ndrive = "axis1"\ncan_id = 0x5A0\nperiod_s = 0.05\n', buses=0)
    assert port.read().startswith(b"C\rS5\rO\r")
    port.ready()
    assert gateway.until(lambda s: s["sources"][0]["state"] == "open")
    axis = Axis()
    good = list(lines(axis, 300))
    # Lines split anywhere, answers of the adapter, garbage, a bell, a line without end.
    text = b"z\r" + b"".join(good[:100]) + b"V1013\r" + b"t18\r" + b"\xff\xfe\x00\r" + b"t1816ZZ\r" + b"\a" + b"x" * 500 + b"\r" + b"".join(good[100:])
    for at in range(0, len(text), 37):
        port.write(text[at:at + 37])
        if at % 1000 < 37:
            time.sleep(0.005)
    source = gateway.until(lambda s: s["sources"][0]["used"] >= 300)["sources"][0]
    assert (source["used"], source["rejected"]) == (300, 5) and source["frames"] == 305
    assert source["clock"] == "daemon"
    sent = port.read()
    assert b"t5A08" in sent and b"t5A18" in sent
    port.unplug()
    gateway.until(lambda s: s["sources"][0]["state"] != "open", 10, "the unplugged adapter being noticed")
    port.plug()
    with recovery("adapter unplugged and replugged (pty hang-up)", "frames again"):
        gateway.until(lambda s: s["sources"][0]["state"] == "open", 15, "the adapter coming back")
        port.ready()
        port.write(b"".join(lines(axis, 50)))
        gateway.until(lambda s: s["sources"][0]["used"] >= 350)


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


class Units(threading.Thread):
    """Modbus RTU devices on one line, from the specification. Dead ones do not answer."""

    def __init__(self, port, alive):
        super().__init__(daemon=True)
        self.port, self.alive, self.asked, self.gaps, self.running = port, alive, {}, [], True
        self.start()

    def run(self):
        buffer, last = b"", 0.0
        while self.running:
            if not select.select([self.port.master], [], [], 0.1)[0]:
                buffer = b""
                continue
            try:
                buffer += os.read(self.port.master, 256)
            except OSError:
                return
            if len(buffer) < 8:
                continue
            request, buffer = buffer[:8], b""
            unit, function, address, count = struct.unpack(">BBHH", request[:6])
            if request[6:] != crc16(request[:6]):
                continue
            self.gaps.append(time.monotonic() - last)
            self.asked[unit] = self.asked.get(unit, 0) + 1
            if unit in self.alive:
                body = struct.pack(">BBB", unit, function, 2 * count) + struct.pack(f">{count}H", *(unit * 100 + address + k for k in range(count)))
                last = time.monotonic()
                os.write(self.port.master, body + crc16(body))


def rtu(name, device, unit):
    return f'[[source]]\nname = "{name}"\nkind = "modbus_rtu"\ndevice = "{device}"\nbaud = 19200\nunit = {unit}\npoll_s = 0.02\ntimeout_s = 0.1\n'


def axis(name, source):
    return f"""
[[drive]]
name = "{name}"
structure = "rigid_axis"
dt_s = 0.02
  [[drive.signal]]
  name = "tau_Nm"
  source = "{source}"
  address = 5
  [[drive.signal]]
  name = "omega_rad_s"
  source = "{source}"
  address = 6
"""


def test_one_dead_unit_does_not_starve_the_others(gateway, tmp_path):
    port = Port(tmp_path / "ttyUSB0")
    units = Units(port, alive={1, 3})
    gateway.start("".join(rtu(f"u{k}", port.link, k) + axis(f"a{k}", f"u{k}") for k in (1, 2, 3)), buses=0)
    port.ready()
    began = {1: 0, 3: 0}
    gateway.until(lambda s: s["sources"][0]["frames"] > 5 and s["sources"][2]["frames"] > 5)
    began = dict(units.asked)
    time.sleep(3)
    asked = {k: units.asked[k] - began.get(k, 0) for k in units.asked}
    # At 50 polls a second 3 s are 150; the dead one costs its time-out of 0.1 s, ever more seldom.
    assert asked[1] > 60 and asked[3] > 60 and asked.get(2, 0) <= 10, asked
    status = gateway.status()
    assert status["sources"][1]["state"] == "down" and status["sources"][1]["frames"] == 0
    assert status["sources"][0]["frames"] == status["sources"][0]["used"]
    after_reply = [g for g in units.gaps[10:] if g < 1]
    assert min(after_reply) > 38.5 / 19200 * 0.95, "3.5 characters of silence before each request"
    units.alive.add(2)
    with recovery("dead unit on a Modbus RTU line", "replies again"):
        gateway.until(lambda s: s["sources"][1]["frames"] > 5, 15)
    units.running = False
    control = gateway.control()
    assert control.ask("status")["ok"]


def test_a_missing_port_is_told_and_found_later(gateway, tmp_path):
    link = tmp_path / "ttyUSB9"
    gateway.start(rtu("u1", link, 1) + axis("a", "u1"), buses=0)
    assert gateway.until(lambda s: s["sources"][0]["errors"] >= 1)["sources"][0]["last_error"]
    port = Port(link)
    units = Units(port, alive={1})
    with recovery("serial port missing", "replies"):
        gateway.until(lambda s: s["sources"][0]["frames"] > 5, 15)
    port.ready()
    units.running = False


def test_rs485_mode_is_asked_of_the_port(gateway, tmp_path):
    """A pseudo terminal has none, and says so; with one that takes it (tests/daemon/shim.c) the mode is on and the device is polled."""
    port = Port(tmp_path / "ttyUSB0")
    units = Units(port, alive={1})
    text = rtu("u1", port.link, 1).replace("poll_s", "rs485 = true\npoll_s") + axis("a", "u1")
    gateway.start(text, buses=0)
    refused = gateway.until(lambda s: s["sources"][0]["errors"] >= 1)["sources"][0]
    assert "RS-485" in refused["last_error"] and "remove rs485" in refused["last_error"] and refused["frames"] == 0
    assert gateway.stop() == 0
    if "DRIVEIDD" not in os.environ:
        gateway.start(text, buses=0, env={"LD_PRELOAD": str(SHIM), "DRIVEID_SHIM_RS485": str(tmp_path / "flags")})
        gateway.until(lambda s: s["sources"][0]["frames"] > 5)
        assert struct.unpack("<I", (tmp_path / "flags").read_bytes())[0] & 1, "SER_RS485_ENABLED"
    units.running = False


SPEEDS = [9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600, 1000000, 2000000, 3000000]


def test_the_line_has_the_speed_of_the_configuration(gateway, tmp_path):
    ports = {baud: Port(tmp_path / f"tty{baud}") for baud in SPEEDS}
    sources = "".join(slcan(port.link).replace('"bus"', f'"b{baud}"') + f"baud = {baud}\n" for baud, port in ports.items())
    gateway.start(sources + drive(source="b9600"), buses=0)
    gateway.until(lambda s: all(source["state"] == "open" for source in s["sources"]))
    for baud, port in ports.items():
        assert termios.tcgetattr(port.master)[4:6] == [getattr(termios, f"B{baud}")] * 2, baud


def test_a_speed_that_no_line_has_is_told(gateway, tmp_path):
    port = Port(tmp_path / "ttyACM0")
    gateway.start(slcan(port.link) + "baud = 12345\n" + drive(), buses=0)
    told = gateway.until(lambda s: s["sources"][0]["last_error"])["sources"][0]
    assert "baud 12345 is not supported" in told["last_error"] and told["state"] == "closed"


@pytest.mark.skipif("DRIVEIDD" in os.environ, reason="SKIPPED BECAUSE sanitizers bring their own allocator")
def test_an_adapter_that_takes_no_bytes_is_told_and_tried_again(gateway, tmp_path):
    port = Port(tmp_path / "ttyACM0")
    gateway.start(slcan(port.link) + drive(), buses=0, env={"LD_PRELOAD": str(SHIM), "DRIVEID_SHIM_DEAF": "1"})
    told = gateway.until(lambda s: s["sources"][0]["last_error"])["sources"][0]
    assert "takes no bytes" in told["last_error"] and told["state"] == "closed"


@pytest.mark.parametrize("bitrate", [1, 300000])
def test_impossible_rates_are_refused(tmp_path, bitrate):
    import subprocess

    from gateway import DAEMON

    (tmp_path / "a.toml").write_text(slcan("/dev/x").replace("250000", str(bitrate)) + drive())
    done = subprocess.run([DAEMON, "--check", "a.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2 and "bitrate" in done.stderr

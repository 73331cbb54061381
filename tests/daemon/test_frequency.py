# SPDX-License-Identifier: Apache-2.0
"""Method "frequency": the ripple of a simulated spindle's current (cogging: its order times the speed), over the socketpair seam and in a replayed record."""
import csv
import json
import math
import os
import struct
import subprocess
import time
import tomllib
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient

from driveid import online
from gateway import DAEMON, ROOT, SLOW, SOCKETPAIR, frame, parameters
from test_modbus import free_port

SIM = Path(os.environ.get("DRIVEID_BUILD", ROOT / "build")) / "tools/sim/driveid-sim"

DRIVE = """
[record]
folder = "."
file = "run.drec"
{source}
[[drive]]
name = "ripple"
method = "frequency"
highest_Hz = {highest}
type = "{type}"
dt_s = 0.001
stale_s = 60
  [[drive.signal]]
  name = "i_q_A"
  source = "bus"
  can_id = {can_id}
  start_bit = {start_bit}
  length = {length}
  signed = true
  scale = {scale}
  range = 64
"""

SINKS = """
[system]
metrics = "127.0.0.1:{metrics}"
[[sink]]
name = "out"
kind = "can"
source = "bus"
drive = "ripple"
can_id = 0x5A0
[[sink]]
name = "regs"
kind = "modbus_server"
port = {modbus}
"""


class Spindle:
    """A drive of the simulator that turns at two speeds, 10 s each, and rests then; f, amplitude: of the current's ripple at each speed."""

    def __init__(self, folder, seed):
        if not SIM.exists():
            pytest.skip(f"SKIPPED BECAUSE {SIM} is not built")
        path = {k: folder / f"sim.{k}" for k in ("log", "json", "csv", "toml")}
        subprocess.run([SIM, "run", "--bus", f"log:{path['log']}", "--seed", str(seed), "--program", "steady", "--duration", "25", "--effect", "cogging",
                        "--truth", path["json"], "--csv", path["csv"], "--config", path["toml"]], check=True, capture_output=True, timeout=60)
        self.signal = next(s for s in tomllib.loads(path["toml"].read_text())["drive"][0]["signal"] if s["name"] == "i_q_A")
        order = next(p["value"] for p in json.loads(path["json"].read_text())["phases"][-1]["effects"][0]["parameters"] if p["name"] == "N")
        with open(path["csv"]) as f:
            rows = [(float(r["t_s"]), float(r["i_q_A"]), float(r["theta_rad"])) for r in csv.DictReader(f)]
        t, i, theta = np.array(rows).T
        self.f, self.amplitude = [], []
        for start in (3, 13):
            part = (t > start) & (t < start + 6.8)
            self.f.append(abs(order * np.polyfit(t[part], theta[part], 1)[0]) / (2 * math.pi))
            columns = np.c_[np.ones(part.sum()), np.cos(order * theta[part]), np.sin(order * theta[part])]
            self.amplitude.append(float(np.hypot(*np.linalg.lstsq(columns, i[part], rcond=None)[0][1:])))
        self.data = [bytes.fromhex(line.split("#")[1]) for line in path["log"].read_text().splitlines() if int(line.split()[2].split("#")[0], 16) == self.signal["can_id"]]

    def config(self, type="f64"):
        return DRIVE.format(source=SOCKETPAIR, type=type, highest=round(1.6 * max(self.f)), **{k: self.signal[k] for k in ("can_id", "start_bit", "length", "scale")})

    def frames(self, first_s, last_s, start_ns):
        for k in range(round(1000 * first_s), round(1000 * last_s)):
            yield frame(self.signal["can_id"], self.data[k], start_ns + 1_000_000 * k)


def close(shown, name, truth, share):
    """Valid, within its interval and a half, and no further off than a share of the truth (the fit's own finite record, a few harmonics)."""
    p = shown[name]
    half = 0.5 * (p["interval"][1] - p["interval"][0])
    return p["valid"] and abs(p["value"] - truth) <= min(1.5 * half + 0.002 * truth, share * truth)


@pytest.mark.parametrize("seed,type", [(2, "f64"), (3, "f32"), (4, "f64"), (4, "q31")])
def test_a_spindle_is_followed(gateway, seed, type):
    """Two speeds, each with its frequency and amplitude; nothing is valid once it rests, nor across a gap."""
    spindle = Spindle(gateway.folder, seed)
    gateway.start(spindle.config(type))
    start_ns = time.monotonic_ns() - 30_000_000_000
    restarts = []
    for k, (first_s, last_s) in enumerate(((0, 9.5), (9.5, 19.5))):
        for message in spindle.frames(first_s, last_s, start_ns):
            gateway.bus[0].send(message)
        status = gateway.settle(round(1000 * last_s))
        shown = parameters(status)
        assert list(shown) == ["f1_Hz", "amplitude1_A"] and shown["f1_Hz"]["unit"] == "Hz" and shown["amplitude1_A"]["unit"] == "A"
        assert close(shown, "f1_Hz", spindle.f[k], 0.02), (shown, spindle.f[k])
        assert close(shown, "amplitude1_A", spindle.amplitude[k], 0.15), (shown, spindle.amplitude[k])
        drive = status["drives"][0]
        assert drive["state"] == "valid" and drive["structure"] == "sinusoids" and drive["method"] == "frequency" and drive["type"] == type and drive["residual"]["unit"] == "A"
        restarts.append(drive["restarts"])
    assert restarts[0] == 0 and restarts[1] >= 1
    for message in spindle.frames(19.5, 24, start_ns):
        gateway.bus[0].send(message)
    status = gateway.settle(24000)
    assert not any(p["valid"] for p in parameters(status).values()) and status["drives"][0]["state"] == "identifying"
    assert [p["name"] for p in status["drives"][0]["parameters"]] == ["f1_Hz", "amplitude1_A"]


def test_sinks_metrics_and_the_record(gateway):
    """The sinusoids leave by every door that a parameter has, and the record gives them again in Python, bit for bit."""
    spindle = Spindle(gateway.folder, 4)
    metrics, modbus = free_port(), free_port()
    gateway.start(spindle.config() + SINKS.format(metrics=metrics, modbus=modbus))
    for message in spindle.frames(0, 9.5, time.monotonic_ns() - 9_500_000_000):
        gateway.bus[0].send(message)
    shown = parameters(gateway.settle(9500))
    gateway.drain()
    sent = {}
    while len(sent) < 2:
        can_id, data = struct.unpack_from("<I4x8s", gateway.bus[0].recv(100))
        sent[can_id] = (struct.unpack_from("<f", data)[0], data[6] & 1)
    assert sent == {0x5A0: (np.float32(shown["f1_Hz"]["value"]), 1), 0x5A1: (np.float32(shown["amplitude1_A"]["value"]), 1)}
    page = urllib.request.urlopen(f"http://127.0.0.1:{metrics}/metrics", timeout=10 * SLOW).read().decode()
    line = next(line for line in page.splitlines() if line.startswith('driveid_parameter{drive="ripple",parameter="f1_Hz"}'))
    assert float(line.split()[1]) == shown["f1_Hz"]["value"]
    with ModbusTcpClient("127.0.0.1", port=modbus) as client:
        registers = client.read_input_registers(4, count=6, device_id=1).registers
    assert struct.unpack(">f", struct.pack(">HH", *registers[:2]))[0] == np.float32(shown["f1_Hz"]["value"]) and registers[4] == 1
    dbc = subprocess.run([DAEMON, "gw.toml", "--dbc", "-"], cwd=gateway.folder, capture_output=True, text=True, timeout=60, check=True).stdout
    assert "ripple_f1_Hz" in dbc and "ripple_amplitude1_A" in dbc
    assert gateway.stop() == 0
    result, check = online.replay_drec(gateway.folder / "run.drec")
    assert check.compared >= 100 and check.identical == check.compared
    assert result.final()["f1_Hz"][0] == shown["f1_Hz"]["value"]


@pytest.mark.parametrize("line,words", [
    ('structure = "rigid_axis"', "structure: does not belong to method"), ("effects = ['coulomb']", "effects: does not belong"), ("bandwidth_rad_s = 5", "bandwidth_rad_s: method"),
    ("highest_Hz = 0", "highest_Hz: is missing"), ("highest_Hz = 300", "fifth of the sampling rate"), ("sinusoids = 3", "sinusoids"), ('method = "fsm"', "structure"), ('type = "q31"', "range")])
def test_what_cannot_be_is_said(tmp_path, line, words):
    text = DRIVE.format(source=SOCKETPAIR, type="f64", highest=20, can_id=0x181, start_bit=0, length=16, scale=0.001).replace("  range = 64\n", "")
    key = line.split()[0]
    text = "".join(l for l in text.splitlines(True) if not l.startswith(key + " ")).replace('name = "ripple"\n', f'name = "ripple"\n{line}\n')
    (tmp_path / "gw.toml").write_text(text)
    done = subprocess.run([DAEMON, "--check", "gw.toml"], cwd=tmp_path, capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL)
    assert done.returncode != 0 and words in done.stdout + done.stderr, done.stdout + done.stderr

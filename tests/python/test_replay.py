# SPDX-License-Identifier: Apache-2.0
"""The daemon's numbers, bit for bit: driveidd replays a candump log and records; Python repeats it from the record."""

import json
import os
import signal
import subprocess
import time

import numpy as np
import pytest

from conftest import drive
from driveid import online
from driveid.client import Client, GatewayError

CONFIG = """format = 1
[control]
socket = "{folder}/c.sock"
[record]
folder = "{folder}"
file = "out.drec"
[security]
seccomp = "off"
[[source]]
name = "file"
kind = "replay"
file = "run.log"
speed = 0
[[drive]]
name = "axis1"
structure = "rigid_axis"
given = {{ K_t_Nm_A = 0.05 }}
effects = ["coulomb"]
method = "{method}"
type = "{type}"
dt_s = 0.001
  [[drive.signal]]
  name = "i_A"
  range = 16
  source = "file"
  can_id = 0x181
  start_bit = 0
  length = 16
  signed = true
  scale = 0.0005
  [[drive.signal]]
  name = "theta_rad"
  range = 100
  source = "file"
  can_id = 0x181
  start_bit = 16
  length = 24
  counts_per_turn = 65536
"""


def candump(path):
    columns = drive(6.0)
    lines = []
    for t, i, theta in zip(columns["t_s"], columns["i_A"], columns["theta_rad"]):
        raw = int(round(i / 0.0005)).to_bytes(2, "little", signed=True) + (int(np.floor(theta * 65536 / (2 * np.pi))) % (1 << 24)).to_bytes(3, "little")
        lines.append(f"({1_700_000_000 + t:.6f}) can0 181#{raw.hex().upper()}")
    path.write_text("\n".join(lines) + "\n")


def test_filters_suggested_for_a_motion(tmp_path, daemon):
    """motion_rad_s: the estimator runs with the pole that `driveid suggest` offers, in the daemon and again in Python; what cannot be is said before it starts."""
    candump(tmp_path / "run.log")
    estimates = []
    for name, line in (("asked", "motion_rad_s = 12"), ("given", "bandwidth_rad_s = 48")):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "run.log").write_bytes((tmp_path / "run.log").read_bytes())
        (folder / "gw.toml").write_text(CONFIG.format(folder=folder, method="fsm", type="f64").replace("dt_s = 0.001\n", f"dt_s = 0.001\n{line}\n", 1))
        process = subprocess.Popen([daemon, str(folder / "gw.toml")], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
        try:
            estimates.append(wait_for_samples(folder, process, 6000)["drives"][0]["parameters"])
        finally:
            process.send_signal(signal.SIGTERM)
            assert process.wait(10) == 0
        _, check = online.replay_drec(folder / "out.drec")
        assert check.compared >= 80 and check.identical == check.compared  # of 6 s; the filters are slow, and values count from when they are confirmed
    assert estimates[0] == estimates[1]
    (tmp_path / "slow.toml").write_text(CONFIG.format(folder=tmp_path, method="fsm", type="f64").replace("dt_s = 0.001\n", "dt_s = 0.1\nmotion_rad_s = 30\n", 1))
    done = subprocess.run([daemon, str(tmp_path / "slow.toml")], cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=60)
    assert done.returncode != 0 and "motion_rad_s" in done.stderr and "sample" in done.stderr


@pytest.mark.parametrize(("method", "type", "model_file"), [
    ("fsm", "f64", False), ("fsm", "f32", False), ("fsm", "f64", True), ("fsm", "q31", False), ("window", "f64", False), ("discrete", "q31", False), ("rls", "q31", False),
    ("kalman", "f32", False)])
def test_python_repeats_the_daemon(tmp_path, daemon, driveid, method, type, model_file):
    """A model file stands in the record: it need not be there when the record is replayed."""
    candump(tmp_path / "run.log")
    config = CONFIG.format(folder=tmp_path, method=method, type=type)
    if model_file:
        lines = [line for line in config.splitlines() if not line.startswith(("structure =", "given ="))]
        lines.insert(lines.index("[[drive]]") + 1, 'model = "axis.toml"')
        config = "\n".join(lines) + "\n"
        assert driveid("model", "new", "rigid_axis", "--given", "K_t_Nm_A=0.05", "-o", tmp_path / "axis.toml")[0] == 0
    (tmp_path / "gw.toml").write_text(config)
    with open(tmp_path / "daemon.log", "w") as log:
        process = subprocess.Popen([daemon, str(tmp_path / "gw.toml")], cwd=tmp_path, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
    try:
        status = wait_for_samples(tmp_path, process, 6000)
    finally:
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0, (tmp_path / "daemon.log").read_text()
    (tmp_path / "axis.toml").unlink(missing_ok=True)
    result, check = online.replay_drec(tmp_path / "out.drec")
    assert check.compared >= 100 and check.identical == check.compared, f"worst relative difference {check.worst}"
    told = {p["name"]: p for p in status["drives"][0]["parameters"]}
    for name, (value, lo, hi, valid) in result.final().items():
        assert told[name]["value"] == value and told[name]["interval"] == [lo, hi] and told[name]["valid"] == valid
    assert result.final()["J_kgm2"][0] == pytest.approx(2.0e-4, rel=0.05)
    code, out, err = driveid("replay", tmp_path / "out.drec", "--json", "-")
    document = json.loads(out)
    assert code == 0 and document["identical"] == document["compared"] == check.compared and document["samples"] == 6000


def wait_for_samples(folder, process, wanted):
    end = time.monotonic() + 30
    while time.monotonic() < end:
        assert process.poll() is None, (folder / "daemon.log").read_text()
        try:
            with Client(folder / "c.sock") as client:
                status = client.status()
            if status["drives"][0]["samples"] >= wanted:
                return status
        except GatewayError:
            pass
        time.sleep(0.05)
    raise AssertionError(f"{os.listdir(folder)}: the daemon did not read the log\n" + (folder / "daemon.log").read_text())

# SPDX-License-Identifier: Apache-2.0
"""Angles of a DBC: the imported configuration, run by the daemon over the frames of a turning axis, gives the angle that was turned."""

import math
import subprocess
import tomllib

import numpy as np
import pytest

import driveid
from driveid import dbc_import

DBC = """VERSION ""
BU_: d
BO_ 385 axis: 8 d
 SG_ i_q_A : 0|16@1- (0.001,0) [0|0] "A" d
 SG_ angle : 16|{length}@1{sign} ({scale},{offset}) [{range}] "{unit}" d
"""


def imported(folder, unit="deg", scale="0.1", range="0|359.9", length=16, sign="+", offset="0", as_unit=""):
    (folder / "d.dbc").write_text(DBC.format(length=length, sign=sign, scale=scale, offset=offset, range=range, unit=unit))
    mapped = f":{as_unit}" if as_unit else ""
    text, notices = dbc_import.from_dbc(folder / "d.dbc", [f"theta_rad=angle{mapped}"], interface="can0", structure="rigid_axis", drive="axis1", dt_s=0.001)
    signals = {s["name"]: s for s in tomllib.loads(text)["drive"][0]["signal"]}
    return text, signals["theta_rad"], " ".join(notices)


def turned(folder, daemon, text, truth_rad, raw):
    """Angle and truth, both from their first sample on."""
    lines = [f"({1_700_000_000 + 0.001 * k:.6f}) can0 181#0000{int(r & 0xFFFFFFFF).to_bytes(4, 'little').hex()}" for k, r in enumerate(raw)]
    (folder / "a.log").write_text("\n".join(lines) + "\n")
    text = text.replace('kind = "socketcan"\ninterface = "can0"', 'kind = "replay"\nfile = "a.log"\nspeed = 0.0').replace("/var/lib/driveid/records", str(folder))
    text = text.replace("/run/driveid/control.sock", str(folder / "c.sock")).replace("[record]\n", '[record]\nfile = "out.drec"\n')
    (folder / "run.toml").write_text(text)
    done = subprocess.run([daemon, "run.toml", "--exit-at-end"], cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    measured = driveid.read(folder / "out.drec")["theta_rad"]
    assert len(measured) == len(raw), "no sample is refused"
    return measured - measured[0], truth_rad - truth_rad[0]


@pytest.mark.parametrize("unit, scale, range, sign, offset, wrap", [
    ("deg", "0.1", "0|359.9", "+", "0", 3600), ("deg", "0.1", "0|360", "+", "0", 3600), ("deg", "0.01", "0|359.99", "+", "0", 36000), ("deg", "0.01", "0|0", "+", "0", 36000),
    ("deg", "0.1", "-180|179.9", "-", "0", 3600), ("deg", "0.1", "-180|179.9", "+", "-180", 3600), ("rad", "0.0001", "0|6.2831", "+", "0", 62832), ("rad", "0.001", "0|6.283", "+", "0", 6284),
    ("deg", "0.0054931640625", "0|359.99", "+", "0", 65536), ("deg", "0.00549316", "0|0", "+", "0", 65536), ("deg", "0.1", "0|3599.9", "+", "0", 36000),
])
def test_a_turning_axis_is_read_as_it_turned(tmp_path, daemon, unit, scale, range, sign, offset, wrap):
    """Out four turns and a half, and back beyond the start."""
    text, signal, _ = imported(tmp_path, unit, scale, range, sign=sign, offset=offset)
    assert signal["wrap_counts"] == wrap
    t = np.arange(2000) * 1e-3
    truth = 28.5 * np.sin(2 * math.pi * 0.6 * t)
    turn = 2 * math.pi if unit == "rad" else 360.0
    span = 10 * turn if range == "0|3599.9" else turn
    least = -turn / 2 if "-180" in (offset, range[:4]) else 0.0
    angle = (truth * turn / (2 * math.pi) - least) % span + least
    raw = np.floor((angle - float(offset)) / float(scale) + 1e-9).astype(int)
    if unit == "deg":
        raw = np.minimum(raw, round((least + span - float(offset)) / float(scale)) - 1)
    measured, truth = turned(tmp_path, daemon, text, truth, raw & 0xFFFF)
    count = 2 * math.pi / turn * float(scale)
    assert np.abs(measured - truth).max() < 8 * count
    table = driveid.read(tmp_path / "a.log", ["theta_rad=angle"], dbc=[tmp_path / "d.dbc"])["theta_rad"]  # off-line, from the same frames
    assert np.abs(table - table[0] - truth).max() < 8 * count


def test_what_does_not_turn_does_not_wrap(tmp_path):
    _, signal, _ = imported(tmp_path, range="-90|90", sign="-")   # a pedal
    assert "wrap_counts" not in signal
    _, signal, _ = imported(tmp_path, range="-780|779.9", sign="-")  # a steering wheel
    assert "wrap_counts" not in signal
    _, signal, _ = imported(tmp_path, range="0|0", length=8)   # 25.6 degrees at most
    assert "wrap_counts" not in signal


def test_what_the_dbc_leaves_open_is_said(tmp_path):
    _, signal, err = imported(tmp_path, scale="0.01", range="0|0")
    assert signal["wrap_counts"] == 36000 and "gives no range" in err and "wrap_counts = 65536" in err
    _, signal, err = imported(tmp_path, scale="0.01", range="0|655.35")  # what 16 bits hold: no range either
    assert signal["wrap_counts"] == 36000 and "gives no range" in err
    _, signal, err = imported(tmp_path, unit="", scale="1", range="0|0", length=32, as_unit="counts/10000")
    assert signal["wrap_counts"] == 1 << 32 and "2^32" in err and "wrap_counts = 10000" in err
    _, signal, err = imported(tmp_path, unit="", scale="1", range="0|9999", length=32, as_unit="counts/10000")
    assert signal["wrap_counts"] == 10000 and "wrap" not in err
    _, signal, err = imported(tmp_path, unit="", scale="1", range="0|0", length=20, as_unit="counts/4096")
    assert signal["wrap_counts"] == 1 << 20 and "wrap" not in err
    _, signal, err = imported(tmp_path, unit="rad", scale="0.001", range="0|6.283")
    assert "no whole number" in err

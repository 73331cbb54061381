# SPDX-License-Identifier: Apache-2.0
"""A circuit logged at 1 kHz, about once in its time constant, nobody telling whether its columns are instants or means over the sample: half a sample
off passes for a tenth of the resistance, and the intervals must allow for it. Drives of tools/sim whose columns differ in just that."""

import json
import os
import subprocess
from pathlib import Path

import driveid
import pytest

SIM = Path(os.environ.get("DRIVEID_BUILD") or Path(__file__).resolve().parents[2] / "build") / "tools/sim/driveid-sim"


@pytest.mark.parametrize("seed", [1, 3, 7])   # means, means with a balance whose inductance is negative, means of a small winding
def test_a_circuit_read_once_in_its_time_constant_knows_how_little_it_knows(tmp_path, seed):
    if not SIM.is_file():
        pytest.skip(f"driveid-sim is not built ({SIM}): run tools/setup, or set DRIVEID_BUILD")
    subprocess.run([SIM, "case", "--seed", str(seed), "--structure", "dc_circuit", "--effect", "none", "--rate", "1000", "--train-s", "12", "--held-out-s", "2",
                    "--out", tmp_path / "case", "--truth", tmp_path / "truth.json"], check=True, capture_output=True, timeout=120)
    truth = json.loads((tmp_path / "truth.json").read_text())["drive"]
    found = driveid.fit(driveid.Model.new("dc_circuit"), driveid.read(tmp_path / "case" / "train.csv")).document["parameters"]
    for name in ("R_ohm", "K_e_Vs_rad"):
        lo, hi = found[name]["interval"]
        half = (hi - lo) / 2
        assert abs(found[name]["value"] - truth[name]) < 3 * half, name   # six standard deviations; without the allowance 8 to 90 half-widths
        assert half < 0.3 * truth[name], name

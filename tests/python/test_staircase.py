# SPDX-License-Identifier: Apache-2.0
"""The error that explain promises falls in simulation too, where the effect sits in one equation of two: a winding that warms up,
sampled several times in its electrical time constant of 1.4 ms."""

import os
import shutil
import subprocess
from pathlib import Path

import driveid
import pytest

SIM = Path(os.environ.get("DRIVEID_BUILD") or Path(__file__).resolve().parents[2] / "build") / "tools/sim/driveid-sim"


def test_free_run_falls_with_the_effect_that_explain_names(tmp_path):
    if not SIM.is_file() and not shutil.which(str(SIM)):
        pytest.skip(f"driveid-sim is not built ({SIM}): run tools/setup, or set DRIVEID_BUILD")
    subprocess.run([SIM, "case", "--seed", "991", "--structure", "dc_drive", "--effect", "resistance_drift", "--size", "3", "--rate", "4000", "--train-s", "10", "--held-out-s", "6", "--out", tmp_path / "case", "--truth", tmp_path / "truth.json"],
                   check=True, capture_output=True, timeout=120)
    training, held_out = (driveid.read(tmp_path / "case" / name) for name in ("train.csv", "held_out.csv"))
    model = driveid.fit(driveid.Model.new("dc_drive"), training).model
    answer = driveid.explain(model, training, held_out=held_out)
    assert answer.ranked[0].effect == "resistance_drift" and answer.ranked[0].accepted
    for side in ("training", "held_out"):
        before, after = (answer.document[which][side]["free_run"]["rmse"] for which in ("error_before", "error_after"))
        assert after < 0.5 * before, (side, before, after)  # a drift of three times the noise carries more than half of the drift of the angle
    as_given = driveid.compare(model, training).document["records"][0]["free_run"]["rmse"]
    assert answer.document["error_before"]["training"]["free_run"]["rmse"] == pytest.approx(as_given, rel=1e-6)
    for before in answer.document["error_before"].values():  # as far from its floor as the balance is: an error that an effect makes is not the floor's
        balance, free = before["equation"], before["free_run"]
        assert free["noise_floor"][1] / free["rmse"] == pytest.approx(balance["noise_floor"][1] / balance["rmse"], rel=0.05)

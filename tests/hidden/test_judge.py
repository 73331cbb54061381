# SPDX-License-Identifier: Apache-2.0
"""The judge itself, on made-up answers, and the generator's cases, by an own regression in numpy."""
import csv
import json
import subprocess

import cases
import judge
import numpy as np
import pytest
import run
import table


def truth(t=20.0):
    return {"train": {"significance": t}, "held_out": {"significance": t}, "effects": [{"effect": "coulomb", "parameters": [{"name": "tau_c", "value": 0.2, "torque": True}]}],
            "drive": {"K_t_Nm_A": 0.1}}


def entry(effect, accepted=True, ties=(), **parameters):
    return {"effect": effect, "accepted": accepted, "not_told_apart_from": list(ties), "parameters": parameters}


def never(names):
    raise AssertionError("no tie to check here")


def case(group="single", effects=("coulomb",)):
    return {"group": group, "effects": effects, "structure": "rigid_axis"}


def test_right_wrong_and_tie():
    assert judge.judge(case(), truth(), {"verdict": "missing", "ranked": [entry("coulomb")]}, never)["right"]
    assert not judge.judge(case(), truth(), {"verdict": "missing", "ranked": [entry("stribeck"), entry("coulomb")]}, never)["right"]
    assert not judge.judge(case(), truth(), {"verdict": "missing", "ranked": [entry("coulomb", accepted=False)]}, never)["right"]
    tied = {"verdict": "cannot_tell", "ranked": [entry("stribeck", ties=["coulomb"])]}
    assert judge.judge(case(), truth(), tied, lambda names: True)["right"]
    false_tie = judge.judge(case(), truth(), tied, lambda names: False)
    assert not false_tie["right"] and false_tie["names"] == 2


def test_silence_is_excused_only_where_the_truth_is_not_significant():
    silent = {"verdict": "nothing_missing", "ranked": []}
    assert judge.judge(case(), truth(1.0), silent, never).get("excused")
    assert not judge.judge(case(), truth(5.0), silent, never).get("excused")
    assert not judge.judge(case(), truth(1.0), {"verdict": "unknown", "ranked": []}, never).get("excused")


def test_none_outside_and_pairs():
    assert judge.judge(case("none", ()), truth(), {"verdict": "nothing_missing", "ranked": [entry("coulomb", accepted=False)]}, never)["right"]
    assert not judge.judge(case("none", ()), truth(), {"verdict": "missing", "ranked": [entry("coulomb")]}, never)["right"]
    assert judge.judge(case("outside", ("end_stop",)), truth(), {"verdict": "unknown", "ranked": []}, never)["right"]
    assert not judge.judge(case("outside", ("end_stop",)), truth(), {"verdict": "missing", "ranked": [entry("cogging")]}, never)["right"]
    two = {"verdict": "missing", "ranked": [entry("cogging"), entry("coulomb")]}
    assert judge.judge(case("pair", ("coulomb", "cogging")), truth(), two, never)["right"]
    assert not judge.judge(case("pair", ("coulomb", "delay")), truth(), two, never)["right"]


def test_coverage_knows_frames_and_given_constants():
    answer = {"ranked": [entry("coulomb", tau_c_Nm={"value": 0.22, "interval": [0.21, 0.23]})]}
    assert judge.coverage(case(), truth(), answer, {"K_t_Nm_A": 0.11}) == [("tau_c", True, 0.0)]   # K_t given 10 % too large
    assert judge.coverage(case(), truth(), answer, {"K_t_Nm_A": 0.10}) == [("tau_c", False, -2.0)]
    answer = {"ranked": [entry("coulomb", tau_c_A={"value": 2.0, "interval": [1.9, 2.1]})]}
    assert judge.coverage(case(), truth(), answer, {}) == [("tau_c", True, 0.0)]                   # per ampere
    assert judge.symbol_of("F_c_N") == "tau_c" and judge.symbol_of("c_Nms2_rad2") == "c" and judge.symbol_of("N") == "N"


def test_sets_are_large_enough_and_repeatable():
    quick, full = cases.quick_set(), cases.full_set("abc")
    assert len(quick) >= 60 and len(full) >= 1000
    assert len({c.name for c in full}) == len(full)
    assert full == cases.full_set("abc") and full != cases.full_set("abd")
    assert {e for c in quick for e in c.effects} >= set(cases.CATALOGUE + cases.OUTSIDE)


def test_table_counts():
    rows = [{"case": str(n), "group": "single", "effects": ["coulomb"], "size": 3, "right": n < 3, "names": 1, "first": "coulomb", "verdict": "missing", "seconds": 1.0} for n in range(4)]
    s = table.summary(rows)
    assert s["first_all"] == 0.75 and s["names"] == 1.0
    assert "| coulomb |  | 3/4 |" in table.markdown(rows, "t")


# The generator, checked with nothing but numpy: the true regressor takes the residual down from ratio x floor to the floor.
def regression(rows, K_t, effect_column):
    """RMS of the torque balance without and with the effect's column, through a smooth window of 16 ms."""
    t, theta, i = (np.array([r[k] for r in rows]) for k in ("t_s", "theta_rad", next(k for k in rows[0] if k.startswith("i"))))
    dt, half = np.median(np.diff(t)), 16
    s = np.arange(-half, half + 1) / half

    def bump(s):
        return np.maximum(1 - s * s, 0) ** 4

    u, area = np.maximum(1 - s * s, 0), bump(s).sum()
    first, second = -8 * s * u**3 / (half * dt) / area, (-8 * u**3 + 48 * s * s * u**2) / (half * dt) ** 2 / area

    def windowed(x, k):
        return np.convolve(x, k[::-1], "valid")

    at = theta[half:-half]  # sums of the weights are not quite zero: turn counts must not leak through them
    rate, accel = -(windowed(theta, first) - at * first.sum()), windowed(theta, second) - at * second.sum()
    extra = np.convolve(effect_column(rate), bump(s) / area, "same")
    best = (np.inf, np.inf)
    for shift in (0, -0.5):  # a reading stands for its instant, or for the interval that ends there
        torque = K_t * windowed(i, bump(s + shift / half) / area)
        step = slice(None, None, half // 2)
        base = np.column_stack([accel, rate])[step]
        both = np.column_stack([base, extra[step]])
        without, with_it = (np.sqrt(np.mean((torque[step] - A @ np.linalg.lstsq(A, torque[step], rcond=None)[0]) ** 2)) for A in (base, both))
        if with_it < best[1]:
            best = without, with_it
    return best


@pytest.mark.parametrize("effect, column", [("coulomb", np.sign), ("quadratic_drag", lambda w: np.abs(w) * w), ("constant_load", np.ones_like)])
def test_size_is_the_ratio_that_numpy_finds(tmp_path, effect, column):
    sim, _ = run.programs()
    measured = []
    for seed in (1, 2, 5):
        subprocess.run([sim, "case", "--seed", str(seed), "--effect", effect, "--size", "3", "--rate", "1000", "--train-s", "12", "--held-out-s", "4", "--out", str(tmp_path / "x"),
                        "--truth", str(tmp_path / "t.json")], check=True, timeout=60)
        known = json.loads((tmp_path / "x/case.json").read_text())
        with open(tmp_path / "x/train.csv") as f:
            rows = [{k: float(v) for k, v in r.items()} for r in csv.DictReader(f)]
        if "theta_rad" not in rows[0] or not any(k.startswith("i") for k in rows[0]):
            continue
        without, with_it = regression(rows, known["given"].get("K_t_Nm_A", 1.0), column)
        measured.append(without / with_it)
    assert measured and all(1.8 < m < 3.6 for m in measured), measured  # signs and squares of a smoothed speed, wrong near rests: near 3, not equal

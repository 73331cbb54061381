# SPDX-License-Identifier: Apache-2.0
"""Every command's JSON against docs/manual/json.md: the page names every key, and the keys that it promises are there."""

import json
import re

import numpy as np
import pytest

from conftest import TOP, write_csv
from driveid import shifting

HEAD = {"format", "driveid", "model", "records", "notices"}
KEYS = {
    "fit": {"parameters", "error_after", "objective", "model_toml"},
    "compare": {"free_run_rmse", "parameters"},
    "explain": {"verdict", "ranked", "where", "error_before", "error_after", "removable", "next_record", "shape"},
    "improve": {"verdict", "steps", "ends", "ranked", "next_record", "shape", "model_toml"},
    "power": {"effects", "noise_floor"},
}
ERROR_SETS = {"equation", "one_step", "windows", "free_run"}


@pytest.fixture(scope="module")
def page():
    text = (TOP / "docs" / "manual" / "json.md").read_text()
    sections = re.split(r"^## (\w+).*$", text, flags=re.M)
    named = {name: set(re.findall(r"`([a-z_0-9]+)", body)) for name, body in zip(sections[1::2], sections[2::2])}
    return set(re.findall(r"`([a-z_0-9]+)", sections[0])), named


def check_error_set(errors):
    assert set(errors) <= ERROR_SETS
    for e in errors.values():
        if e is not None:
            assert set(e) <= {"rmse", "unit", "signal", "noise_floor", "fit_percent"} and e["rmse"] >= 0 and len(e["noise_floor"]) == 2 and e["unit"]


@pytest.mark.parametrize("command", KEYS)
def test_document_of_a_command(driveid, runs, page, command):
    assert driveid("model", "new", "rigid_axis", "--given", "K_t_Nm_A=0.05", "-o", "axis.toml")[0] == 0
    model = "axis.toml"
    if command == "compare":
        assert driveid("fit", model, runs[0], "-o", "fitted.toml")[0] == 0
        model = "fitted.toml"
    if command == "power":  # a short record: seconds
        lines = runs[0].read_text().splitlines(keepends=True)
        (driveid.folder / "short.csv").write_text("".join(lines[:1] + lines[1:6000:3]))
        records = [driveid.folder / "short.csv"]
    else:
        records = [runs[0], "--held-out", runs[1]]
    code, out, err = driveid(command, model, *records, "--json", "-", timeout=240)
    assert code == 0, err
    document = json.loads(out)
    assert HEAD | KEYS[command] <= set(document), sorted(HEAD | KEYS[command] - set(document))
    head, named = page
    assert set(document) <= head | named[command], f"not on the page: {sorted(set(document) - head - named[command])}"
    assert document["format"] == 1 and document["model"] == (driveid.folder / model).read_text()
    for r in document["records"]:
        assert {"name", "rows", "span_s", "hash", "role"} <= set(r) and len(r["hash"]) == 64
    assert [r["role"] for r in document["records"]] == ["training", "held_out"][:len(document["records"])]
    for n in document["notices"]:
        assert {"kind", "text"} <= set(n)
    for side in ("error_before", "error_after"):
        for errors in (document.get(side) or {}).values():
            if errors:
                check_error_set(errors)
    for step in document.get("steps", []):
        check_error_set(step["training"])
        check_error_set(step["held_out"])
    if command == "compare":
        for r in document["records"]:
            check_error_set({k: r[k] for k in ERROR_SETS & set(r)})


def test_frequency(driveid, page):
    t = np.arange(3000) * 1e-3
    y = 3 + 0.2 * np.sin(25 * t + 1) + 0.1 * np.sin(70 * t) + 2e-3 * np.random.default_rng(1).standard_normal(len(t))
    write_csv(driveid.folder / "two.csv", {"t_s": t, "theta_rad": y})
    code, out, err = driveid("frequency", "two.csv", "theta_rad", "--sinusoids", "2", "--json", "-")
    assert code == 0, err
    document = json.loads(out)
    head, named = page
    assert HEAD | {"signal", "frequencies"} == set(document) <= head | named["frequency"]
    for f, truth in zip(document["frequencies"], (25, 70), strict=True):
        lo, hi = f["interval"]
        assert f["unit"] == "rad/s" and lo < f["value"] < hi and abs(f["value"] / truth - 1) < 0.005 and hi - lo < 0.03 * truth
    code, out, _ = driveid("frequency", "two.csv", "theta_rad", "--sinusoids", "2")
    assert code == 0 and "Hz" in out and "±" in out


def test_frequency_refuses(driveid):
    t = np.arange(2000) * 1e-3
    write_csv(driveid.folder / "noise.csv", {"t_s": t, "theta_rad": np.random.default_rng(1).standard_normal(len(t))})
    code, out, err = driveid("frequency", "noise.csv", "theta_rad", "--json", "-")
    assert code == 3 and json.loads(out)["verdict"] == "bad_data" and "does not show a sinusoid" in err
    code, _, err = driveid("frequency", "noise.csv", "i_A")
    assert code == 2 and "no column 'i_A'" in err
    code, _, err = driveid("frequency", "noise.csv", "theta_rad", "--highest", "1e6")
    assert code == 2 and "half of the sampling rate" in err


def test_excitation(driveid, page):
    given = ["--omega-0", "60", "--zeta", "0.02", "--sigma", "1e-4", "--dt", "1e-3", "--span", "2"]
    code, out, err = driveid("excitation", *given, "--json", "-")
    assert code == 0, err
    document = json.loads(out)
    head, named = page
    assert set(document) <= head | named["excitation"]
    assert document["ratio"] == pytest.approx(1, abs=0.1)  # 19 periods: the resonance itself is best
    assert all(c["omega_0_sd"] >= 0.999 * document["omega_0_sd"] for c in document["curve"])
    code, _, err = driveid("excitation", *given[:-1], "0")
    assert code == 2 and "range" in err


def test_suggest(driveid, page):
    """The command offers what the library offers, and settings that are used work."""
    code, out, err = driveid("suggest", "--dt", "1e-3", "--bandwidth", "14.2", "--noise", "0.01", "--json", "-")
    assert code == 0, err
    document = json.loads(out)
    head, named = page
    assert set(document) <= head | named["suggest"]
    offered = shifting.suggest(order=2, zeros=0, dt_s=1e-3, bandwidth_rad_s=14.2, noise=0.01)
    assert document["poles_rad_s"] == list(offered.poles_rad_s) and document["q_per_s"] == offered.q_per_s and len(offered.poles_rad_s) == 5
    code, out, _ = driveid("suggest", "--dt", "1e-3", "--bandwidth", "14.2")
    assert code == 0 and "4 poles at 56.8 rad/s" in out and "bandwidth_rad_s = 56.8" in out and "motion_rad_s = 14.2" in out
    code, _, err = driveid("suggest", "--dt", "0.1", "--bandwidth", "30")
    assert code == 2 and "sample" in err


def test_an_own_effect_from_the_command_line(driveid, runs):
    assert driveid("model", "new", "rigid_axis", "--given", "K_t_Nm_A=0.05", "-o", "axis.toml")[0] == 0
    code, _, err = driveid("add", "axis.toml", "dry", "--formula", "tau_Nm = c * sign(omega_rad_s)", "-o", "own.toml")
    assert code == 0, err
    code, out, err = driveid("fit", "own.toml", runs[0], "--json", "-")
    assert code == 0, err
    c = json.loads(out)["parameters"]["c"]
    lo, hi = c["interval"]
    assert abs(c["value"] - 0.004) < hi - lo < 0.0004  # conftest's drive hides 4 mN m; within twice the half-width in one run
    code, _, err = driveid("add", "axis.toml", "--formula", "c * omega_rad_s")
    assert code == 2 and 'formula = "tau_Nm = ..."' in err
    code, _, err = driveid("add", "axis.toml", "--formula", "x_m = c * omega_rad_s")
    assert code == 2 and "adds_to" in err
    code, _, err = driveid("add", "axis.toml")
    assert code == 2 and "which effect?" in err

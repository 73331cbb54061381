# SPDX-License-Identifier: Apache-2.0
"""The command line as a user and as a program meets it: exit codes, standard output and error, JSON, refusals."""

import json
import tomllib

import numpy as np
import pytest

from conftest import drive, write_csv

EXITS = (0, 2, 3)


@pytest.fixture
def axis(driveid):
    """A model in the folder of the command."""
    code, _, err = driveid("model", "new", "rigid_axis", "--given", "K_t_Nm_A=0.05", "-o", "axis.toml")
    assert code == 0, err
    return "axis.toml"


def test_model_new_and_show(driveid, axis):
    model = tomllib.loads((driveid.folder / axis).read_text())
    assert model["format"] == 1 and model["structure"] == "rigid_axis"
    assert model["parameters"]["K_t_Nm_A"] == {"value": 0.05, "unit": "N m/A", "state": "given"}
    assert model["parameters"]["J_kgm2"]["state"] == "unset"
    code, out, _ = driveid("model", "show", axis)
    assert code == 0 and "rigid_axis" in out and "50 mN·m/A" in out and "not fitted yet" in out
    code, out, err = driveid("model", "new", "pmsm_drive", "--given", "pole_pairs=4", "R_ohm=0.5")
    model = tomllib.loads(out)
    assert code == 0 and model["parameters"]["pole_pairs"]["value"] == 4 and model["parameters"]["R_ohm"]["state"] == "given"


@pytest.mark.parametrize("arguments, words", [
    (["model", "new", "rigid"], "Did you mean 'rigid_axis'"), (["model", "new", "rigid_axis", "--given", "K=3"], "K"), (["model", "new", "rigid_axis", "--given", "K_t_Nm_A"], "NAME=NUMBER"),
    (["model", "new", "rigid_axis", "--given", "K_t_Nm_A=x"], "NAME=NUMBER"), (["model", "show", "none.toml"], "none.toml: no such file"), (["fit", "axis.toml"], "RECORD"),
    (["fit", "none.toml", "run.csv"], "none.toml"), (["fit", "axis.toml", "none.csv"], "none.csv"), (["add", "axis.toml", "coulom"], "coulom"), (["explode"], "explode"),
    (["fit", "axis.toml", "bad.csv"], "line 3"), (["fit", "axis.toml", "run.csv", "--map", "i_A=nope"], "no column 'nope'"), (["fit", "axis.toml", "run.csv", "--hold", "foh"], "foh"),
    (["fit", "axis.toml", "run.csv", "--json", "-", "-o", "-"], "both want standard output"), (["fit", "bad.toml", "run.csv"], "bad.toml"), (["catalogue", "colomb"], "Did you mean 'coulomb'"),
])
def test_usage_errors_are_one_sentence_and_exit_2(driveid, axis, arguments, words):
    (driveid.folder / "run.csv").write_text("t_s,Iq,theta_rad\n0,1,0\n1,2,1\n")
    (driveid.folder / "bad.csv").write_text("t_s,i_A,theta_rad\n0,1,0\n0.1,oops,1\n")
    (driveid.folder / "bad.toml").write_text("format = 1\nstructure = \"rigid_axis\"\n[parameters.J_kgm2]\nvalu = 3\n")
    code, out, err = driveid(*arguments)
    assert code == 2 and out == "" and words in err and "Traceback" not in err


def test_catalogue(driveid):
    code, out, _ = driveid("catalogue", "--json", "-")
    document = json.loads(out)
    names = [e["name"] for e in document["effects"]]
    assert code == 0 and document["format"] == 1 and len(names) >= 23 and names[0] == "coulomb" and "backlash" in names
    code, out, _ = driveid("catalogue", "stribeck")
    assert code == 0 and "omega_s_rad_s" in out and "literature" in out


def test_add_own_words_to_history(driveid, axis):
    code, out, err = driveid("add", axis, "coulomb")
    model = tomllib.loads(out)
    assert code == 0 and [e["name"] for e in model["effect"]] == ["coulomb"] and model["history"][-1]["step"] == "add coulomb"


def short_record(folder):
    return write_csv(folder / "short.csv", {"t_s": np.arange(5) * 1e-3, "i_A": np.ones(5), "theta_rad": np.zeros(5)})


@pytest.mark.parametrize("command", ["fit", "compare", "explain", "improve"])
def test_bad_data_is_exit_3_and_still_json(driveid, axis, command):
    short_record(driveid.folder)
    code, out, err = driveid(command, axis, "short.csv", "--json", "a.json", "--html", "a.html")
    assert code == 3, err
    document = json.loads((driveid.folder / "a.json").read_text())
    assert document["verdict"] == "bad_data" and document["format"] == 1 and document["records"][0]["name"] == "short.csv" and document["records"][0]["rows"] == 5
    assert "bad data" in err and "Traceback" not in err
    assert "<!doctype html>" in (driveid.folder / "a.html").read_text().lower()


@pytest.mark.parametrize("columns", [("t_s", "i_A"), ("t_s", "theta_rad")])
def test_a_needed_column_that_is_missing_is_bad_data(driveid, axis, columns):
    full = drive(2.0)
    write_csv(driveid.folder / "part.csv", {c: full[c] for c in columns})
    code, out, err = driveid("fit", axis, "part.csv", "--json", "-")
    assert code == 3 and json.loads(out)["verdict"] == "bad_data"
    wanted = "theta_rad" if "theta_rad" not in columns else "i_A"
    assert wanted in err


class TestFiveSteps:
    """The story of the README on a simulated drive with hidden Coulomb friction."""

    def test_fit_compare_explain_add(self, driveid, axis, runs):
        run1, run2 = runs
        code, out, err = driveid("fit", axis, run1, "-o", "fitted.toml", "--json", "f.json")
        assert code == 0, err
        fitted = tomllib.loads((driveid.folder / "fitted.toml").read_text())
        assert fitted["parameters"]["K_t_Nm_A"]["value"] == 0.05 and fitted["parameters"]["J_kgm2"]["value"] == pytest.approx(2.0e-4, rel=0.2)
        document = json.loads((driveid.folder / "f.json").read_text())
        assert document["format"] == 1 and document["records"][0]["rows"] == 8000 and len(document["records"][0]["hash"]) == 64

        code, out, err = driveid("compare", "fitted.toml", run1, run2, "--json", "c.json", "--html", "c.html")
        assert code == 0, err
        compared = json.loads((driveid.folder / "c.json").read_text())
        assert [r["name"] for r in compared["records"]] == ["run1.csv", "run2.csv"] and compared["free_run_rmse"] > 0
        html = (driveid.folder / "c.html").read_text()
        assert "http://" not in html.replace("http://www.w3.org", "") and "src=\"http" not in html and "<svg" in html

        code, out, err = driveid("explain", "fitted.toml", run1, "--held-out", run2, "--json", "-")
        assert code == 0, err
        explained = json.loads(out)
        assert explained["verdict"] in ("missing", "cannot_tell") and explained["ranked"][0]["effect"] == "coulomb"
        assert explained["ranked"][0]["parameters"]["tau_c_Nm"]["value"] == pytest.approx(0.004, rel=0.1)

        assert driveid("add", "fitted.toml", "coulomb", "-o", "axis2.toml")[0] == 0
        code, out, err = driveid("fit", "axis2.toml", run1, "--held-out", run2, "-o", "fitted2.toml")
        assert code == 0, err
        code, out, err = driveid("compare", "fitted2.toml", run1, run2, "--json", "-")
        assert code == 0 and json.loads(out)["free_run_rmse"] < 0.2 * compared["free_run_rmse"]

    def test_improve(self, driveid, axis, runs):
        run1, run2 = runs
        code, out, err = driveid("improve", axis, run1, "--held-out", run2, "-o", "final.toml", "--json", "i.json", "--html", "i.html")
        assert code == 0, err
        document = json.loads((driveid.folder / "i.json").read_text())
        assert document["ends"] in ("noise_floor", "nothing_missing", "tie") and [s["effect"] for s in document["steps"]] == [None, "coulomb"]
        assert [e["name"] for e in tomllib.loads((driveid.folder / "final.toml").read_text())["effect"]] == ["coulomb"]
        assert "coulomb" in out.lower() and "Ends here" in out


def test_one_option_takes_several_records(tmp_path):
    from driveid.cli.analyse import explain
    command = explain
    assert command._expand(["m", "a", "--held-out", "b", "c", "--json", "-"]) == ["m", "a", "--held-out", "b", "--held-out", "c", "--json", "-"]
    assert command._expand(["--held-out", "b", "m", "a"]) == ["--held-out", "b", "m", "a"]
    assert command._expand(["m", "--held-out", "b", "a", "c"]) == ["m", "--held-out", "b", "a", "c"]
    assert command._expand(["m", "a", "--map", "i_A=x", "theta_rad=y:deg", "b"]) == ["m", "a", "--map", "i_A=x", "--map", "theta_rad=y:deg", "b"]

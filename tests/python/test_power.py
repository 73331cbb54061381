# SPDX-License-Identifier: Apache-2.0
"""driveid power: the sizes that it names bracket what explain finds on a drive that really has the effect."""

import driveid as package
import pytest

from conftest import drive

MODEL = package.Model.new("rigid_axis", K_t_Nm_A=0.05)
EFFECTS = ["coulomb", "constant_load", "delay", "backlash"]


def record(name, **more):
    columns = drive(8.0, noise_rad=2e-4, **more)
    del columns["omega_rad_s"]
    return package.Record.of(name, **columns)


@pytest.fixture(scope="module")
def smallest():
    answer = package.power(MODEL, [record("clean", tau_c=0.0, seed=3)], effects=EFFECTS)
    return {e["effect"]: e for e in answer.document["effects"]}


def accepted(tau_c, seed):
    answer = package.explain(MODEL, [record("test", tau_c=tau_c, seed=seed)])
    return [c.effect for c in answer.ranked if c.accepted], answer.verdict


def test_every_effect_that_was_asked_for_has_its_line(smallest):
    assert sorted(smallest) == sorted(EFFECTS)
    for e in smallest.values():
        if e["found"]:
            assert e["rms"] > 0 and e["unit"] == "N m" and e["times_floor"] > 0 and all(p["unit"] is not None for p in e["smallest"].values())
        else:
            assert "record:" in e["why"]
    assert smallest["coulomb"]["found"] and smallest["constant_load"]["found"]
    assert not smallest["backlash"]["found"]


def test_sizes_bracket_what_explain_finds(smallest):
    size = smallest["coulomb"]["smallest"]["tau_c_Nm"]["value"]
    for seed in (4, 5, 6):  # other motions of the same kind
        found, verdict = accepted(3 * size, seed)
        assert found and found[0] == "coulomb", (seed, size, found, verdict)
        found, verdict = accepted(size / 10, seed)
        assert found[:1] != ["coulomb"], (seed, size, found, verdict)  # not seen, or not by its name


def test_what_the_record_has_already_does_not_hide_it(smallest):
    """The same drive with friction that the model lacks: what is found there is not counted as noise."""
    size = smallest["coulomb"]["smallest"]["tau_c_Nm"]["value"]
    answer = package.power(MODEL, [record("dry", tau_c=20 * size, seed=3)], effects=["constant_load"])
    (entry,) = answer.document["effects"]
    clean = smallest["constant_load"]["smallest"]["tau_0_Nm"]["value"]
    assert entry["found"] and clean / 4 < entry["smallest"]["tau_0_Nm"]["value"] < 6 * clean

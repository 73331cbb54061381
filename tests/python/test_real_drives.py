# SPDX-License-Identifier: Apache-2.0
"""Measured records of real machines: what docs/real-drives.md says of them is what the library answers. Skips loudly without the records."""

import driveid as package
import pytest

from conftest import TOP

PAGE = TOP / "docs" / "real-drives.md"


def accepted(answer):
    return {c.effect: c for c in answer.ranked if c.accepted}


def test_emps_finds_its_way_from_inertia_and_viscous_friction(data):
    record = package.read(data / "emps" / "emps_train.csv", map={"F_N": "force_N", "x_m": "q_meas_m"})
    answer = package.explain(package.Model.new("linear_axis"), record)
    found = accepted(answer)
    assert list(found)[:2] == ["coulomb", "constant_load"], list(found)
    assert 19.5 < found["coulomb"].parameters["F_c_N"].value < 21.5   # published 20.4
    assert -3.9 < found["constant_load"].parameters["F_0_N"].value < -2.9   # published -3.16
    assert any(w["significant"] and w["axis"] == "speed" for w in answer.document["where"])
    after = answer.document["error_after"]["training"]
    assert after["equation"]["rmse"] < 2.2 < 8 < answer.document["error_before"]["training"]["equation"]["rmse"]
    assert after["free_run"]["rmse"] < 6e-3


def test_odrive_names_the_order_of_its_cogging(data):
    training, held_out = (package.read(data / "odrive_cogging" / f"slow2_nocomp_{k}.csv", map={"theta_rad": "pos:counts/8192", "i_A": "current_A"}) for k in (1, 2))
    found = accepted(package.explain(package.Model.new("rigid_axis"), training, held_out=held_out))
    assert round(found["cogging"].parameters["N"].value) == 28
    assert "**28 periods a turn**" in PAGE.read_text()


def test_kit_motor_says_what_its_records_cannot_tell(data):
    read = lambda name: package.read(data / "un_dcmotor" / f"DCmotor_{name}_open_exp.csv", map={"v_V": "u", "omega_rad_s": "y:deg/s"})  # noqa: E731
    answer = package.explain(package.Model.new("dc_drive"), read("prbs"), held_out=read("step"))
    assert answer.verdict == "cannot_tell" and answer.document["next_record"]["motion"]
    first = answer.ranked[0]
    assert {first.effect, *first.not_told_apart_from} >= {"coulomb", "constant_load"}


@pytest.mark.parametrize("word", ["4.61 mm", "emps-run.svg", "odrive-cogging.svg", "kit-static.svg", "cannot_tell"])
def test_page_tells_the_stories(word):
    assert word in PAGE.read_text()
    if word.endswith(".svg"):
        assert (PAGE.parent / "real-drives" / word).read_text().startswith("<svg xmlns")

# SPDX-License-Identifier: Apache-2.0
"""Recorded frames in, the accepted trajectory out: values, intervals, validity; and what was decoded, by an independent decoder."""
import json
import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import drec  # noqa: E402
import sessions  # noqa: E402

CASES = [(name, number_type) for name in sessions.names() for number_type in sessions.TYPES]


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    made = {}

    def get(name, number_type):
        if (name, number_type) not in made:
            made[name, number_type] = sessions.replay(sessions.HERE / name, number_type, tmp_path_factory.mktemp("golden"))
        return made[name, number_type]

    return get


def close(a, b, number_type):
    """1e-9 of the number: room for another libm, none for another result. q31 has room for nothing: its sums are integers."""
    if a is None or b is None or isinstance(a, bool) or number_type == "q31":
        return a == b
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-300)


def test_there_are_sessions():
    assert set(sessions.MADE) <= set(sessions.names())


@pytest.mark.parametrize(("name", "number_type"), CASES)
def test_trajectory(record, name, number_type):
    expected = json.loads((sessions.HERE / name / f"expected-{number_type}.json").read_text())
    got = sessions.trajectory(record(name, number_type))
    assert [(row["t_s"], row["state"], list(row["parameters"])) for row in got] == [(row["t_s"], row["state"], list(row["parameters"])) for row in expected]
    for mine, theirs in zip(got, expected):
        for parameter, values in theirs["parameters"].items():
            assert all(close(a, b, number_type) for a, b in zip(mine["parameters"][parameter], values, strict=True)), f"at {mine['t_s']} s, {parameter}: {mine['parameters'][parameter]}, accepted {values}"


@pytest.mark.parametrize(("name", "number_type"), CASES)
def test_accepted_trajectory_meets_the_truth(name, number_type):
    """What was accepted is not merely stable: where it ends valid, its interval is about the simulated drive's truth."""
    truth = json.loads((sessions.HERE / name / "truth.json").read_text())["phases"][-1]["drive"]
    last = json.loads((sessions.HERE / name / f"expected-{number_type}.json").read_text())[-1]["parameters"]
    valid = {parameter: values for parameter, values in last.items() if values[3] and parameter in truth}
    assert valid, "no valid parameter at the end"
    for parameter, (value, lo, hi, _) in valid.items():
        assert abs(value - truth[parameter]) <= 3 * (hi - lo) / 2, f"{parameter}: {value} in {lo}..{hi}, true {truth[parameter]}"


@pytest.mark.parametrize("name", sessions.names())
def test_decoded_samples_agree_with_cantools(record, name):
    assert sessions.disagreement(record(name, "f64"), sessions.HERE / name) is None


def test_replay_is_deterministic(record, tmp_path):
    name = sessions.names()[0]
    again = sessions.replay(sessions.HERE / name, "f64", tmp_path)

    def content(path):
        return [(kind, source, t_ns, payload) for kind, source, t_ns, payload in drec.entries(path) if kind in (drec.FRAME, drec.SAMPLE, drec.ESTIMATE)]

    assert content(again) == content(record(name, "f64"))

# SPDX-License-Identifier: Apache-2.0
"""docs/methods.md: the program that makes its tables still runs them all, and what the page recommends by is still so."""

import os
import re
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


def tables(text):
    """scene -> method -> cells."""
    out, scene = {}, ""
    for line in text.splitlines():
        if line.startswith("## "):
            scene = line[3:].strip()
            out[scene] = {}
        elif scene and line.startswith("| ") and not line.startswith("| method"):
            cells = [c.strip() for c in line.strip("|").split("|")]
            out[scene][cells[0]] = cells[1:]
    return out


def error(cells):
    return float(re.match(r"[\d.e+-]+", cells[0]).group())


def settled(cells):
    first = cells[1].split("/")[0].strip()
    return float("inf") if first == "-" else float(first)


@pytest.fixture(scope="module")
def measured():
    program = Path(os.environ.get("DRIVEID_BUILD", TOP / "build")) / "tools" / "bench" / "driveid-bench-methods"
    if not program.exists():
        pytest.skip(f"SKIPPED BECAUSE {program} is not built")
    return tables(subprocess.run([program, "--quick"], capture_output=True, text=True, check=True, timeout=200).stdout)


@pytest.fixture(scope="module")
def page():
    return tables((TOP / "docs" / "methods.md").read_text())


@pytest.mark.parametrize("which", ["page", "measured"])
def test_the_reading_holds(which, request):
    t = request.getfixturevalue(which)
    scene = {name[1]: rows for name, rows in t.items() if name.startswith("(")}
    for s in "adf":  # the default is first, and within a per mille at the end
        assert settled(scene[s]["fsm f64"]) <= 0.3 < settled(scene[s]["window f64"])
        assert error(scene[s]["fsm f64"]) < 0.1
    for s in "abdef":  # fixed point: below 0.02 % but with coloured noise
        assert error(scene[s]["fsm q31"]) < 0.02 and error(scene[s]["rls q31"]) < 0.02
    assert all(settled(scene["b"][m]) < 2 for m in ("fsm f64", "fsm q31", "window f64", "discrete f64")) and error(scene["b"]["adm f64"]) > 10
    assert all(int(rows[m][2]) == 0 for rows in scene.values() for m in ("fsm f64", "window f64", "discrete f64")), "a false alarm"
    assert error(scene["e"]["fsm f64"]) < 0.1 and error(scene["c"]["adm f64"]) > 5


def test_the_page_has_what_the_program_makes(page, measured):
    assert list(page) == list(measured)
    assert all(list(page[s]) == list(measured[s]) for s in page)

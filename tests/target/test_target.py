# SPDX-License-Identifier: Apache-2.0
"""The amalgamated core on Cortex-M: builds without warnings, needs no heap, keeps its stack, and gives the host's bits under qemu."""
import struct
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
import target  # noqa: E402

HEAP = {"malloc", "calloc", "realloc", "free", "_sbrk", "_malloc_r", "_free_r"}
LIBM = {"sqrt", "exp", "log", "pow", "floor", "ceil", "fmax", "fmin", "sin", "cos", "ldexp", "log2", "lrint", "llrint"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return target.amalgamate(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="module")
def expected(folder):
    done = target.call([target.host(folder)])
    assert done.stdout.endswith("0 failed\n") and done.stdout.count("within 1 %: yes") == 8, done.stdout
    return done.stdout


@pytest.mark.parametrize("cpu", target.CPUS)
def test_same_bits_as_the_host(folder, expected, cpu):
    core, _ = target.compile_core(folder, cpu)
    done = target.run(target.link(folder, cpu, core))
    assert done.returncode == 0, done.stderr
    assert done.stdout == expected


@pytest.mark.parametrize("cpu", target.CPUS)
def test_no_heap_and_bounded_stack(folder, cpu):
    core, frames = target.compile_core(folder, cpu)
    assert not target.undefined(core) & HEAP
    assert len(frames) > 100 and max(v for name, v in frames.items() if "prepare_window" not in name) < 8192  # that one at configure only
    assert max(v for name, v in frames.items() if name.startswith(("fsm_", "driveid_svf_", "q31_answer"))) < 8192  # a solve reaches about 25 kB through four of them
    small, frames = target.compile_core(folder, cpu, {k: v for k, v in target.SMALL.items() if k.startswith("DRIVEID")})
    assert max(v for name, v in frames.items() if "q31" in name) < 8192


@pytest.mark.parametrize("cpu", target.CPUS)
def test_no_libm_in_the_fixed_point_path(folder, cpu):
    core, _ = target.compile_core(folder, cpu)
    for function in ("q31_filter_step", "q31_row", "q31_sums_row", "driveid_monitor_feed"):
        names = target.code_of(core, function)
        assert len(names) > 1 or function == "driveid_monitor_feed"
        assert not names & LIBM, function
    assert target.code_of(core, "fsm_solve") & LIBM  # the solve, at the rate of answers, is f64: the check sees what is there


@pytest.mark.parametrize("kind", ["F32", "Q31"])
def test_frequency_on_the_target(folder, kind):
    """The method frequency on the Cortex-M4F: the tone's 7 Hz and 0.7, and the host's numbers but for the last digits of the C library's functions."""
    values = {"RUN_METHOD": '"frequency"', "RUN_TYPE": f"DRIVEID_{kind}", "RUN_SAMPLES": 4000}
    core, _ = target.compile_core(folder, "Cortex-M4F")
    there = target.run(target.link(folder, "Cortex-M4F", core, values)).stdout
    here = target.call([target.host(folder, values)]).stdout
    numbers = [[struct.unpack(">d", bytes.fromhex(word))[0] for word in text.split(" J ")[1].split()[:3]] for text in (there, here)]
    assert "status 0" in there and "status 0" in here
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-9)
    assert numbers[0][0] == pytest.approx(7, rel=0.01) and numbers[0][2] == pytest.approx(0.7, rel=0.1)


SMALL_CORE = {k: v for k, v in target.SMALL.items() if k.startswith("DRIVEID")}


@pytest.mark.parametrize("kind", ["F32", "Q31"])
@pytest.mark.parametrize("method", target.METHODS)
def test_unit_checks_on_the_m4f(folder, method, kind):
    """The unit checks that the host runs (tests/unit/portable_test.cpp), the same file."""
    core, _ = target.compile_core(folder, "Cortex-M4F")
    done = target.run(target.checks(folder, "Cortex-M4F", core, method, kind))
    assert done.returncode == 0 and done.stderr == "12 checks, 0 failed\n", done.stdout + done.stderr


@pytest.mark.parametrize("method", target.METHODS)
def test_unit_checks_in_sixteen_kibibytes(folder, method):
    """The small build on the micro:bit, Cortex-M0: state, stack and the checks' own data in 16 KiB of memory, code in 256 KiB; one method a slice."""
    core, _ = target.compile_core(folder, "Cortex-M0+", SMALL_CORE)
    done = target.run(target.checks(folder, "Cortex-M0+", core, method, "Q31", target.SMALL, "microbit.ld"), board="microbit")
    assert done.returncode == 0 and done.stderr == "12 checks, 0 failed\n", done.stdout + done.stderr


def test_a_check_that_fails_is_seen(folder):
    """Half of the ring: the state does not carry its window, and configure says so on the target too."""
    values = {**target.SMALL, "DRIVEID_Q31_RING": 64}
    core, _ = target.compile_core(folder, "Cortex-M0+", {k: v for k, v in values.items() if k.startswith("DRIVEID")})
    done = target.run(target.checks(folder, "Cortex-M0+", core, "window", "Q31", values, "microbit.ld"), board="microbit")
    assert done.returncode != 0 and "values fails at checks.c:" in done.stderr, done.stderr


def test_pages_say_what_is(tmp_path):
    """The committed table is this code's: states to the byte; instructions and code within a tenth (python tests/target/target.py writes it anew)."""
    rows = target.write(tmp_path / "target.md")
    made, kept = [[line.split("|") for line in path.read_text().splitlines() if line.startswith("| Cortex")] for path in (tmp_path / "target.md", target.TOP / "docs/target.md")]
    assert len(made) == len(kept) > 12
    for mine, theirs in zip(made, kept):
        assert [cell for cell in mine if not cell.strip().isdigit()][:3] == [cell for cell in theirs if not cell.strip().isdigit()][:3]
        for a, b in zip(mine, theirs):
            if a.strip().isdigit():
                assert abs(int(a) - int(b)) <= 0.1 * int(b), (mine, theirs)
    assert [row.split("|")[1] for row in target.rows_of_q31()] == [" fsm, rls ", " window ", " discrete "]
    assert all(row in (target.TOP / "docs/target.md").read_text().splitlines() for row in target.rows_of_q31())
    assert [row[3] for row in rows if row[2]] == [int(cells[4]) for cells in kept if cells[3].strip() in ("f32", "q31")]
    shown = (target.TOP / "README.md").read_text().split(target.BEGIN)[1].split(target.END)[0]
    assert [line.split("|") for line in shown.splitlines() if line.startswith("| Cortex")] == [cells for cells in kept if cells[3].strip() in ("f32", "q31")]


def test_stack_of_an_update(folder):
    """Frames along the deepest chain: below what the page says fits, and the chain is seen (a solve alone is more than a kilobyte)."""
    core, frames = target.compile_core(folder, "Cortex-M4F")
    for method in target.METHODS:
        for kind in ("F32", "Q31"):
            assert 8_000 < target.stack(core, frames, method, kind) < 32_000, (method, kind)
    small, frames = target.compile_core(folder, "Cortex-M0+", SMALL_CORE)
    assert 1_000 < target.stack(small, frames, "fsm", "Q31") < 6_000

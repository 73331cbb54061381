# SPDX-License-Identifier: Apache-2.0
"""tools/vcan/run from outside: exit codes, live output, limits, nothing left behind."""
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RUN = ROOT / "tools" / "vcan" / "run"
WHICH = subprocess.run([RUN, "--which"], capture_output=True, text=True)

pytestmark = pytest.mark.skipif(WHICH.returncode != 0, reason=WHICH.stderr.strip())


def machine(*arguments, tmp, **kwargs):
    return subprocess.Popen([RUN, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env={**os.environ, "TMPDIR": str(tmp)}, **kwargs)


def nothing_left(tmp):
    for _ in range(300):
        left = subprocess.run(["pgrep", "-f", str(tmp)], capture_output=True, text=True).stdout.split()
        if not left:
            break
        time.sleep(0.1)
    return not left and not list(Path(tmp).glob("driveid-vcan-*"))


def test_frames_pass_results_are_kept_exit_code_is_the_commands(tmp_path):
    results = tmp_path / "out"
    script = """echo first; candump -n 2 vcan0 & sleep 0.3; cansend vcan0 123#1122; cansend vcan0 124##1AABB; wait
                touch /root/written 2>&1; echo kept > $VCAN_RESULTS/file; echo "$1"; sleep 2; echo last; exit 7"""
    with machine("--results", str(results), "bash", "-c", script, "name", "it's \"quoted\"", tmp=tmp_path) as process:
        seen = [(time.monotonic(), line) for line in process.stdout]
        errors = process.stderr.read()
    text = "".join(line for _, line in seen)
    assert process.returncode == 7, text + errors
    assert "123   [2]  11 22" in text and "124  [02]  AA BB" in text
    assert 'it\'s "quoted"' in text
    assert WHICH.stdout.strip() == "native" or "Read-only file system" in text
    assert (results / "file").read_text() == "kept\n"
    assert seen[-1][0] - seen[0][0] > 1.5, "lines arrive as they are written"
    assert nothing_left(tmp_path)


def test_out_of_time(tmp_path):
    started = time.monotonic()
    with machine("--time", "8", "sleep", "1000", tmp=tmp_path) as process:
        errors = process.stderr.read()
    assert process.returncode == 124 and "out of time" in errors
    assert time.monotonic() - started < 20 and nothing_left(tmp_path)


def test_interrupt_leaves_nothing(tmp_path):
    with machine("bash", "-c", "echo here; sleep 1000", tmp=tmp_path, start_new_session=True) as process:
        assert process.stdout.readline() == "here\n"
        os.killpg(process.pid, signal.SIGINT)
        process.wait(timeout=15)
    assert process.returncode == 130 and nothing_left(tmp_path)

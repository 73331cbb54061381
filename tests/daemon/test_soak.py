# SPDX-License-Identifier: Apache-2.0
"""The short form of the soak: docs/soak.md has the long one."""
import subprocess
import sys

from gateway import ROOT, SLOW


def test_drive_time_through_replay_keeps_memory_and_counters():
    done = subprocess.run([sys.executable, ROOT / "tools/soak", "replay", "--hours", "0.1"], capture_output=True, text=True, timeout=120 * SLOW)
    assert done.returncode == 0 and "| yes |" in done.stdout, done.stdout + done.stderr

# SPDX-License-Identifier: Apache-2.0
"""One licence line a file; the checker sees a file that lacks it."""
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CHECKER = ROOT / "tools" / "check_spdx.py"


def check(root):
    return subprocess.run([sys.executable, CHECKER, root], capture_output=True, text=True)


def test_this_tree():
    done = check(ROOT)
    assert done.returncode == 0, done.stdout


def test_missing_line_and_work_left_are_found(tmp_path):
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    (tmp_path / "a.c").write_text("int a;\n")
    (tmp_path / "b.py").write_text("# SPDX-License-Identifier: Apache-2.0\n# TO" + "DO: later\n")
    (tmp_path / "c.h").write_text("/* SPDX-License-Identifier: Apache-2.0 */\n")
    done = check(tmp_path)
    assert done.returncode == 1
    assert "a.c: no 'SPDX" in done.stdout and "b.py:2: work left" in done.stdout and "c.h" not in done.stdout

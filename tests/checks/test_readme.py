# SPDX-License-Identifier: Apache-2.0
"""What README.md prints works as printed: its C program, its commands, its Python, its links.

Blocks marked ```sh run, ```python run and ```c run are executed, in order, in one empty folder where tests/golden/readme
is at hand under its shipped name.
"""
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"^```(\w+) run\n(.*?)^```$", README, re.M | re.S)


def run(command, folder, **kwargs):
    env = {**os.environ, "PATH": f"{ROOT}/.venv/bin:{ROOT}/build/daemon:{os.environ['PATH']}"}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, timeout=180, **kwargs)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("readme")
    for file in (ROOT / "tests" / "golden" / "readme").iterdir():
        shutil.copy(file, folder)
    return folder


def test_the_c_program_is_the_example_under_test(folder):
    [text] = [text for kind, text in BLOCKS if kind == "c"]
    example = (ROOT / "lib" / "examples" / "readme.c").read_text()
    assert text.strip() in example
    (folder / "readme.c").write_text(text)
    library = next((ROOT / "build").glob("lib/libdriveid.*"))
    run(["cc", "-std=c11", "-pedantic-errors", "-Wall", "-Wextra", "-Werror", f"-I{ROOT}/lib/include", f"-I{ROOT}/build/include", "readme.c", library, "-lm", "-o", "readme"], folder)
    assert re.search(r"J.*\d.*\[", run(["./readme"], folder)), "it prints J with its interval"


def test_commands_and_python_run_in_order(folder):
    ran = 0
    for kind, text in BLOCKS:
        if kind == "sh":
            run(["bash", "-euo", "pipefail", "-c", text], folder)
        elif kind == "python":
            run([sys.executable, "-c", text], folder)
        else:
            continue
        ran += 1
    assert ran >= 2


def test_links_lead_somewhere():
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", README):
        assert (ROOT / target).exists(), f"README.md links to {target}"

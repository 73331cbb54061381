# SPDX-License-Identifier: Apache-2.0
"""The package as a stranger gets it: a wheel, installed into an environment of its own, which answers without the source tree."""

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from conftest import TOP


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built in a folder that stays, so that only the first time compiles everything (with ccache not even that)."""
    folder = tmp_path_factory.mktemp("wheel")
    build = Path(os.environ.get("DRIVEID_WHEEL_BUILD", TOP / "build-wheel"))
    ccache = shutil.which("ccache")
    env = os.environ | ({"CMAKE_C_COMPILER_LAUNCHER": ccache, "CMAKE_CXX_COMPILER_LAUNCHER": ccache, "CCACHE_BASEDIR": str(TOP), "CCACHE_NOHASHDIR": "1"} if ccache else {})
    done = subprocess.run([sys.executable, "-m", "pip", "wheel", "--no-build-isolation", "--no-deps", "--no-index", "-q", "-C", f"build-dir={build}", "-w", folder, TOP / "bindings" / "python"],
                          capture_output=True, text=True, stdin=subprocess.DEVNULL, env=env)
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
    found = list(folder.glob("*.whl"))
    assert len(found) == 1
    return found[0]


def test_holds_the_package_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert any(n.startswith("driveid/_core.") and n.endswith(".so") for n in names)
    assert {"driveid/_core.pyi", "driveid/py.typed", "driveid/cli/__init__.py", "driveid/records/csvfile.py", "driveid/views/static/driveid.css"} <= set(names)
    assert not [n for n in names if not n.startswith(("driveid/", "driveid-"))], "headers or libraries of the C project slipped in"
    assert not [n for n in names if n.endswith((".a", ".h", ".cpp", ".pyc"))]


def test_installs_into_a_clean_environment(wheel, tmp_path):
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "env"], check=True, stdin=subprocess.DEVNULL)
    python = tmp_path / "env" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "pip", "--python", python, "install", "-q", "--no-deps", "--no-index", wheel], check=True, stdin=subprocess.DEVNULL)
    site = Path(subprocess.run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"], capture_output=True, text=True, check=True).stdout.strip())
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")  # numpy and the rest; the wheel's own folder comes first
    run = subprocess.run([python, "-I", "-c", "import driveid; print(driveid.__file__); print(driveid.Model.new('rigid_axis', K_t_Nm_A=0.05))"], capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert str(site) in run.stdout and "Model(rigid_axis)" in run.stdout
    run = subprocess.run([tmp_path / "env" / "bin" / "driveid", "--version"], capture_output=True, text=True, cwd=tmp_path)
    assert run.returncode == 0 and run.stdout.startswith("driveid 0.1")

# SPDX-License-Identifier: Apache-2.0
"""Shared by the Python tests: a drive integrated by small steps in plain numpy, real records where they are, a command runner."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of measured records made by others; not part of the project."""
    folder = Path(os.environ.get("DRIVEID_DATA", TOP.parent / "shared" / "data"))
    if not (folder / "emps" / "emps_train.csv").is_file():
        pytest.skip(f"SKIPPED BECAUSE measured records are not at {folder} (set DRIVEID_DATA)")
    return folder


def drive(seconds: float = 8.0, rate_Hz: int = 1000, *, J=2.0e-4, B=3.0e-4, tau_c=0.004, K_t=0.05, seed=0, noise_rad=2e-6) -> dict[str, np.ndarray]:
    """A rigid axis with Coulomb friction under a rich current; explicit steps of 1/20 sample. Current is held over each sample."""
    rng = np.random.default_rng(seed)
    n, fine = int(seconds * rate_Hz), 20
    t = np.arange(n) / rate_Hz
    current = np.zeros(n)
    for f, a, p in zip((0.4, 1.1, 2.3, 5.1, 9.7), (1.2, 0.8, 0.6, 0.5, 0.4), rng.uniform(0, 2 * np.pi, 5)):
        current += a * np.sin(2 * np.pi * f * t + p)
    theta = omega = 0.0
    angle, speed = np.empty(n), np.empty(n)
    h = 1 / (rate_Hz * fine)
    for k in range(n):
        angle[k], speed[k] = theta, omega
        drive_torque = K_t * current[k]
        for _ in range(fine):
            push = drive_torque - B * omega
            if omega == 0.0 and abs(push) <= tau_c:
                continue
            friction = tau_c * (np.sign(omega) if omega != 0.0 else np.sign(push))
            new = omega + h * (push - friction) / J
            if omega * new < 0.0:
                new = 0.0
            theta += h * 0.5 * (omega + new)
            omega = new
    return {"t_s": t, "i_A": current, "theta_rad": angle + noise_rad * rng.standard_normal(n), "omega_rad_s": speed}


def write_csv(path: Path, columns: dict[str, np.ndarray], delimiter: str = ",") -> Path:
    rows = zip(*columns.values())
    path.write_text(delimiter.join(columns) + "\n" + "".join(delimiter.join(repr(float(v)) for v in row) + "\n" for row in rows))
    return path


@pytest.fixture(scope="session")
def runs(tmp_path_factory) -> tuple[Path, Path]:
    """Two records of one drive with hidden Coulomb friction."""
    folder = tmp_path_factory.mktemp("runs")
    out = []
    for k in (1, 2):
        columns = drive(seed=k)
        del columns["omega_rad_s"]
        out.append(write_csv(folder / f"run{k}.csv", columns))
    return out[0], out[1]


@pytest.fixture
def driveid(tmp_path):
    """Runs the installed command in a folder of its own; gives (exit code, standard output, standard error)."""
    program = Path(sys.executable).with_name("driveid")
    assert program.is_file(), "the package is not installed beside this Python"

    def run(*arguments, timeout: float = 60, **more):
        done = subprocess.run([program, *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=timeout, **more)
        return done.returncode, done.stdout, done.stderr
    run.folder = tmp_path
    return run


@pytest.fixture
def daemon() -> str:
    for place in (os.environ.get("DRIVEIDD"), shutil.which("driveidd"), *(Path(b) / "daemon" / "driveidd" for b in (os.environ.get("DRIVEID_BUILD", ""), TOP / "build") if b)):
        if place and os.access(place, os.X_OK):
            return str(place)
    pytest.skip("SKIPPED BECAUSE driveidd is not built (set DRIVEIDD or DRIVEID_BUILD)")

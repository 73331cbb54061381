# SPDX-License-Identifier: Apache-2.0
"""A drive whose current is read before or after its encoder: status says by how much, and `skew_s` takes it out."""
import json
import math
import random
import struct
import subprocess

import pytest
from gateway import DAEMON, J, K_T, SLOW, drive
from test_restart import entries

DT_S, FINE, B = 0.004, 8, 1e-3
CONFIG = '[record]\nfolder = "."\nfile = "out.drec"\n[control]\nsocket = "c.sock"\n[[source]]\nname = "bus"\nkind = "replay"\nfile = "frames.log"\nspeed = 0.0\n'


def frames(skew_s, seconds, seed):
    """candump lines of a drive that moves at random; the current's reading with stamp t is that of t - skew_s."""
    luck, h = random.Random(seed), DT_S / FINE
    theta = omega = i = asked = 0.0
    currents, thetas, until = [0.0], [], 0
    for k in range(round(seconds / DT_S)):
        thetas.append(theta)
        for _ in range(FINE):
            if len(currents) > until:
                asked, until = luck.uniform(-2, 2), len(currents) + luck.randrange(20, 400)
            before, i = i, i + (asked - i) * (1 - math.exp(-400 * h))
            acceleration = (K_T * 0.5 * (before + i) - B * omega) / J
            theta, omega = theta + omega * h + 0.5 * acceleration * h * h, omega + acceleration * h
            currents.append(i)
    for n in range(4, len(thetas) - 4):
        at = (n * DT_S - skew_s) / h
        a = math.floor(at)
        amperes = currents[a] + (at - a) * (currents[a + 1] - currents[a]) + luck.gauss(0, 0.002)
        data = struct.pack("<hI", round(amperes * 1000), math.floor(thetas[n] / (2 * math.pi) * (1 << 20)) & 0xFFFFFFFF)
        yield f"({1 + n * DT_S:.6f}) can0 181#{data.hex().upper()}\n"


def last(folder, keys=""):
    (folder / "gw.toml").write_text(CONFIG + drive(keys=keys).replace("dt_s = 0.001", f"dt_s = {DT_S}").replace('  hold = "zoh"\n', ""))
    subprocess.run([DAEMON, "gw.toml", "--exit-at-end"], cwd=folder, check=True, capture_output=True, timeout=120 * SLOW)
    newest = max(folder.glob("out*.drec"), key=lambda p: p.stat().st_mtime_ns)
    told = [json.loads(payload) for kind, _, _, payload in entries(newest)[1] if kind == 6][-1]
    newest.unlink()
    return told


def inertia(told):
    return next(p for p in told["parameters"] if p["name"] == "J_kgm2")


@pytest.mark.parametrize("skew_s", [-0.0013, 0.0021])
def test_the_skew_is_told_and_corrected_on_request(tmp_path, skew_s):
    (tmp_path / "frames.log").write_text("".join(frames(skew_s, 90, seed=round(abs(skew_s) * 1e6))))
    seen = last(tmp_path)
    assert seen["skew"]["corrected_s"] == 0
    value, (lo, hi) = seen["skew"]["value_s"], seen["skew"]["interval_s"]
    assert lo < value < hi and hi - lo < 0.5 * DT_S
    assert abs(value - skew_s) < (hi - lo), (value, lo, hi)  # twice the half-width
    mended = last(tmp_path, keys=f"skew_s = {value!r}")
    assert mended["skew"]["corrected_s"] == value
    assert abs(mended["skew"]["value_s"] - skew_s) < mended["skew"]["interval_s"][1] - mended["skew"]["interval_s"][0]
    assert mended["residual"]["rms"] < 0.5 * seen["residual"]["rms"]
    assert abs(inertia(mended)["value"] / J - 1) < 0.01


def test_without_motion_nothing_is_told(tmp_path):
    still = "".join(f"({1 + n * DT_S:.6f}) can0 181#{struct.pack('<hI', 0, 12345).hex().upper()}\n" for n in range(5000))
    (tmp_path / "frames.log").write_text(still)
    told = last(tmp_path)
    assert told["skew"] == {"value_s": None, "interval_s": None, "corrected_s": 0}


@pytest.mark.parametrize("keys, words", [("skew_s = 0.04", "beyond 8 dt_s"), ("skew_s = 2.0", "skew_s")])
def test_a_skew_out_of_reach_is_refused_with_its_mend(tmp_path, keys, words):
    (tmp_path / "gw.toml").write_text(CONFIG + drive(keys=keys).replace("dt_s = 0.001", f"dt_s = {DT_S}"))
    done = subprocess.run([DAEMON, "--check", "gw.toml"], cwd=tmp_path, capture_output=True, text=True, timeout=20 * SLOW)
    assert done.returncode != 0 and words in done.stderr, done.stderr

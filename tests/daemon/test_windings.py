# SPDX-License-Identifier: Apache-2.0
"""Windings whose time constant is about the sample time: what is called valid lies within three half-widths of the truth."""
import json
import subprocess

import pytest
from gateway import BUILD, DAEMON, SLOW
from test_restart import entries


@pytest.mark.parametrize("structure", ["dc_circuit", "dc_drive", "pmsm_drive"])
def test_values_of_windings_at_1_kHz(tmp_path, structure):
    bad, seen, widths = [], {}, {}
    for seed in range(1, 5):
        folder = tmp_path / str(seed)
        folder.mkdir()
        subprocess.run([BUILD / "tools/sim/driveid-sim", "run", "--structure", structure, "--bus", "log:frames.log", "--seed", str(seed), "--rate", "1000", "--average", "--duration", "20",
                        "--truth", "truth.json", "--config", "gw.toml", "--socket", folder / "g.sock"], cwd=folder, check=True, capture_output=True, timeout=60 * SLOW)
        text = (folder / "gw.toml").read_text().replace("speed = 1.0", "speed = 0.0")
        (folder / "gw.toml").write_text(text.replace("[[source]]", '[record]\nfolder = "."\nfile = "out.drec"\n\n[[source]]', 1))
        subprocess.run([DAEMON, "gw.toml", "--exit-at-end"], cwd=folder, check=True, capture_output=True, timeout=60 * SLOW)
        truth = json.loads((folder / "truth.json").read_text())["phases"][0]["drive"]
        for estimate in (json.loads(payload) for kind, _, _, payload in entries(folder / "out.drec")[1] if kind == 6):
            for p in estimate["parameters"]:
                if not p["valid"]:
                    continue
                half, off = (p["interval"][1] - p["interval"][0]) / 2, p["value"] - truth[p["name"]]
                seen[p["name"]] = seen.get(p["name"], 0) + 1
                widths.setdefault(p["name"], []).append(half / truth[p["name"]])
                if abs(off) > 3 * half:
                    bad.append((p["name"], seed, round(off / half, 1)))
    # One answer in 300 of a normal error; these have been through a filter of seconds and come in runs.
    assert len(bad) <= 0.01 * sum(seen.values()), bad
    # Not bought by silence or width: an inductance whose voltage is a fifth of the resistance's is known to some 10 %.
    for name in ("R_ohm", "L_H", "L_d_H", "L_q_H"):
        if name in seen:
            assert seen[name] >= 400, (name, seen)
            assert sorted(widths[name])[len(widths[name]) // 2] < (0.01 if name == "R_ohm" else 0.15), name

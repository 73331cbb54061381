# SPDX-License-Identifier: Apache-2.0
"""Do the 95 % intervals of `driveid fit` hold the truth, on drives of tools/sim? Writes one row a cell to standard output.

    python docs/fit-intervals.py [DRIVES] [RATE_Hz]

Each cell fits the true model (its effect included) to DRIVES drives drawn at random; the truth is read after the fit. By hand: some seconds a drive.
"""
import json
import math
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import driveid

TOP = Path(__file__).resolve().parents[1]
SIM = TOP / "build" / "tools" / "sim" / "driveid-sim"
CELLS = [("rigid_axis", "none"), ("rigid_axis", "coulomb"), ("linear_axis", "coulomb"), ("dc_circuit", "none"), ("dc_circuit", "resistance_drift"),
         ("dc_circuit", "dead_time_voltage"), ("dc_drive", "none"), ("pmsm_drive", "none")]


def one(structure, effect, seed, rate, folder):
    out, truth = folder / "case", folder / "truth.json"
    subprocess.run([SIM, "case", "--seed", str(seed), "--structure", structure, "--effect", effect, "--size", "3", "--rate", str(rate), "--train-s", "12",
                    "--held-out-s", "2", "--out", out, "--truth", truth], check=True, capture_output=True)
    model = driveid.Model.new(structure, given=json.loads((out / "case.json").read_text())["given"])
    hidden = json.loads(truth.read_text())
    for e in hidden["effects"]:
        model = model.add(e["effect"])
    found = driveid.fit(model, driveid.read(out / "train.csv")).document["parameters"]
    return found, {name: value for name, value in hidden["drive"].items() if isinstance(value, float)}


def main():
    drives, rate = (int(a) for a in (sys.argv[1:] + ["40", "1000"][len(sys.argv) - 1:]))
    for structure, effect in CELLS:
        tally = defaultdict(list)   # (inside, error over half width, half width over value)
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(1, drives + 1):
                try:
                    found, truth = one(structure, effect, seed, rate, Path(folder))
                except driveid.DataError as refused:
                    print(f"{structure} {effect} {seed}: {refused}", file=sys.stderr)
                    continue
                for name, p in found.items():
                    if p["state"] != "free" or name not in truth:
                        continue
                    half = (p["interval"][1] - p["interval"][0]) / 2
                    tally[name].append((p["interval"][0] <= truth[name] <= p["interval"][1], abs(p["value"] - truth[name]) / half, half / abs(truth[name])))
        for name, rows in tally.items():
            rows_sorted = sorted(r[2] for r in rows)
            print(f"| {structure}, {effect} | `{name}` | {sum(r[0] for r in rows)} of {len(rows)} | {math.sqrt(sum((1.96 * r[1]) ** 2 for r in rows) / len(rows)):.1f} "
                  f"| {100 * rows_sorted[len(rows) // 2]:.2g} % |", flush=True)


if __name__ == "__main__":
    main()

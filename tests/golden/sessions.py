# SPDX-License-Identifier: Apache-2.0
"""Recorded sessions: frames, the database that describes them, the configuration, and the trajectory that was accepted.

    python tests/golden/sessions.py make      record the frames anew with driveid-sim (only when the simulator's frames should change)
    python tests/golden/sessions.py accept    write what driveidd answers now as the expectation: read the diff before committing it

One folder a session: frames.log (candump), frames.dbc, driveidd.toml, truth.json, expected-TYPE.json.
"""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cantools
import tomlkit

import drec

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = Path(os.environ.get("DRIVEID_BUILD", ROOT / "build"))
TYPES = ["f64", "f32", "q31"]
EVERY_S = 0.5
SPEED_RANGE_RAD_S = 500.0
# Options of driveid-sim for each session: classic and FD, both byte orders, three structures, a change of load.
MADE = {
    "rigid-classic": ["--structure", "rigid_axis", "--rate", "250", "--duration", "12", "--seed", "21", "--load-change-at", "6", "--factor", "1.5"],
    "dc-big-endian": ["--structure", "dc_drive", "--rate", "1000", "--duration", "4", "--seed", "31", "--big-endian"],
    "pmsm-fd": ["--structure", "pmsm_drive", "--rate", "1000", "--duration", "4", "--seed", "23", "--fd"],
}


def names():
    return sorted(folder.name for folder in HERE.iterdir() if (folder / "frames.log").is_file())


def make():
    for name, options in MADE.items():
        folder = HERE / name
        folder.mkdir(exist_ok=True)
        subprocess.run([BUILD / "tools/sim/driveid-sim", "run", "--bus", "log:frames.log", "--config", "driveidd.toml",
                        "--dbc", "frames.dbc", "--truth", "truth.json", *options], cwd=folder, check=True)
        write_config(folder, "socketcan", folder / "driveidd.toml")


def write_config(folder, kind, target, socket="control.sock", number_type="f64", record=None, interface="vcan0"):
    """The session's configuration with another source and other paths."""
    document = tomlkit.parse((folder / "driveidd.toml").read_text())
    fd = any("##" in line for line in (folder / "frames.log").open())
    document["control"] = {"socket": str(socket)}
    source = {"name": "bus", "kind": kind}
    source |= {"interface": interface, "fd": fd} if kind == "socketcan" else {"file": str(folder / "frames.log"), "speed": 0.0}
    document["source"] = tomlkit.aot()
    document["source"].append(tomlkit.item(source))
    for drive in document["drive"]:
        drive["type"] = number_type
        if number_type == "q31":
            declare_ranges(folder, drive)
        if kind == "socketcan":  # a player on a shared processor sends late and in bursts: the drive's counter is the clock
            drive |= {"paced": True, "gap_s": 0.05, "align_tolerance_s": 0.02, "counter": counter(folder)}
    if record:
        document["record"] = {"folder": str(record.parent), "file": record.name}
    target.write_text(tomlkit.dumps(document))


def declare_ranges(folder, drive):
    """q31 scales each signal by the range that is declared for it: half again the largest value of the session."""
    values = decoded(folder)
    drive["speed_range"] = SPEED_RANGE_RAD_S
    for signal in drive["signal"]:
        signal["range"] = float(f"{1.5 * max(map(abs, values[signal['name']])) or 1.0:.1e}")  # a signal that is always 0 needs one too


def counter(folder):
    """Where the drive's counter stands in its frames, by the database."""
    message, signal = next((m, s) for m in database(folder).messages for s in m.signals if s.name == "counter")
    return {"source": "bus", "can_id": message.frame_id, "start_bit": signal.start, "length": signal.length, "byte_order": signal.byte_order.split("_")[0]}


def database(folder):
    return cantools.database.load_file(folder / "frames.dbc")


def replay(folder, number_type, work):
    """The record that driveidd writes while it replays the session as fast as it can."""
    config, record = work / "replay.toml", work / f"{folder.name}-{number_type}.drec"
    write_config(folder, "replay", config, socket=work / "c.sock", number_type=number_type, record=record)
    done = subprocess.run([BUILD / "daemon/driveidd", config, "--exit-at-end"], cwd=work, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return record


def trajectory(record):
    """The estimate at every half second: time since the first sample, state, and each parameter's value, interval, validity."""
    first = next(drec.samples(record))[0]
    rows, due = [], EVERY_S
    for t_ns, estimate in drec.estimates(record):
        t_s = (t_ns - first) * 1e-9
        if t_s + 1e-9 >= due:
            due += EVERY_S * (1 + int((t_s - due) / EVERY_S))
            rows.append({"t_s": round(t_s, 6), "state": estimate["state"],
                         "parameters": {p["name"]: [p["value"], *(p["interval"] or [None, None]), p["valid"]] for p in estimate["parameters"]}})
    return rows


def decoded(folder):
    """{signal: [values in the order of the frames]} by cantools."""
    messages, out = database(folder), {}
    for identifier, data in frames(folder):
        for signal, value in messages.decode_message(identifier, data).items():
            out.setdefault(signal, []).append(value)
    return out


def frames(folder):
    """(identifier, data) of every frame of the log."""
    for line in (folder / "frames.log").read_text().splitlines():
        identifier, data = line.split()[2].split("#", 1)
        yield int(identifier, 16), bytes.fromhex(data[2:] if data.startswith("#") else data)  # FD: one flag digit after a second '#'


def same(a, b):
    """A scale is applied by one multiplication here and there: the last few bits may differ."""
    return abs(a - b) <= 4e-15 * max(abs(a), abs(b), 1e-6)


def disagreement(record, folder, lost=0.0):
    """Sentence about the first signal whose decoded values are not, in order, those of cantools, or None. lost: share that may be missing."""
    expected, got = decoded(folder), list(drec.samples(record))
    used = set().union(*(values for _, values in got)) if got else set()
    if not used:
        return "no samples"
    for signal in sorted(used):
        mine, theirs = [values[signal] for _, values in got if signal in values], expected[signal]
        if len(mine) < (1 - lost) * len(theirs):
            return f"{signal}: {len(mine)} values, {len(theirs)} were sent"
        rest = iter(theirs)
        for k, value in enumerate(mine):
            if not any(same(value, other) for other in rest):
                return f"{signal}: value {k}, {value}, was not sent, or not in this order"
    return None


def accept():
    for name in names():
        for number_type in TYPES:
            with tempfile.TemporaryDirectory() as work:
                rows = trajectory(replay(HERE / name, number_type, Path(work)))
            lines = ",\n".join(json.dumps(row) for row in rows)
            (HERE / name / f"expected-{number_type}.json").write_text(f"[\n{lines}\n]\n")
            print(f"{name} {number_type}: {len(rows)} rows, last {rows[-1]}")


if __name__ == "__main__":
    {"make": make, "accept": accept}[sys.argv[1]]()

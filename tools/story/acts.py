# SPDX-License-Identifier: Apache-2.0
"""The acts of the main job, played on a bus that is there: identify, follow a change of load, replay a recorded drive; hidden.py has the last one."""
import json
import os
import random
import shutil
import socket
import subprocess
import tempfile
import time
from pathlib import Path

from gateway import Control, Programs
from hidden import hidden_act
from common import DAEMON, SIM, TOP, free_port, pace, rate_on, steadily, wait_for, watch
from table import Screen, console, judged

def play(given):
    folder = Path(tempfile.mkdtemp(prefix="driveid-run-"))
    # A Unix socket's path is short; a folder of our own keeps others out.
    try:
        with Programs(folder) as programs:
            verdicts = [*live_acts(given, programs), replay_act(given, programs), *hidden_act(given, programs)]
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    console.print()
    for passed, sentence in verdicts:
        console.print(("PASSED  " if passed else "FAILED  ") + sentence, style="green" if passed else "red")
    return 0 if all(passed for passed, _ in verdicts) else 1


def misses(drive, truth):
    """Sentence for every true value that the estimate does not meet."""
    shown = {p["name"]: p for p in drive["parameters"]}
    for name, value in truth.items():
        within, sentence = judged(shown[name], value) if name in shown else (False, "not reported")
        if not within:
            yield f"{name}: {sentence}"


def verdict(act, drive, truth, finished):
    bad = list(misses(drive, truth))
    if bad or not finished:
        return False, f"{act}: " + ("; ".join(bad) or "not steady in time")
    return True, f"{act}: every true value within 3 half-widths and 5 % ({', '.join(truth)})"


def live_acts(given, programs):
    """A simulated drive on the bus: identified, then its load changes and the estimate follows."""
    folder, luck = programs.folder, random.Random(given.seed)
    on_can = given.inside == "vcan"
    address = "can:vcan0" if on_can else f"modbus:127.0.0.1:{free_port()}"
    rate_Hz = rate_on(given)
    factor, change_s = luck.choice([0.6, 0.7, 1.4, 1.7, 2.0]), given.seconds
    console.print(f"drive: rigid_axis drawn from seed {given.seed}, on {address}; its load inertia changes by a factor {factor:g} after {change_s:g} s")
    programs.start("driveid-sim", [SIM, "run", "--bus", address, "--seed", given.seed, "--rate", rate_Hz, "--average", "--load-change-at", change_s,
                                   "--factor", factor, "--truth", "truth.json", "--config", "driveidd.toml", "--socket", folder / "control.sock"])
    wait_for((folder / "truth.json").exists, 15, "the simulated drive's start", programs.check)
    began = time.monotonic()
    if on_can:
        pace(folder / "driveidd.toml")
    programs.start("driveidd", [DAEMON, "driveidd.toml"])
    control = Control(folder / "control.sock", check=programs.check)
    phases = json.loads((folder / "truth.json").read_text())["phases"]
    names = [p["name"] for p in control.ask("status")["drives"][0]["parameters"]]
    before, after = ({name: phase["drive"][name] for name in phase["drive"] if name in names or name in ("J_kgm2", "B_Nms_rad")} for phase in phases)

    drive, finished = watch(control, programs, "a drive on the bus", before, change_s - 2, steadily(lambda d: not any(misses(d, before)), 3))
    yield verdict("identified while it runs", drive, before, finished)
    left = change_s - (time.monotonic() - began)
    watch(control, programs, "waiting for the load to change", before, max(0, left), lambda *_: False)
    drive, finished = watch(control, programs, f"the load inertia is now {factor:g} times what it was", after, given.seconds, steadily(lambda d: not any(misses(d, after)), 3))
    yield verdict("followed the change of load", drive, after, finished)
    control.close()
    programs.stop_all()


EMPS = TOP.parent / "shared/data/emps/emps_train.csv"
# Published for this machine (Janot, Gautier, Brunot 2019). No truth: shown beside the estimates, and the mass, which others found alike, is judged.
EMPS_PUBLISHED = {"m_kg": 95.1, "b_Ns_m": 203.5, "F_c_N": 20.4, "F_0_N": -3.16}


def replay_act(given, programs):
    """A recorded drive, replayed from its frames, on the bus where the bus is CAN."""
    folder, on_can = programs.folder, given.inside == "vcan"
    source = given.record or (EMPS if EMPS.exists() else TOP / "tests/golden/readme/run1.csv")
    model = folder / "emps-model.toml"
    driveid = TOP / ".venv/bin/driveid"
    for command in ([driveid, "model", "new", "linear_axis", "-o", model], [driveid, "add", model, "coulomb", "-o", model], [driveid, "add", model, "constant_load", "-o", model]):
        subprocess.run(command, check=True, capture_output=True)
    console.print(f"recorded drive: {source}, as frames")
    subprocess.run([SIM, "frames", source, "--map", "F_N=force_N", "--map", "x_m=q_meas_m", "--structure", "linear_axis", "--model", model, "--log", "frames.log",
                    "--config", "replay.toml", "--socket", folder / "replay.sock", "--interface", "vcan1", *(["--live"] if on_can else [])], cwd=folder, check=True, capture_output=True)
    if on_can:
        pace(folder / "replay.toml")
    programs.start("driveidd-replay", [DAEMON, "replay.toml"])
    control = Control(folder / "replay.sock", check=programs.check)
    if on_can:
        programs.start("canplayer", ["canplayer", "-I", "frames.log"])
    seconds = 60
    drive, finished = watch(control, programs, "a recorded machine, replayed from its frames (published values at the right)", EMPS_PUBLISHED, seconds,
                            lambda d, t_s: d["samples"] >= 24800 or d["state"] == "stale")
    control.close()
    shown = {p["name"]: p for p in drive["parameters"]}
    trusted = [name for name, p in shown.items() if p["valid"]]
    off = abs(shown["m_kg"]["value"] / EMPS_PUBLISHED["m_kg"] - 1) if "m_kg" in trusted else 1.0
    sentence = f"recorded drive replayed from its frames: {drive['samples']} samples; trusted: {', '.join(trusted) or 'nothing'}; mass {100 * off:.1f} % off the published one"
    return finished and set(EMPS_PUBLISHED) <= set(trusted) and off <= 0.05, sentence

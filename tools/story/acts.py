# SPDX-License-Identifier: Apache-2.0
"""The acts of the main job, played on a bus that is there: identify, follow a change of load, replay a recorded drive."""
import json
import os
import random
import shutil
import tempfile
import time
from pathlib import Path

import tomlkit

from gateway import Control, Programs
from table import Screen, console, judged

TOP = Path(__file__).resolve().parents[2]
SIM, DAEMON = TOP / "build/tools/sim/driveid-sim", TOP / "build/daemon/driveidd"


def play(given):
    folder = Path(tempfile.mkdtemp(prefix="driveid-run-"))
    # A Unix socket's path is short; a folder of our own keeps others out.
    try:
        with Programs(folder) as programs:
            verdicts = [*live_acts(given, programs), replay_act(given, programs)]
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    console.print()
    for passed, sentence in verdicts:
        console.print(("PASSED  " if passed else "FAILED  ") + sentence, style="green" if passed else "red")
    return 0 if all(passed for passed, _ in verdicts) else 1


def prepare(config, folder):
    """The configuration that the simulator wrote, with sockets and records in our folder."""
    document = tomlkit.parse(config.read_text())
    document["control"] = {"socket": str(folder / "control.sock"), "mode": "0600"}
    document["record"] = {"folder": str(folder)}
    config.write_text(tomlkit.dumps(document))
    return folder / "control.sock"


def wait_for(condition, patience_s, what, check):
    until = time.monotonic() + patience_s
    while not condition():
        check()
        if time.monotonic() > until:
            raise TimeoutError(f"{what} did not happen within {patience_s:g} s")
        time.sleep(0.02)


def all_within(drive, truth):
    shown = {p["name"]: p for p in drive["parameters"]}
    return all(name in shown and judged(shown[name], value)[0] for name, value in truth.items())


def watch(control, programs, title, truth, seconds, done):
    """Show the first drive until done(drive, t_s) or the time is up; its last state, and whether it was done."""
    started, finished = time.monotonic(), False
    with Screen(title) as screen:
        while True:
            programs.check()
            drive, t_s = control.ask("status")["drives"][0], time.monotonic() - started
            finished = done(drive, t_s)
            over = finished or t_s > seconds
            screen.show(drive, truth, t_s, final=over)
            if over:
                return drive, finished
            time.sleep(0.1)


def steadily(condition, seconds):
    """A condition that has held for so long."""
    since = None

    def held(drive, t_s):
        nonlocal since
        if not condition(drive):
            since = None
        elif since is None:
            since = t_s
        return since is not None and t_s - since >= seconds

    return held


def verdict(act, drive, truth, finished):
    shown = {p["name"]: p for p in drive["parameters"]}
    bad = [f"{name}: {judged(shown[name], value)[1]}" if name in shown else f"{name}: not reported"
           for name, value in truth.items() if name not in shown or not judged(shown[name], value)[0]]
    if bad or not finished:
        return False, f"{act}: " + ("; ".join(bad) or "not steady in time")
    return True, f"{act}: every true value within 3 half-widths and 5 %"

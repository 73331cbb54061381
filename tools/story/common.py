# SPDX-License-Identifier: Apache-2.0
"""What the acts share: where the programs are, and waiting while a person watches."""
import os
import socket
import time
from pathlib import Path

from table import Screen

TOP = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("DRIVEID_BUILD", TOP / "build"))
SIM, DAEMON, DRIVEID = BUILD / "tools/sim/driveid-sim", BUILD / "daemon/driveidd", TOP / ".venv/bin/driveid"


def rate_on(given):
    """Samples per second that this bus carries without strain."""
    return {"native": 1000, "uml": 500}.get(os.environ.get("VCAN_KIND"), 250) if given.inside == "vcan" else 250


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def pace(config):
    """Say that the drive samples exactly: the sender shares this processor, and its frames leave late, by its scheduler's whim."""
    config.write_text(config.read_text().replace("\ndt_s =", "\npaced = true\ngap_s = 0.05\ndt_s ="))


def wait_for(condition, patience_s, what, check):
    until = time.monotonic() + patience_s
    while not condition():
        check()
        if time.monotonic() > until:
            raise TimeoutError(f"{what} did not happen within {patience_s:g} s")
        time.sleep(0.02)


def watch(control, programs, title, truth, seconds, done):
    """Show the first drive until done(drive, t_s) or the time is up; its last state, and whether it was done."""
    started = time.monotonic()
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

# SPDX-License-Identifier: Apache-2.0
"""What can only be seen from inside the process: allocations while samples flow, and kill -9 at every step of saving the state."""
import fcntl
import json
import os
import struct
import termios
import time
from pathlib import Path

import pytest
from gateway import ROOT, SLOW, SOCKETPAIR, Axis, drive, near_truth, parameters

SHIM = Path(os.environ.get("DRIVEID_BUILD", ROOT / "build")) / "tests/daemon/libdaemon_shim.so"
STATE = '[state]\nfolder = "state"\nperiod_s = 0.1\n'
SAVING_STEPS = 7  # open, write, fsync, rename, rename, open the folder, fsync
pytestmark = pytest.mark.skipif(not SHIM.exists() or "DRIVEIDD" in os.environ, reason="SKIPPED BECAUSE this build has no shim (sanitizers bring their own allocator)")


def preload(**more):
    return {"LD_PRELOAD": str(SHIM)} | {k: str(v) for k, v in more.items()}


def allocations(path):
    return struct.unpack("<Q", path.read_bytes())[0]


SINKS = """
[[sink]]
name = "out"
kind = "can"
source = "bus1"
drive = "axis1"
can_id = 0x5A0
period_s = 0.02
[[sink]]
name = "rec"
kind = "record"
file = "all.drec"
"""


def taken(bus):
    """The daemon has read everything that was sent to it: SIOCOUTQ."""
    return struct.unpack("i", fcntl.ioctl(bus, termios.TIOCOUTQ, bytes(4)))[0] == 0


def test_nothing_is_allocated_on_the_sample_path(gateway):
    """Two drives with their estimators and watches, frames out, a record: the whole process, all its threads, once it has settled."""
    count = gateway.folder / "count"
    count.write_bytes(bytes(8))
    ranges = {'name = "i_q_A"\n': 'name = "i_q_A"\n  range = 4\n', 'name = "theta_rad"\n': 'name = "theta_rad"\n  range = 500\n'}
    fixed = drive("axis2", can_id=0x182, type="q31", keys="stale_s = 1000")
    for plain, ranged in ranges.items():
        fixed = fixed.replace(plain, ranged)
    text = '[record]\nfolder = "."\n' + SOCKETPAIR + SOCKETPAIR.replace('"bus"', '"bus1"').replace("10", "11") + drive(keys="stale_s = 1000") + fixed + SINKS
    gateway.start(text, buses=2, env=preload(DRIVEID_SHIM_COUNT=count))
    assert allocations(count) > 100, "the shim counts"
    axes = [Axis(), Axis(can_id=0x182)]
    starts = [gateway.feed(axis, 3000) for axis in axes]
    gateway.settle(6000)
    time.sleep(0.1)
    before = allocations(count)
    for axis, start in zip(axes, starts):
        gateway.feed(axis, 4000, start)
    ends = time.monotonic() + 30 * SLOW
    while not taken(gateway.bus[0]):
        assert time.monotonic() < ends, "the daemon does not read its bus"
        time.sleep(0.01)
    time.sleep(0.3)
    after = allocations(count)
    status = gateway.settle(14000)
    assert near_truth(status) and [d["samples"] for d in status["drives"]] == [7000, 7000]
    assert status["sinks"][0]["sent"] > 0 and status["sinks"][1]["sent"] >= 14000
    assert after == before


@pytest.mark.parametrize("step", range(1, SAVING_STEPS + 1))
def test_kill_at_every_step_of_saving_loses_nothing(gateway, step):
    state = gateway.folder / "state"
    state.mkdir()
    text = STATE + SOCKETPAIR + drive(keys="stale_s = 1000")
    gateway.start(text)
    gateway.feed(Axis(), 6000)
    gateway.settle(6000)
    known = parameters(gateway.until(near_truth))
    gateway.until(lambda s: (state / "state.old").exists() and "J_kgm2" in (state / "state.old").read_text(), 10, "two saved states")
    assert gateway.stop() == 0
    saved = json.loads((state / "state").read_text().split("\n", 1)[1])["drives"][0]
    assert len(saved["covariance"]) == len(saved["theta"]) ** 2 > 0

    gateway.start(text, wait=False, security='[security]\nseccomp = "off"\n', env=preload(DRIVEID_SHIM_KILL=step))
    assert gateway.process.wait(20) == -9, gateway.text()
    gateway.start(text)
    after = parameters(gateway.status())
    for name in known:
        assert after[name]["value"] == pytest.approx(known[name]["value"], rel=1e-3) and not after[name]["valid"] and after[name]["age_s"] > 0
    assert gateway.stop() == 0
    again = json.loads((state / "state").read_text().split("\n", 1)[1])["drives"][0]
    assert again["theta"] == saved["theta"] and again["covariance"] == saved["covariance"], "the covariance outlives two restarts"


def test_the_steps_are_all_of_them(gateway):
    """One step more than there are and the daemon has saved once, whole."""
    (gateway.folder / "state").mkdir()
    gateway.start(STATE + SOCKETPAIR + drive(), wait=False, security='[security]\nseccomp = "off"\n', env=preload(DRIVEID_SHIM_KILL=SAVING_STEPS + 1))
    assert gateway.process.wait(20) == -9
    assert (gateway.folder / "state/state").read_text().startswith("driveid-state 1 ")
    assert not (gateway.folder / "state/state.tmp").exists()

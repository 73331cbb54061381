# SPDX-License-Identifier: Apache-2.0
"""What the process is allowed, how it is scheduled, and how it says what goes wrong."""
import os
import pwd
import re
import time

import pytest
from gateway import SOCKETPAIR, Axis, drive, frame

root = pytest.mark.skipif(os.geteuid() != 0, reason="SKIPPED BECAUSE only root can become another user")


def state_of(process):
    return dict(line.split(":\t", 1) for line in open(f"/proc/{process.pid}/status").read().splitlines() if ":\t" in line)


@root
def test_own_user_no_capabilities_and_a_filter_of_system_calls(gateway):
    os.chmod(gateway.folder, 0o777)
    gateway.start(SOCKETPAIR + drive(), security='[security]\nuser = "nobody"\nseccomp = "on"\n')
    state = state_of(gateway.process)
    nobody = pwd.getpwnam("nobody")
    assert state["Uid"].split() == [str(nobody.pw_uid)] * 4 and state["Gid"].split() == [str(nobody.pw_gid)] * 4
    assert all(int(state[name], 16) == 0 for name in ("CapEff", "CapPrm", "CapInh", "CapAmb"))
    assert state["NoNewPrivs"] == "1"
    assert state["Seccomp"] == ("0" if os.environ.get("DRIVEID_SECCOMP") == "off" else "2")
    gateway.feed(Axis(), 100)
    gateway.settle(100)


def test_without_a_user_it_still_keeps_no_capability(gateway):
    gateway.start(SOCKETPAIR + drive())
    assert int(state_of(gateway.process)["CapEff"], 16) == 0


def test_an_unknown_user_is_refused_with_its_mend(gateway):
    gateway.start(SOCKETPAIR + drive(), wait=False, security='[security]\nuser = "no_such_user"\n')
    assert gateway.process.wait(20) != 0 and "no user" in gateway.text() and "create it" in gateway.text()


@root
def test_locked_memory_beyond_the_limit_is_told_with_its_mend(gateway):
    """Who may not raise the limit hears of it at start, not by an allocation that fails some day."""
    without = "-sys_resource,-ipc_lock"
    prefix = ("setpriv", f"--inh-caps={without}", f"--bounding-set={without}", "bash", "-c", 'ulimit -l 1024; exec "$@"', "bash")
    gateway.start("[system]\nlock_memory = true\n" + SOCKETPAIR + drive(), wait=False, prefix=prefix)
    assert gateway.process.wait(20) != 0 and "LimitMEMLOCK=infinity" in gateway.text(), gateway.text()


def test_a_flood_of_one_fault_is_a_few_lines_with_count_and_mend(gateway):
    gateway.start(SOCKETPAIR + drive(keys="stale_s = 1000"))
    wrong = frame(0x181, bytes(12), 1, fd=True)
    for _ in range(3000):
        gateway.bus[0].send(wrong)
    gateway.settle(3000)
    lines = [line for line in gateway.text().splitlines() if "no classic frame" in line]
    assert 1 <= len(lines) <= 10, len(lines)
    assert all(re.search(r"level=warning component=bus count=\d+ .*mend=\"set fd = true", line) for line in lines), lines[0]
    ends = time.monotonic() + 30
    while not any(int(re.search(r"count=(\d+)", line)[1]) > 1 for line in gateway.text().splitlines() if "no classic frame" in line):
        assert time.monotonic() < ends, "those that were kept back are counted in a later line"
        gateway.bus[0].send(wrong)
        time.sleep(0.5)

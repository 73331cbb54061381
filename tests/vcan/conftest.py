# SPDX-License-Identifier: Apache-2.0
"""A gateway on the machine's CAN interfaces. DRIVEID_DAEMON names another daemon (a sanitizer's build)."""
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "tests"), str(ROOT / "tools" / "story"), str(ROOT / "tests" / "golden")]
from gateway import Control, Programs  # noqa: E402
from faults import pytest_terminal_summary  # noqa: E402, F401

BUILD = Path(os.environ.get("DRIVEID_BUILD", ROOT / "build"))
DAEMON = Path(os.environ.get("DRIVEID_DAEMON", BUILD / "daemon/driveidd"))
SIM = BUILD / "tools/sim/driveid-sim"
BLAST = BUILD / "tools/bench_gateway/can_blast"


class Gateway:
    def __init__(self, folder, programs):
        self.folder, self.programs, self.control, self.daemon = folder, programs, None, None

    def simulate(self, *options, config="driveidd.toml"):
        """A simulated drive; returns once its configuration is written."""
        program = self.programs.start("driveid-sim", [SIM, "run", "--truth", "truth.json", "--config", config, "--socket", self.folder / "c.sock", *options])
        until = time.monotonic() + 20
        while not (self.folder / "truth.json").exists():
            self.programs.check()
            assert time.monotonic() < until, "driveid-sim does not start"
            time.sleep(0.02)
        return program

    def listen(self, config="driveidd.toml", command=(), wait=True):
        if os.environ.get("DRIVEID_SECCOMP") == "off":  # a build for coverage writes its counts at the end
            text = (self.folder / config).read_text()
            if "[security]" not in text:
                (self.folder / config).write_text(text + '\n[security]\nseccomp = "off"\n')
        self.daemon = self.programs.start("driveidd", [*command, DAEMON, config])
        self.control = Control(self.folder / "c.sock", patience_s=60, check=self.programs.check)
        # It answers before its buses are open, and what is sent in between nobody hears.
        if wait:
            self.until(lambda s: all(source["state"] == "open" for source in s["sources"]), 60, "the buses being open")

    def status(self):
        return self.control.ask("status", timeout_s=30)

    def until(self, condition, seconds=30.0, what="what was waited for"):
        """Status as soon as condition(status) holds."""
        ends = time.monotonic() + seconds
        while True:
            self.programs.check()
            status = self.status()
            if condition(status):
                return status
            assert time.monotonic() < ends, f"{what} did not happen within {seconds} s: {status}"
            time.sleep(0.1)

    def log(self):
        return self.programs.tail("driveidd", 200)


@pytest.fixture
def gateway(tmp_path):
    with Programs(tmp_path) as programs:
        yield Gateway(tmp_path, programs)


@pytest.fixture(autouse=True)
def interfaces_as_they_were():
    yield
    for k in range(3):
        subprocess.run(["tc", "qdisc", "del", "dev", f"vcan{k}", "root"], capture_output=True)
        subprocess.run(["ip", "link", "set", f"vcan{k}", "up"], check=True)

# SPDX-License-Identifier: Apache-2.0
"""`driveid record` while the gateway dies, comes back, or is told by somebody else to stop."""
import grp
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from gateway import SOCKETPAIR, SLOW, drive

WRITERS = f'write_group = "{grp.getgrgid(os.getgid()).gr_name}"'


class Recorder:
    def __init__(self, gateway):
        self.process = subprocess.Popen([Path(sys.executable).with_name("driveid"), "record", "run", "--socket", str(gateway.socket)], text=True, stdin=subprocess.DEVNULL,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        gateway.until(lambda s: s["record"] is not None, 20, "the record")

    def end(self):
        """(exit code, standard error)"""
        _, err = self.process.communicate(timeout=30 * SLOW)
        return self.process.returncode, err


@pytest.fixture
def recorder(gateway):
    gateway.start(SOCKETPAIR + drive() + f'[record]\nfolder = "{gateway.folder}"\n', control=WRITERS)
    r = Recorder(gateway)
    yield r
    if r.process.poll() is None:
        r.process.kill()
    r.process.communicate()


def test_a_gateway_that_dies_is_noticed(gateway, recorder):
    gateway.process.kill()
    gateway.process.wait()
    code, err = recorder.end()
    assert code == 2 and "holds what was recorded until then" in err and "it has not come back" in err and "Traceback" not in err, err


def test_a_gateway_that_comes_back_and_does_not_record_is_told(gateway, recorder):
    gateway.process.kill()
    gateway.process.wait()
    gateway.start()
    code, err = recorder.end()
    assert code == 2 and "does not record: start the record again" in err, err


def test_a_record_that_somebody_else_stops(gateway, recorder):
    assert gateway.control().ask("record_stop")["ok"]
    code, err = recorder.end()
    assert code == 2 and "somebody else has stopped it" in err, err


def test_a_reload_that_goes_on_in_another_file_is_followed(gateway, recorder):
    before = gateway.status()["record"]["file"]
    gateway.write(SOCKETPAIR + drive(name="other") + f'[record]\nfolder = "{gateway.folder}"\n', control=WRITERS)
    assert gateway.control().ask("reload")["ok"]
    gateway.until(lambda s: s["record"] and s["record"]["file"] != before, 20, "the next file")
    time.sleep(1.2)  # two looks of the command
    assert recorder.process.poll() is None
    recorder.process.send_signal(signal.SIGINT)
    code, err = recorder.end()
    assert code == 0 and "goes on in" in err and gateway.status()["record"] is None, err


def test_a_record_of_so_many_seconds(gateway):
    gateway.start(SOCKETPAIR + drive() + f'[record]\nfolder = "{gateway.folder}"\n', control=WRITERS)
    began = time.monotonic()
    done = subprocess.run([Path(sys.executable).with_name("driveid"), "record", "run", "--socket", str(gateway.socket), "--seconds", "1.2"], capture_output=True, text=True,
                          stdin=subprocess.DEVNULL, timeout=60 * SLOW)
    assert done.returncode == 0 and Path(done.stdout.strip()).is_file() and time.monotonic() - began >= 1.2, done.stderr
    assert gateway.status()["record"] is None

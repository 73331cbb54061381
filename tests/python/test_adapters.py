# SPDX-License-Identifier: Apache-2.0
"""Serial CAN adapters as a laptop has them: record and replay through the command line, over pseudo-terminals."""

import os
import re
import select
import subprocess
import sys
import threading
import time
import tty
from pathlib import Path

import pytest

from driveid.records import drec

COMMAND = [str(Path(sys.executable).with_name("driveid"))]


class Wire:
    """Two pseudo-terminals: what one program writes, the other reads; as two adapters on one bus."""

    def __init__(self):
        self.pairs = [os.openpty() for _ in range(2)]
        for fd in sum(self.pairs, ()):
            tty.setraw(fd)
        self.ports = [os.ttyname(slave) for _, slave in self.pairs]
        self.ends = os.pipe()
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        (a, _), (b, _) = self.pairs
        while True:
            for fd in select.select([a, b, self.ends[0]], [], [])[0]:
                if fd == self.ends[0]:
                    return
                os.write(b if fd == a else a, os.read(fd, 4096))

    def close(self):
        os.write(self.ends[1], b"x")
        self.thread.join(5)
        for fd in (*sum(self.pairs, ()), *self.ends):
            os.close(fd)


@pytest.fixture
def wire():
    wire = Wire()
    yield wire
    wire.close()


@pytest.fixture
def recorder(tmp_path):
    """Starts `driveid record`, waits until it listens; gives the process."""
    started = []

    def start(*words):
        process = subprocess.Popen([*COMMAND, "record", *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        started.append(process)
        assert "recording" in process.stderr.readline()
        return process
    yield start
    for process in started:
        process.kill()
        process.communicate()


def frames_of(path):
    if not path.exists() or not path.stat().st_size:
        return []
    return [e.can() for e in drec.of_kind(drec.parse(path, path.read_bytes()).entries, drec.CAN)]


@pytest.mark.parametrize("interface", ["slcan", "serial"])
def test_record_and_replay_through_a_serial_adapter(tmp_path, wire, recorder, interface):
    sent = [(0x100 + k if k % 3 else 0x98FEF100 + k, 0, bytes([k] * (k % 9))) for k in range(60)]
    (tmp_path / "a.log").write_text("\n".join(f"({1_700_000_000 + 0.01 * k:.6f}) can0 {i & 0x1FFFFFFF:0{8 if i >> 31 else 3}X}#{d.hex()}" for k, (i, _, d) in enumerate(sent)))
    recording = recorder("r.drec", "--bus", f"{interface}:{wire.ports[1]}", "--seconds", "20")
    played = subprocess.run([*COMMAND, "replay", "a.log", "--to", f"{interface}:{wire.ports[0]}"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert played.returncode == 0 and "60 frames in 0." in played.stderr, played.stderr
    end = time.monotonic() + 15
    while len(frames_of(tmp_path / "r.drec")) < 60 and time.monotonic() < end:
        time.sleep(0.2)
    recording.send_signal(2)
    assert recording.wait(20) == 0
    assert frames_of(tmp_path / "r.drec") == sent
    assert "60 frames" in recording.stderr.read()


def test_adapter_that_is_pulled_out_is_waited_for(tmp_path, recorder):
    """Hang-up of the terminal in the middle of a line, garbage that is no ASCII, and another terminal under the same name."""
    port, slaves = tmp_path / "adapter", []

    def plug():
        master, slave = os.openpty()
        tty.setraw(master), tty.setraw(slave)
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(slave))
        slaves.append(slave)
        return master

    def until(condition, what):
        end = time.monotonic() + 20
        while not condition():
            assert time.monotonic() < end, what
            time.sleep(0.05)

    def heard(fd):
        return select.select([fd], [], [], 0)[0] and b"O\r" in os.read(fd, 4096)

    first = plug()
    recording = recorder("r.drec", "--bus", f"slcan:{port}", "--bitrate", "500000")
    until(lambda: heard(first), "the adapter was not opened")
    os.write(first, b"t1230\r\xff\xfe\rt12311A\rT0000")
    until(lambda: len(frames_of(tmp_path / "r.drec")) == 2, "two frames")
    os.close(first)
    assert "is gone" in recording.stderr.readline()
    second = plug()
    until(lambda: heard(second), "the adapter was not opened again")
    assert "is back" in recording.stderr.readline()
    os.write(second, b"t1242BEEF\r")
    until(lambda: len(frames_of(tmp_path / "r.drec")) == 3, "the third frame")
    recording.send_signal(2)
    assert recording.wait(20) == 0
    told = recording.stderr.read()
    assert re.search("3 frames.*1 unreadable lines.*came back 1 times", told), told
    assert frames_of(tmp_path / "r.drec") == [(0x123, 0, b""), (0x123, 0, b"\x1a"), (0x124, 0, b"\xbe\xef")]
    events = [e.json()["text"] for e in drec.of_kind(drec.parse(tmp_path / "r.drec", (tmp_path / "r.drec").read_bytes()).entries, drec.EVENT)]
    assert len(events) == 2 and "gone" in events[0] and "back" in events[1]
    for fd in (second, *slaves):
        os.close(fd)

# SPDX-License-Identifier: Apache-2.0
"""Record from and replay to an adapter, over python-can's virtual bus and an slcan line on a pty."""

import os
import threading
import time
import tty

import can
import numpy as np
import pytest

from driveid import bus as adapters
from driveid.errors import DriveidError, FileError, UsageError
from driveid.records import drec


def test_record_from_a_bus(tmp_path):
    sender, receiver = can.Bus("rec", interface="virtual"), can.Bus("rec", interface="virtual")
    messages = [can.Message(arbitration_id=0x18FEF100 + k, data=bytes([k]) * 8, is_extended_id=True) for k in range(50)]

    def play():
        for m in messages:
            sender.send(m)
            time.sleep(0.002)
    before = time.monotonic_ns()
    thread = threading.Thread(target=play)
    thread.start()
    told = adapters.record(receiver, tmp_path / "r.drec", "virtual:rec", seconds=0.6)
    thread.join()
    file = drec.parse(tmp_path / "r.drec", (tmp_path / "r.drec").read_bytes())
    assert told.frames == 50 == len(file.entries) and file.skipped == 0
    assert [e.can()[0] for e in file.entries] == [0x80000000 | m.arbitration_id for m in messages]
    assert [e.can()[2] for e in file.entries] == [bytes(m.data) for m in messages]
    t = np.array([e.t_ns for e in file.entries])
    assert np.all(np.diff(t) > 0) and t[0] >= before and t[-1] <= time.monotonic_ns()
    with pytest.raises(FileError, match="exists already"):
        adapters.record(receiver, tmp_path / "r.drec", "virtual:rec", seconds=0.1)
    sender.shutdown(), receiver.shutdown()


def test_replay_keeps_absolute_deadlines(tmp_path):
    lines = [f"({1_700_000_000 + 0.004 * k:.6f}) can0 {0x100 + k:03X}#{k:02X}" for k in range(100)]
    (tmp_path / "a.log").write_text("\n".join(lines))
    frames = adapters.load_frames(tmp_path / "a.log")
    sender, receiver = can.Bus("rep", interface="virtual"), can.Bus("rep", interface="virtual")
    sent = adapters.send(sender, frames)
    got = [receiver.recv(0.1) for _ in frames]
    assert [m.arbitration_id for m in got] == [0x100 + k for k in range(100)]
    # 99 intervals of 4 ms: whatever a loaded machine adds is told as lateness, and it does not add up.
    assert 0.396 <= sent.seconds <= 0.396 + sent.late_max_s + 0.1
    assert 0 <= sent.late_median_s <= sent.late_max_s
    assert adapters.send(sender, frames, speed=0).frames == 100
    assert adapters.send(sender, frames, speed=10).seconds >= 0.0396
    sender.shutdown(), receiver.shutdown()


def test_a_record_goes_round(tmp_path):
    """What was recorded as .drec is sent with the same frames, flags and spacing."""
    with drec.DrecWriter(tmp_path / "a.drec", []) as w:
        w.can(1_000_000_000, 0x123, b"\x01\x02")
        w.can(1_010_000_000, 0x9ABCDEF0, bytes(range(20)), fd_flags=3)
    sender, receiver = can.Bus("round", interface="virtual"), can.Bus("round", interface="virtual")
    adapters.send(sender, adapters.load_frames(tmp_path / "a.drec"))
    a, b = receiver.recv(0.2), receiver.recv(0.2)
    assert (a.arbitration_id, a.is_extended_id, bytes(a.data)) == (0x123, False, b"\x01\x02")
    assert (b.arbitration_id, b.is_extended_id, b.is_fd, b.bitrate_switch, bytes(b.data)) == (0x1ABCDEF0, True, True, True, bytes(range(20)))
    sender.shutdown(), receiver.shutdown()


def test_slcan_line_with_garbage(tmp_path):
    """A serial adapter that stutters: bad lines are counted, good ones kept."""
    master, slave = os.openpty()
    tty.setraw(master), tty.setraw(slave)
    bus = adapters.open_bus(f"slcan:{os.ttyname(slave)}", bitrate=500000)

    def play():
        time.sleep(0.15)
        for k in range(20):
            os.write(master, b"t123" + b"2" + f"{k:02X}{k:02X}".encode() + b"\r")
            if k == 7:
                os.write(master, b"t12g2zz\r")
            time.sleep(0.005)
    thread = threading.Thread(target=play)
    thread.start()
    told = adapters.record(bus, tmp_path / "s.drec", "slcan:x", seconds=0.8)
    thread.join()
    bus.shutdown()
    os.close(master), os.close(slave)
    assert told.frames == 20 and told.errors >= 1
    file = drec.parse(tmp_path / "s.drec", (tmp_path / "s.drec").read_bytes())
    assert [e.can()[2] for e in file.entries] == [bytes([k, k]) for k in range(20)] and {e.clock for e in file.entries} == {drec.CLOCK_DAEMON}


def test_what_cannot_be_opened_says_so(tmp_path):
    for text, error, words in (("can0", UsageError, "INTERFACE:CHANNEL"), ("socketcn:can0", UsageError, "Did you mean 'socketcan'"), ("slcan:/dev/none", DriveidError, "cannot be opened")):
        with pytest.raises(error, match=words):
            adapters.open_bus(text)
    with pytest.raises(FileError, match="cannot be read"):
        adapters.load_frames(tmp_path / "none.log")


def test_ports_and_probe(driveid):
    code, out, err = driveid("ports", "--json")
    assert code == 0 and out.strip().startswith("[")
    master, slave = os.openpty()
    tty.setraw(master), tty.setraw(slave)

    def adapter():
        if b"V" in os.read(master, 16):
            os.write(master, b"V1013\r")
    thread = threading.Thread(target=adapter)
    thread.start()
    assert "slcan adapter, version V1013" in adapters._probe(os.ttyname(slave))
    thread.join()
    assert adapters._probe(os.ttyname(slave)) == "no answer to slcan"
    assert "not opened" in adapters._probe("/dev/none")
    os.close(master), os.close(slave)

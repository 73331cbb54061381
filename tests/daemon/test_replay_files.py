# SPDX-License-Identifier: Apache-2.0
"""What a replay says, and its exit code, where the file is missing, empty, damaged or something else."""
import json
import struct
import subprocess
import zlib

import pytest
from gateway import DAEMON, SLOW, SOCKETPAIR, Axis, drive

HEADER = json.dumps({"driveid": "1", "sources": [{"name": "bus", "kind": "socketcan", "address": "vcan0"}], "config": ""}).encode()


def entry(stamp_ns, data):
    payload = struct.pack("<IBBH", 0x181, 0, len(data), 0) + data
    head = struct.pack("<IBBHqI", len(payload), 1, 2, 0, stamp_ns, 0)
    return head + struct.pack("<I", zlib.crc32(payload, zlib.crc32(head + bytes(4)))) + payload


def entries(n):
    return [entry(struct.unpack_from("<q", m, 16)[0], m[8:14]) for m in Axis().frames(n, 10**9)]


def drec(body, header=HEADER, version=1):
    return b"DRVIDREC" + struct.pack("<II", version, len(header)) + header + body


def replay(folder, name, blob=None):
    if blob is not None:
        (folder / name).write_bytes(blob)
    (folder / "gw.toml").write_text(f'format = 1\n[control]\nsocket = "{folder}/c.sock"\n[security]\nseccomp = "off"\n' + SOCKETPAIR + drive())
    return subprocess.run([DAEMON, "gw.toml", "--replay", name, "--exit-at-end"], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=60 * SLOW)


@pytest.mark.parametrize("name, blob, words", [
    ("nosuch.log", None, "No such file"), ("nosuch.drec", None, "No such file"), ("a.drec", b"DRVIDREC" + struct.pack("<II", 1, 5000) + b"{}", "header is damaged"),
    ("a.drec", drec(b"", version=7), "has format 7"), ("a.drec", b"hello", "is no record"), ("a.json", b'{"format": 1,\n "x": [1, 2]}\n', "holds no frame"),
    ("a.log", b"", "holds no frame"), ("a.drec", drec(b""), "holds no frame"), ("a.drec", drec(b"\xff" * 300), "holds no frame"),
])
def test_what_cannot_be_replayed_ends_with_2_and_a_sentence(tmp_path, name, blob, words):
    done = replay(tmp_path, name, blob)
    told = [line for line in done.stderr.splitlines() if words in line]
    assert done.returncode == 2 and len(told) == 1 and name in told[0], done.stderr


def test_a_whole_record_ends_with_0_and_no_warning(tmp_path):
    done = replay(tmp_path, "a.drec", drec(b"".join(entries(50))))
    assert done.returncode == 0 and "damaged" not in done.stderr and "holds no frame" not in done.stderr, done.stderr


def test_damaged_stretches_are_told_with_their_number(tmp_path):
    parts = entries(50)
    for k in (7, 20, 33):
        parts[k] = parts[k][:-3] + bytes([parts[k][-3] ^ 0x40]) + parts[k][-2:]
    done = replay(tmp_path, "a.drec", drec(b"".join(parts)))
    told = [line for line in done.stderr.splitlines() if "damaged stretches" in line]
    assert done.returncode == 0 and len(told) == 1 and "a.drec: 3 damaged stretches were skipped" in told[0], done.stderr


def test_a_header_that_is_no_json_is_told_and_the_frames_are_taken(tmp_path):
    done = replay(tmp_path, "a.drec", drec(b"".join(entries(50)), header=b"x" + HEADER[1:]))
    assert done.returncode == 0 and "its header is damaged: the names of its sources are lost" in done.stderr, done.stderr

# SPDX-License-Identifier: Apache-2.0
"""The gateway's record: written here byte by byte from docs/manual/record-format.md, damaged on purpose."""

import binascii
import json
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import driveid
from driveid._core import SIGNALS
from driveid.errors import FileError, UsageError
from driveid.records import drec

CONFIG = 'format = 1\n[[drive]]\nname = "axis1"\nstructure = "rigid_axis"\ndt_s = 0.001\n[[drive]]\nname = "axis2"\nstructure = "rigid_axis"\ndt_s = 0.001\n'


def head(config=CONFIG):
    text = json.dumps({"driveid": "0.1.0", "created": "2024-01-01T00:00:00Z", "clock": "monotonic", "sources": [{"name": "can0", "kind": "socketcan", "address": "vcan0"}], "config": config}).encode()
    return b"DRVIDREC" + struct.pack("<II", 1, len(text)) + text


def entry(kind, t_ns, payload, source=0, clock=2, err_ns=5):
    first = struct.pack("<IBBHqI", len(payload), kind, clock, source, t_ns, err_ns)
    return first + struct.pack("<I", binascii.crc32(first + b"\0\0\0\0" + payload)) + payload


def sample(t_ns, values, drive=0):
    """values: {signal: value}"""
    order = sorted(values, key=SIGNALS.index)
    present = sum(1 << SIGNALS.index(n) for n in order)
    return entry(3, t_ns, struct.pack("<I", present) + struct.pack(f"<{len(order)}d", *[values[n] for n in order]), source=drive)


def samples(n=100, drive=0):
    return [sample(k * 1_000_000, {"theta_rad": 0.1 * k, "i_q_A": -0.5 * k} | ({"T_degC": 20.0 + k} if k % 10 == 0 else {}), drive) for k in range(n)]


def write(tmp_path, *parts, name="run.drec", config=CONFIG):
    path = tmp_path / name
    path.write_bytes(head(config) + b"".join(parts))
    return path


def test_samples(tmp_path):
    r = driveid.read(write(tmp_path, *samples()))
    assert r.t_ns.tolist() == [k * 1_000_000 for k in range(100)]
    assert r["theta_rad"].tolist() == [0.1 * k for k in range(100)] and r["i_q_A"].tolist() == [-0.5 * k for k in range(100)]
    assert np.isfinite(r["T_degC"]).sum() == 10 and r["T_degC"][10] == 30.0
    assert not r.notices


def test_drives_are_told_apart(tmp_path):
    path = write(tmp_path, *samples(5), *samples(7, drive=1))
    assert driveid.read(path, drive="axis2").rows == 7 and driveid.read(path, drive="axis1").rows == 5
    with pytest.raises(UsageError, match="2 drives.*axis1, axis2"):
        driveid.read(path)
    with pytest.raises(UsageError, match="Did you mean"):
        driveid.read(path, drive="axis3")


def test_damage_is_skipped_and_counted(tmp_path):
    parts = samples()
    blob = bytearray(b"".join(parts))
    size = len(parts[1])
    blob[len(parts[0]) + 5 * size + 30] ^= 0x40          # one bit of one payload
    torn = bytes(blob) + parts[0][:17]                    # a torn tail
    r = driveid.read(write(tmp_path, torn))
    assert r.rows == 99 and r.notices == [f"2 damaged stretches ({len(parts[6]) + 17} bytes) were skipped"]
    with_noise = b"\x01\x02\x03" * 50 + b"".join(parts[:3]) + bytes(1000) + b"".join(parts[3:])
    r = driveid.read(write(tmp_path, with_noise, name="b.drec"))
    assert r.rows == 100 and "2 damaged stretches (1150 bytes)" in r.notices[0]


def test_replay_tells_the_damage(tmp_path, driveid):
    model = driveid("model", "new", "rigid_axis", "--given", "K_t_Nm_A=0.05")[1]
    (driveid.folder / "axis.toml").write_text(model)
    parts = samples()
    write(tmp_path, b"".join(parts), name="whole.drec")
    code, _, err = driveid("replay", "whole.drec", "--model", "axis.toml", "--drive", "axis1")
    assert code == 0 and "damaged" not in err, err
    write(tmp_path, b"".join(parts[:6]) + b"\xff" * 20 + b"".join(parts[6:]), name="torn.drec")
    code, _, err = driveid("replay", "torn.drec", "--model", "axis.toml", "--drive", "axis1")
    assert code == 0 and "torn.drec: 1 damaged stretch (20 bytes) was skipped" in err, err


def test_replay_to_a_bus_tells_the_damage_and_no_lateness_where_there_is_no_pace(tmp_path, driveid):
    with drec.DrecWriter(tmp_path / "f.drec", [{"name": "can0"}]) as w:
        for k in range(5):
            w.can(1000 * k, 0x181, bytes(8))
    (tmp_path / "f.drec").write_bytes((tmp_path / "f.drec").read_bytes() + b"\xff" * 9)
    code, _, err = driveid("replay", "f.drec", "--to", "virtual:x", "--speed", "0")
    assert code == 0 and "5 frames in" in err and "late" not in err and "1 damaged stretch (9 bytes)" in err, err
    code, _, err = driveid("replay", "f.drec", "--to", "virtual:x", "--speed", "1")
    assert code == 0 and "late by" in err
    assert driveid("replay", "f.drec", "--to", "virtual:x", "--speed", "nan")[0] == 2


def test_a_length_that_lies_does_not_swallow_the_rest(tmp_path):
    parts = samples(20)
    lie = bytearray(parts[4])
    lie[0:4] = struct.pack("<I", 60000)
    assert driveid.read(write(tmp_path, *parts[:4], bytes(lie), *parts[5:])).rows == 19


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 3000), st.binary(max_size=40))
def test_any_cut_and_any_tail(tmp_path_factory, cut, tail):
    blob = b"".join(samples(60))
    path = write(tmp_path_factory.mktemp("d"), blob[:cut] + tail)
    file = drec.parse(path, path.read_bytes())
    whole = 0
    for part in samples(60):
        if whole + len(part) > cut:
            break
        whole += len(part)
    assert sum(24 + len(e.payload) for e in file.entries) + file.lost_bytes == min(cut, len(blob)) + len(tail)
    assert sum(24 + len(e.payload) for e in file.entries) >= whole


def test_heads(tmp_path):
    for blob, words in ((b"DRVIDREC" + struct.pack("<II", 2, 2) + b"{}", "format version 2"), (b"DRVIDREC" + struct.pack("<II", 1, 500) + b"{}", "damaged header"),
                        (b"DRVIDREC" + struct.pack("<II", 1, 2) + b"[]", "damaged header"), (b"DRVIDREC\0", "must begin with"), (b"hello", "does not begin with DRVIDREC")):
        path = tmp_path / "x.drec"
        path.write_bytes(blob)
        with pytest.raises(FileError, match=words):
            driveid.read(path)
    with pytest.raises(FileError, match="holds no decoded sample"):
        driveid.read(write(tmp_path))


def test_frames_through_a_dbc(tmp_path):
    (tmp_path / "d.dbc").write_text('VERSION ""\nBU_: x\nBO_ 385 m: 8 x\n SG_ theta_rad : 0|16@1+ (0.1,0) [0|0] "rad" x\n')
    frames = [entry(1, 10**9 + k * 1_000_000, struct.pack("<IBBH", 385, 0, 2, 0) + struct.pack("<H", (65530 + k) % 65536)) for k in range(20)]
    path = write(tmp_path, *frames)
    r = driveid.read(path, dbc=tmp_path / "d.dbc")
    assert r.t_ns[0] == 10**9
    np.testing.assert_allclose(r["theta_rad"], 0.1 * (65530 + np.arange(20)))
    with pytest.raises(FileError, match="--dbc FILE.dbc"):
        driveid.read(path)


def test_our_writer_writes_the_format(tmp_path):
    with drec.DrecWriter(tmp_path / "w.drec", [{"name": "can", "kind": "virtual", "address": "virtual:x"}]) as w:
        w.can(123456789, 0x98FEF100, b"\x01\x02\x03", fd_flags=3, err_ns=10**12)
        w.mark(123456790, "here")
    blob = (tmp_path / "w.drec").read_bytes()
    size = struct.unpack_from("<I", blob, 12)[0]
    assert json.loads(blob[16:16 + size])["sources"][0]["kind"] == "virtual"
    body = blob[16 + size:]
    payload = struct.pack("<IBBH", 0x98FEF100, 3, 3, 0) + b"\x01\x02\x03"
    assert body.startswith(entry(1, 123456789, payload, err_ns=0xFFFFFFFF))
    assert body[24 + len(payload):] == entry(5, 123456790, b'{"text": "here"}', err_ns=0)
    with pytest.raises(FileExistsError):
        drec.DrecWriter(tmp_path / "w.drec", [])

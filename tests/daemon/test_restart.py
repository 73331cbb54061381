# SPDX-License-Identifier: Apache-2.0
"""State over kill -9, reload, records over full disks, replay bit for bit."""
import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import time
import zlib

import pytest
from faults import recovery
from gateway import DAEMON, SLOW, SOCKETPAIR, Axis, Gateway, J, drive, frame, near_truth, parameters

STATE = '[state]\nfolder = "state"\nperiod_s = 0.1\n'


def learnt(gateway, text):
    (gateway.folder / "state").mkdir(exist_ok=True)
    gateway.start(text)
    gateway.feed(Axis(), 6000)
    gateway.settle(6000)
    gateway.until(lambda s: (gateway.folder / "state/state").exists() and "J_kgm2" in (gateway.folder / "state/state").read_text(), 10, "a saved state")
    return parameters(gateway.status())


def test_parameters_survive_a_kill_and_say_their_age(gateway):
    text = STATE + SOCKETPAIR + drive()
    before = learnt(gateway, text)
    time.sleep(0.3)
    gateway.process.kill()
    gateway.process.wait()
    time.sleep(0.5)
    with recovery("kill -9", "parameters with their age, after the restart"):
        gateway.start(text)
    after = parameters(gateway.status())
    for name, p in before.items():
        assert after[name]["value"] == p["value"] and after[name]["interval"] == p["interval"]
        assert after[name]["valid"] is False, "old knowledge is shown, never as valid"
        assert 0.3 < after[name]["age_s"] < 60 * SLOW
    gateway.feed(Axis(), 6000)
    gateway.settle(6000)
    fresh = parameters(gateway.status())
    assert fresh["J_kgm2"]["age_s"] < after["J_kgm2"]["age_s"] + 5


def test_a_damaged_state_falls_back_to_the_one_before(gateway):
    text = STATE + SOCKETPAIR + drive()
    learnt(gateway, text)
    gateway.until(lambda s: (gateway.folder / "state/state.old").exists() and "J_kgm2" in (gateway.folder / "state/state.old").read_text(), 10, "a previous state")
    gateway.process.kill()
    gateway.process.wait()
    whole = (gateway.folder / "state/state").read_bytes()
    old = (gateway.folder / "state/state.old").read_bytes()
    # As a crash may leave it: nothing, cut anywhere, changed anywhere, or the file of the second rename missing.
    for damage in (b"", whole[:10], whole[:-1], whole[: len(whole) // 2], whole[:40] + b"\x00" + whole[41:], None):
        target = gateway.folder / "state/state"
        target.unlink(missing_ok=True)
        if damage is not None:
            target.write_bytes(damage)
        (gateway.folder / "state/state.old").write_bytes(old)
        gateway.start(text)
        assert parameters(gateway.status())["J_kgm2"]["value"] is not None, damage
        gateway.process.kill()
        gateway.process.wait()
    (gateway.folder / "state/state").write_bytes(b"x")
    (gateway.folder / "state/state.old").write_bytes(b"y")
    gateway.start(text)
    assert parameters(gateway.status())["J_kgm2"]["value"] is None


def test_kill_at_any_moment_leaves_a_state_that_opens(gateway):
    """Killed again and again while it saves as often as it can: one of the two files always opens."""
    text = STATE.replace("0.1", "0.1") + SOCKETPAIR + drive()
    learnt(gateway, text)
    for k in range(8):
        time.sleep(0.1 + 0.013 * k)
        gateway.process.kill()
        gateway.process.wait()
        good = 0
        for name in ("state", "state.old"):
            path = gateway.folder / "state" / name
            if path.exists():
                head, _, body = path.read_bytes().partition(b"\n")
                words = head.split()
                good += words[:2] == [b"driveid-state", b"1"] and int(words[2], 16) == zlib.crc32(body) and int(words[3]) == len(body)
        assert good >= 1
        gateway.start(text)
        assert parameters(gateway.status())["J_kgm2"]["value"] is not None


def test_state_of_another_drive_is_not_taken(gateway):
    learnt(gateway, STATE + SOCKETPAIR + drive())
    gateway.process.kill()
    gateway.process.wait()
    gateway.start(STATE + SOCKETPAIR + drive(type="f32"))
    assert parameters(gateway.status())["J_kgm2"]["value"] is None


def reload(gateway, lines):
    gateway.process.send_signal(signal.SIGHUP)
    ends = time.monotonic() + 10 * SLOW
    while gateway.text().count(lines) == 0:
        assert time.monotonic() < ends and gateway.process.poll() is None, gateway.text()
        time.sleep(0.02)


def test_reload_keeps_what_is_unchanged_and_refuses_what_is_wrong(gateway):
    gateway.start(SOCKETPAIR + drive(keys="stale_s = 1000"))
    axis = Axis()
    start = gateway.feed(axis, 6000)
    before = parameters(gateway.settle(6000))
    gateway.write(SOCKETPAIR + drive(keys="stale_s = 1000").replace("dt_s", "dts"))
    reload(gateway, "did you mean")
    assert parameters(gateway.status())["J_kgm2"]["value"] == before["J_kgm2"]["value"], "the old configuration goes on"
    gateway.write(SOCKETPAIR + drive(keys="stale_s = 1000") + drive("axis2", can_id=0x201))
    reload(gateway, "configuration reloaded")
    status = gateway.status()
    assert [d["name"] for d in status["drives"]] == ["axis1", "axis2"]
    assert status["drives"][0]["samples"] == 6000 and near_truth(status)
    gateway.feed(axis, 1000, start)
    assert gateway.until(lambda s: s["drives"][0]["samples"] == 7000) and near_truth(gateway.status())


def test_a_reload_without_a_change_closes_nothing(gateway):
    gateway.start(SOCKETPAIR + drive(keys="stale_s = 1000"))
    gateway.feed(Axis(), 500)
    gateway.settle(500)
    reload(gateway, "configuration reloaded, 0 changes")
    status = gateway.status()
    assert status["sources"][0]["frames"] == 500 and status["drives"][0]["samples"] == 500


def test_a_record_goes_on_in_a_file_of_its_own_when_a_reload_renumbers(gateway):
    """The entries number drives and sources as the header names them."""
    record = '[record]\nfolder = "."\nfile = "live.drec"\n'
    gateway.start(record + SOCKETPAIR + drive())
    axis = Axis()
    start = gateway.feed(axis, 300)
    gateway.settle(300)
    gateway.write(record + SOCKETPAIR + drive("front", can_id=0x201) + drive())
    reload(gateway, "configuration reloaded")
    gateway.feed(axis, 200, start)
    gateway.until(lambda s: s["drives"][1]["samples"] >= 500)
    assert gateway.stop() == 0
    for name, drives, samples in (("live.drec", ["axis1"], 300), ("live-1.drec", ["front", "axis1"], 200)):
        header, found = entries(gateway.folder / name)
        assert header["drives"] == drives and header["from_start"] is (name == "live.drec")
        assert [drives[source] for kind, source, _, _ in found if kind == 3] == ["axis1"] * samples


@pytest.mark.skipif(os.getuid() != 0, reason="needs root")
def test_a_reload_that_would_lose_a_privileged_port_is_refused():
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        gateway = Gateway(folder)
        text = SOCKETPAIR + drive() + '[[sink]]\nname = "regs"\nkind = "modbus_server"\nport = 817\n'
        try:
            gateway.start(text, security='[security]\nuser = "nobody"\n')
            gateway.write(text.replace("817", "817\nunit = 7"), security='[security]\nuser = "nobody"\n')
            reload(gateway, "privileges that are gone")
            assert gateway.status()["sinks"][0]["state"] == "open"
            socket.create_connection(("127.0.0.1", 817), 5).close()
        finally:
            gateway.close()


def test_values_that_never_meet_in_a_sample_are_told(gateway):
    apart = drive(keys="align_tolerance_s = 0.0002").replace('name = "theta_rad"\n  source = "bus"\n  can_id = 385', 'name = "theta_rad"\n  source = "bus"\n  can_id = 386')
    gateway.start(SOCKETPAIR + apart)
    start = time.monotonic_ns()
    for k in range(600):
        for identifier, late_ns in ((0x181, 0), (0x182, 550_000)):
            gateway.bus[0].send(frame(identifier, bytes(8), start + k * 1_000_000 + late_ns))
    gateway.until(lambda s: s["drives"][0]["dropped"] >= 400)
    assert gateway.text().count("align_tolerance_s") >= 1 and "delay_s" in gateway.text()


def entries(path):
    """Independent reader of docs/manual/record-format.md."""
    data = path.read_bytes()
    assert data[:8] == b"DRVIDREC"
    _, length = struct.unpack_from("<II", data, 8)
    at = 16 + length
    out = []
    while at + 24 <= len(data):
        size, kind, clock, source, t_ns, err, crc = struct.unpack_from("<IBBHqII", data, at)
        payload = data[at + 24:at + 24 + size]
        assert zlib.crc32(payload, zlib.crc32(data[at:at + 20] + bytes(4))) == crc
        out.append((kind, source, t_ns, payload))
        at += 24 + size
    assert at == len(data)
    return json.loads(data[16:16 + length]), out


def test_record_holds_everything_and_replays_bit_for_bit(gateway):
    record = '[record]\nfolder = "."\nfile = "live.drec"\n'
    gateway.start(record + SOCKETPAIR + drive())
    axis = Axis()
    sent = list(axis.frames(5000, time.monotonic_ns() - 6_000_000_000))
    for message in sent:
        gateway.bus[0].send(message)
    live = gateway.settle(5000)
    assert gateway.stop() == 0
    header, live_entries = entries(gateway.folder / "live.drec")
    frames = [(t, p) for kind, _, t, p in live_entries if kind == 1]
    assert [(struct.unpack_from("<q", m, 16)[0], m[8:14]) for m in sent] == [(t, p[8:]) for t, p in frames]
    assert header["sources"][0]["name"] == "bus" and "can_id" in header["config"]
    samples = [p for kind, _, _, p in live_entries if kind == 3]
    assert len(samples) == 5000 and all(struct.unpack_from("<I", p)[0].bit_count() == 2 for p in samples)

    def replayed(name, speed):
        gateway.write(record.replace("live", name) + drive() + f'[[source]]\nname = "bus"\nkind = "replay"\nfile = "live.drec"\nspeed = {speed}\n')
        done = subprocess.run([DAEMON, "gw.toml", "--exit-at-end"], cwd=gateway.folder, capture_output=True, text=True, timeout=60 * SLOW)
        assert done.returncode == 0, done.stderr
        return entries(gateway.folder / f"{name}.drec")[1]

    def numbers(list_of_entries):
        estimates = [json.loads(p) for kind, _, _, p in list_of_entries if kind == 6]
        return [(e["t_ns"], [(p["value"], p["interval"]) for p in e["parameters"]]) for e in estimates], [p for kind, _, _, p in list_of_entries if kind == 3]

    fast, again, paced = replayed("fast", "0.0"), replayed("again", "0.0"), replayed("paced", "20.0")
    assert fast and [e for e in fast if e[0] in (1, 3, 6)] == [e for e in again if e[0] in (1, 3, 6)], "the same bits each run"
    assert numbers(fast) == numbers(live_entries), "replay gives the live numbers"
    assert numbers(paced) == numbers(live_entries)
    assert live["drives"][0]["samples"] == 5000


def test_replay_keeps_its_pace(gateway):
    lines, axis = [], Axis()
    for message in axis.frames(1000, 1_700_000_000_000_000_000):
        stamp = struct.unpack_from("<q", message, 16)[0]
        lines.append(f"({stamp // 10**9}.{stamp % 10**9 // 1000:06d}) vcan0 181#{message[8:16].hex().upper()}")
    lines[500:500] = ["garbage", "(1.0) vcan0 XYZ#00"]
    (gateway.folder / "run.log").write_text("\n".join(lines) + "\n")
    for speed, least, most in ((1.0, 0.99, 3), (4.0, 0.24, 2)):
        gateway.write('[[source]]\nname = "bus"\nkind = "replay"\nfile = "run.log"\nspeed = %s\n' % speed + drive())
        began = time.monotonic()
        done = subprocess.run([DAEMON, "gw.toml", "--exit-at-end"], cwd=gateway.folder, capture_output=True, text=True, timeout=60)
        assert done.returncode == 0 and least < time.monotonic() - began < most * SLOW
        assert "no candump frame" in done.stderr


@pytest.mark.skipif(os.geteuid() != 0, reason="mounts a small tmpfs: needs root")
def test_full_and_read_only_disk(gateway):
    disk = gateway.folder / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", disk], capture_output=True).returncode:
        pytest.skip("tmpfs cannot be mounted here")
    try:
        gateway.start(f'[record]\nfolder = "{disk}"\nbuffer_bytes = 65536\n[state]\nfolder = "{disk}"\nperiod_s = 0.1\n' + SOCKETPAIR + drive(keys="stale_s = 1000")
                      + '[[sink]]\nname = "rec"\nkind = "record"\nfile = "run.drec"\n')
        axis = Axis()
        start = time.monotonic_ns() - 30_000_000_000
        for part in range(40):  # in parts, so that the record's bounded queue reaches the disk
            gateway.feed(axis, 200, start)
            gateway.settle(200 * (part + 1))
        status = gateway.until(lambda s: s["sinks"][0]["state"] == "error" and s["sinks"][0]["dropped"] > 0, 20)
        assert "space" in status["sinks"][0]["last_error"]
        assert near_truth(gateway.settle(8000)), "identification goes on"
        (disk / "big").unlink(missing_ok=True)
        subprocess.run(["mount", "-o", "remount,size=8m", disk], check=True)
        with recovery("disk full", "recording again"):
            gateway.until(lambda s: s["sinks"][0]["state"] == "open", 10, "room again")
        gateway.feed(axis, 1000, start)
        gateway.settle(9000)
        gateway.until(lambda s: (disk / "state").exists(), 10, "state saved again")
        subprocess.run(["mount", "-o", "remount,ro", disk], capture_output=True)
        gateway.feed(axis, 1000, start)
        assert near_truth(gateway.settle(10000))
        assert gateway.stop() == 0
        header, kept = entries(disk / "run.drec")
        frames = [t for kind, _, t, _ in kept if kind == 1]
        assert header and frames == sorted(frames) and frames[-1] >= start + 8_000_000_000, "what came after there was room again is there"
    finally:
        subprocess.run(["umount", "-l", disk], capture_output=True)
        shutil.rmtree(disk, ignore_errors=True)


def test_missing_record_is_told_and_survived(gateway):
    gateway.start('[[source]]\nname = "bus"\nkind = "replay"\nfile = "none.drec"\n' + drive(), buses=0)
    source = gateway.status()["sources"][0]
    assert source["state"] == "closed" and "none.drec" in source["last_error"]
    assert J > 0


def test_a_covariance_of_other_parameters_is_not_taken_over(gateway):
    """As many parameters under the same drive's name, but others: J and B before, B and tau_c now."""
    learnt(gateway, STATE + SOCKETPAIR + drive())
    assert gateway.stop() == 0
    saved = json.loads((gateway.folder / "state/state").read_text().split("\n", 1)[1])["drives"][0]
    assert saved["names"] == ["J_kgm2", "B_Nms_rad"] and len(saved["theta"]) == 2
    other = drive(keys='effects = ["coulomb"]').replace("given = { K_t_Nm_A = 0.05 }", "given = { K_t_Nm_A = 0.05, J_kgm2 = 2e-4 }")
    gateway.start(STATE + SOCKETPAIR + other)
    assert gateway.stop() == 0
    again = json.loads((gateway.folder / "state/state").read_text().split("\n", 1)[1])["drives"][0]
    assert again["names"] == ["B_Nms_rad", "tau_c_Nm"] and again["theta"] == []

# SPDX-License-Identifier: Apache-2.0
"""What driveid-sim puts on buses and into files, read by independent programs (cantools, pymodbus) and compared with its own truth."""
import csv
import json
import math
import socket
import struct
import subprocess
import time
import tomllib

import pytest

cantools = pytest.importorskip("cantools")


def run(sim, *arguments, code=0, **more):
    done = subprocess.run([sim, *map(str, arguments)], capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL, **more)
    assert done.returncode == code, done.stderr
    return done


def rows(path):
    with open(path) as f:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(f)]


def frames(path):
    for line in open(path):
        stamp, _, frame = line.split()
        name, _, data = frame.partition("#")
        yield float(stamp[1:-1]), int(name, 16), bytes.fromhex(data[2:] if data.startswith("#") else data)


@pytest.mark.parametrize("options", [[], ["--big-endian"], ["--fd"], ["--fd", "--big-endian"], ["--can-id", "0x1ABCDE0"]])
@pytest.mark.parametrize("structure", ["rigid_axis", "pmsm_drive"])
def test_frames_decode_to_the_samples(sim, tmp_path, structure, options):
    run(sim, "run", "--bus", f"log:{tmp_path}/r.log", "--duration", 1, "--seed", 8, "--structure", structure, "--csv", tmp_path / "r.csv", "--dbc", tmp_path / "r.dbc", *options)
    db = cantools.database.load_file(tmp_path / "r.dbc")
    samples = rows(tmp_path / "r.csv")
    decoded = {}
    for stamp, can_id, data in frames(tmp_path / "r.log"):
        message = db.get_message_by_frame_id(can_id)
        assert len(data) == message.length
        values = message.decode(data)
        for name, value in values.items():
            decoded.setdefault(name, []).append(float(value))
    assert decoded["counter"] == [n % 65536 for n in range(len(samples))]
    names = [n for n in samples[0] if n != "t_s"]
    assert len(names) >= 2
    for name in names:
        steps = {s.name: s.scale for m in db.messages for s in m.signals}[name]
        assert len(decoded[name]) == len(samples)
        # half a step of the frame, and the seven digits of the CSV
        assert all(abs(d - s[name]) <= 0.5 * abs(steps) + 6e-7 * abs(s[name]) + 1e-12 for d, s in zip(decoded[name], samples)), name


def test_truth_and_configuration_stand_beside_the_log(sim, tmp_path):
    run(sim, "run", "--bus", f"log:{tmp_path}/r.log", "--duration", 2, "--seed", 3, "--load-change-at", 1, "--factor", 1.5, "--effect", "cogging", "--effect-at", 1.5,
        "--size", 0.5, "--truth", tmp_path / "t.json", "--config", tmp_path / "c.toml", "--socket", "/tmp/x.sock")
    truth = json.loads((tmp_path / "t.json").read_text())
    start, load, effect = truth["phases"]
    assert [p["t_s"] for p in truth["phases"]] == [0, 1, 1.5]
    assert load["drive"]["J_kgm2"] == pytest.approx(1.5 * start["drive"]["J_kgm2"], rel=1e-12)
    assert effect["effects"][0]["effect"] == "cogging" and not load["effects"]
    config = tomllib.loads((tmp_path / "c.toml").read_text())
    assert config["control"]["socket"] == "/tmp/x.sock"
    assert config["source"][0]["kind"] == "replay" and config["source"][0]["file"] == str(tmp_path / "r.log")
    assert config["drive"][0]["given"]["K_t_Nm_A"] == pytest.approx(start["drive"]["K_t_Nm_A"], rel=1e-12)
    assert {s["name"] for s in config["drive"][0]["signal"]} == {"i_q_A", "theta_rad"}


def test_losses_and_jitter_are_as_asked(sim, tmp_path):
    run(sim, "run", "--bus", f"log:{tmp_path}/r.log", "--duration", 4, "--loss", 0.1, "--jitter", 0.0004)
    kept = [s for s, i, _ in frames(tmp_path / "r.log") if i == 0x181]
    assert 3500 < len(kept) < 3700  # 4000 at 10 % loss: standard deviation 19
    late = [(s * 1000) % 1 for s in kept]
    assert max(late) - min(late) > 0.3


def test_records_become_frames(sim, tmp_path):
    lines = ["t_s,force,q"] + [f"{n / 500},{30 * math.sin(n / 9):.6f},{0.1 * math.cos(n / 30):.9f}" for n in range(400)]
    (tmp_path / "in.csv").write_text("\n".join(lines) + "\n")
    run(sim, "frames", tmp_path / "in.csv", "--map", "F_N=force", "--map", "x_m=q:2", "--structure", "linear_axis", "--log", tmp_path / "o.log", "--dbc", tmp_path / "o.dbc", "--config", tmp_path / "o.toml")
    db = cantools.database.load_file(tmp_path / "o.dbc")
    got = [(s, db.decode_message(i, d)) for s, i, d in frames(tmp_path / "o.log")]
    assert len(got) == 400
    for n, (stamp, values) in enumerate(got):
        assert stamp - got[0][0] == pytest.approx(n / 500, abs=2e-6)
        assert values["F_N"] == pytest.approx(30 * math.sin(n / 9), abs=1e-6)
        assert values["x_m"] == pytest.approx(0.2 * math.cos(n / 30), abs=1e-8)
    assert tomllib.loads((tmp_path / "o.toml").read_text())["drive"][0]["dt_s"] == pytest.approx(0.002)


def test_inherited_socket_carries_frames_and_stamps_in_real_time(sim):
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    child = subprocess.Popen([sim, "run", "--bus", f"fd:{there.fileno()}", "--duration", "1", "--rate", "250"], pass_fds=[there.fileno()], stderr=subprocess.DEVNULL)
    there.close()
    here.settimeout(10)
    started, stamps = time.monotonic(), []
    while packet := here.recv(200):
        assert len(packet) == 24  # can_frame and stamp
        can_id, length = struct.unpack_from("=IB", packet)
        (stamp,) = struct.unpack_from("=q", packet, 16)
        assert length == 8 and can_id in (0x181, 0x281)
        if can_id == 0x181:
            stamps.append(stamp)
    assert child.wait(10) == 0
    assert 0.8 < time.monotonic() - started < 5
    assert len(stamps) == 250
    assert all(abs(b - a - 4_000_000) < 50_000 for a, b in zip(stamps, stamps[1:]))


def test_modbus_registers(sim, tmp_path):
    client_module = pytest.importorskip("pymodbus.client")
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    child = subprocess.Popen([sim, "run", "--bus", f"modbus:127.0.0.1:{port}", "--duration", "3", "--seed", "5", "--structure", "dc_drive", "--csv", tmp_path / "m.csv", "--config", tmp_path / "m.toml"],
                             stderr=subprocess.DEVNULL)
    polls = []
    try:
        clients = [client_module.ModbusTcpClient("127.0.0.1", port=port) for _ in range(2)]
        for client in clients:
            for _ in range(100):
                if client.connect():
                    break
                time.sleep(0.05)
        for _ in range(60):
            for client in clients:
                answer = client.read_input_registers(0, count=18)
                assert not answer.isError()
                polls.append(b"".join(struct.pack(">H", r) for r in answer.registers))
            time.sleep(0.01)
        assert clients[0].read_input_registers(17, count=8).isError()  # beyond the table
        for client in clients:
            client.close()
    finally:
        assert child.wait(20) == 0
    samples = rows(tmp_path / "m.csv")
    config = tomllib.loads((tmp_path / "m.toml").read_text())
    signals = {s["name"]: s for s in config["drive"][0]["signal"]}
    assert {"v_V", "i_A"} <= set(signals)
    seen = set()
    for poll in filter(any, polls):  # all zero before the first sample
        (counter,) = struct.unpack_from(">I", poll, 0)
        seen.add(counter)
        for name in ("v_V", "i_A"):
            (value,) = struct.unpack_from(">f", poll, 2 * signals[name]["address"])
            assert value == pytest.approx(samples[counter][name], rel=1e-6, abs=1e-7)  # all of one instant
    assert len(seen) > 30


@pytest.mark.parametrize("arguments, says", [
    (["run", "--bus", "can:nosuch0"], ("nosuch0", "no CAN")),
    (["run", "--bus", "pigeon:1"], ("pigeon",)),
    (["run", "--bus", "modbus:127.0.0.1"], ("port",)),
    (["run", "--bus", "log:/nonexistent/x.log", "--duration", "1"], ("/nonexistent/x.log",)),
    (["run", "--bus", "log:/tmp/x.log"], ("length",)),
    (["run"], ("--bus",)),
    (["case", "--out", "/tmp/sim-never", "--effect", "coulomp"], ("coulomp", "driveid-sim effects")),
    (["case", "--out", "/tmp/sim-never", "--effect", "cogging", "--structure", "dc_circuit"], ("dc_circuit",)),
    (["frames", "/nonexistent.csv", "--structure", "rigid_axis", "--log", "/tmp/x.log"], ("nonexistent",)),
    (["nonsense"], ("nonsense",)),
])
def test_errors_name_the_place(sim, arguments, says):
    done = run(sim, *arguments, code=2)
    text = done.stderr + done.stdout
    assert any(word in text for word in says), text


def test_bad_csv_names_line_and_column(sim, tmp_path):
    (tmp_path / "bad.csv").write_text("t_s,i_A,theta_rad\n0,1,2\n0.001,x,2\n")
    done = run(sim, "frames", tmp_path / "bad.csv", "--structure", "rigid_axis", "--log", tmp_path / "o.log", code=2)
    assert "bad.csv:3" in done.stderr and "i_A" in done.stderr


def test_case_is_repeatable_and_its_truth_elsewhere(sim, tmp_path):
    for name in ("a", "b"):
        run(sim, "case", "--seed", 4, "--effect", "coulomb", "--size", 3, "--train-s", 6, "--held-out-s", 4, "--dirt", "auto", "--out", tmp_path / name / "data", "--truth", tmp_path / f"{name}.json")
        assert sorted(p.name for p in (tmp_path / name / "data").iterdir()) == ["case.json", "held_out.csv", "train.csv"]
        text = "".join(p.read_text() for p in (tmp_path / name / "data").iterdir())
        assert "coulomb" not in text
    for name in ("train.csv", "held_out.csv", "case.json"):
        assert (tmp_path / "a/data" / name).read_bytes() == (tmp_path / "b/data" / name).read_bytes()
    truth = json.loads((tmp_path / "a.json").read_text())
    assert truth["effects"][0]["effect"] == "coulomb"
    assert truth["train"]["ratio"] == pytest.approx(3, rel=0.05)

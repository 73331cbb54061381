# SPDX-License-Identifier: Apache-2.0
"""The control socket against its page, against hostile peers, against peers that do not read."""
import grp
import json
import os
import random
import socket
import time

import pytest
from gateway import SOCKETPAIR, SLOW, Axis, drive


def own_group():
    return grp.getgrgid(os.getgid()).gr_name


@pytest.fixture
def running(gateway):
    return gateway.start(SOCKETPAIR + drive(), control=f'write_group = "{own_group()}"')


def test_hello_and_status_have_the_fields_of_the_page(running):
    control = running.control()
    hello = control.ask("hello")
    assert hello["driveid"] == 1 and hello["ok"] is True
    assert {"version", "pid", "uptime_s", "config_file", "write", "drives", "sources", "sinks"} <= hello.keys()
    assert hello["drives"] == ["axis1"] and hello["sources"] == ["bus"] and hello["pid"] == running.process.pid
    status = control.ask("status")
    assert {"t_ns", "drives", "sources", "sinks", "memory_kB"} <= status.keys()
    assert {"name", "structure", "method", "type", "state", "status", "t_ns", "samples", "rate_Hz", "jitter_ns", "gaps", "dropped", "rejected", "restarts", "time_to_first_trusted_s",
            "residual", "parameters", "missing"} <= status["drives"][0].keys()
    assert {"rms", "unit", "alarm", "since_ns", "regime", "likely_effect"} <= status["drives"][0]["residual"].keys()
    assert {"name", "value", "interval", "unit", "valid", "age_s"} <= status["drives"][0]["parameters"][0].keys()
    assert {"name", "kind", "address", "state", "clock", "frames", "used", "dropped", "rejected", "errors", "bus_state", "rate_Hz", "buffer_asked", "buffer_granted",
            "last_error"} <= status["sources"][0].keys()


def test_read_only_by_default(gateway):
    gateway.start(SOCKETPAIR + drive())
    control = gateway.control()
    assert control.ask("hello")["write"] is False
    for cmd, arguments in [("record_start", {"file": "a.drec"}), ("record_stop", {}), ("mark", {"text": "x"}), ("restart", {"drive": "axis1"}), ("reload", {})]:
        answer = control.ask(cmd, **arguments)
        assert answer["ok"] is False and answer["error"] == "permission" and "write_group" in answer["message"]


def test_socket_permissions(gateway):
    gateway.start(SOCKETPAIR + drive(), control='mode = "0600"')
    assert os.stat(gateway.socket).st_mode & 0o777 == 0o600


def test_events_reach_subscribers(running):
    control = running.control()
    control.ask("subscribe", topics=["estimate", "sample", "event", "status"], drives=["axis1"], decimate=10)
    axis, start = Axis(), time.monotonic_ns() - 3_000_000_000
    running.feed(axis, 1000, start)
    seen = {}
    while not {"estimate", "sample", "status"} <= seen.keys() or seen["sample"] < 100:
        event = control.line()
        seen[event["event"]] = seen.get(event["event"], 0) + 1
        if event["event"] == "sample":
            assert set(event["values"]) == {"i_q_A", "theta_rad"} and event["drive"] == "axis1"
    assert seen["sample"] == 100
    control.ask("unsubscribe")
    running.feed(axis, 1000, start)
    assert control.ask("hello")["ok"]


def test_recording_by_command(running):
    control = running.control()
    for bad in ("../x", "/tmp/x", "", ".hidden", "a/b", "x" * 300, "a\0b.drec", "a\nb"):
        refused = control.ask("record_start", file=bad)
        assert refused["ok"] is False and "bare name" in refused["message"], bad
    answer = control.ask("record_start", file="run")
    assert answer["ok"], answer
    assert control.ask("record_start", file="again")["error"] == "record"
    running.feed(Axis(), 500)
    running.settle(500)
    assert control.ask("mark", text="here")["ok"]
    stopped = control.ask("record_stop")
    assert stopped["entries"] >= 1001 and stopped["bytes"] == os.path.getsize(answer["file"])
    assert control.ask("record_stop")["error"] == "state"
    again = control.ask("record_start", file="run")
    assert again["file"] != answer["file"], "an earlier record is never overwritten"
    assert control.ask("restart", drive="nobody")["ok"] is False
    assert control.ask("restart", drive="axis1")["ok"]


HOSTILE = [b"", b"\n", b"\r\n", b"{}", b"[]", b"null", b"1", b'"x"', b"{", b'{"id":1}', b'{"id":"1","cmd":"hello"}', b'{"id":1,"cmd":5}', b'{"id":1,"cmd":"nothing"}',
           b'{"driveid":2,"id":1,"cmd":"hello"}', b'{"id":1e99,"cmd":"hello"}', b'{"id":99999999999999999999,"cmd":"hello"}', b"\xff\xfe\x00\x01", b"[" * 60000, b'{"a":' * 10000,
           b'{"id":1,"cmd":"subscribe","topics":5}', b'{"id":1,"cmd":"subscribe","topics":["x"]}', b'{"id":1,"cmd":"subscribe","topics":[[]]}',
           b'{"id":1,"cmd":"subscribe","drives":["nobody"]}', b'{"id":1,"cmd":"subscribe","decimate":0}', b'{"id":1,"cmd":"subscribe","decimate":-1}', b'{"id":1,"cmd":"mark","text":5}',
           b'{"id":1,"cmd":"record_start","file":{}}', b'{"id":1,"cmd":"\\u0000"}', b'{"id":1,"cmd":"' + b"A" * 50000 + b'"}', b'{"id":1,"id":2,"cmd":"hello"}']


def test_hostile_lines_get_an_answer_and_nothing_else(running):
    control = running.control()
    for line in HOSTILE:
        control.socket.sendall(line + b"\n")
    control.send(cmd="hello")
    answers = []
    while True:
        message = control.line()
        assert message["driveid"] == 1
        if message.get("ok") and message.get("id") == control.id and "pid" in message:
            answers.append(message)
            if len(answers) >= 1 and "version" in message and message["id"] == control.id:
                break
        else:
            assert message["ok"] is True or message["message"], message


def test_lines_without_end_close_the_connection(running):
    control = running.control()
    with pytest.raises((ConnectionError, BrokenPipeError, OSError)):
        for _ in range(100):
            control.socket.sendall(b"x" * 8192)
        control.line()
    assert running.status()["ok"]
    assert running.memory_kB() < 200_000


def test_random_bytes_do_not_hurt(running):
    rng = random.Random(1)
    for _ in range(40):
        s = socket.socket(socket.AF_UNIX)
        s.connect(str(running.socket))
        try:
            s.sendall(rng.randbytes(rng.randrange(1, 5000)))
        except OSError:
            pass
        s.close()
    assert running.status()["ok"]


def test_too_many_connections_are_told(gateway):
    gateway.start(SOCKETPAIR + drive(), control="clients = 3")
    time.sleep(0.2)
    held = [gateway.control() for _ in range(3)]
    assert all(c.ask("hello")["ok"] for c in held)
    extra = gateway.control()
    assert extra.line()["error"] == "busy"
    held[0].close()
    gateway.controls.remove(held[0])
    ends = time.monotonic() + 5 * SLOW
    while True:
        again = gateway.control()
        try:
            if again.ask("hello")["ok"]:
                break
        except (KeyError, OSError):
            pass
        assert time.monotonic() < ends


def test_a_subscriber_that_does_not_read_loses_the_oldest_and_is_told(gateway):
    gateway.start(SOCKETPAIR + drive(), control="queue_bytes = 65536")
    slow = gateway.control()
    slow.ask("subscribe", topics=["sample"])
    axis, total, start = Axis(), 12000, time.monotonic_ns() - 20_000_000_000
    gateway.feed(axis, 2000, start)
    gateway.settle(2000)
    memory = gateway.memory_kB()
    gateway.feed(axis, total - 2000, start)
    status = gateway.settle(total)
    assert status["sources"][0]["used"] == total, "the slow one holds nobody up"
    assert gateway.memory_kB() - memory < 1000
    # Now it reads: whole lines in order, and how many are missing; together they are all.
    samples, lost, last = 0, 0, 0
    slow.socket.settimeout(1)
    try:
        while True:
            event = slow.line()
            if event.get("event") == "sample":
                samples += 1
                assert event["t_ns"] > last
                last = event["t_ns"]
            elif event.get("event") == "lost":
                lost += event["count"]
    except TimeoutError:
        pass
    gateway.feed(axis, 10, start)
    slow.socket.settimeout(5)
    while samples + lost < total + 10:
        event = slow.line()
        samples += event.get("event") == "sample"
        lost += event["count"] if event.get("event") == "lost" else 0
    assert samples + lost == total + 10
    assert lost > 1000


def test_the_json_lines_are_json_under_odd_names(gateway):
    gateway.start(SOCKETPAIR + drive(name="a.b-c_1"))
    assert json.loads(json.dumps(gateway.status()))["drives"][0]["name"] == "a.b-c_1"


def test_a_second_daemon_does_not_steal_the_socket(gateway):
    import subprocess

    from gateway import DAEMON

    gateway.start(SOCKETPAIR + drive())
    second = subprocess.run([DAEMON, "gw.toml"], cwd=gateway.folder, capture_output=True, text=True, timeout=20 * SLOW)
    assert second.returncode == 2 and "in use" in second.stderr
    assert gateway.status()["ok"]

# SPDX-License-Identifier: Apache-2.0
"""The client against a server of this test that speaks docs/manual/control-protocol.md."""

import json
import os
import socketserver
import threading

import pytest

from driveid.client import Client, GatewayError

STATUS = {"t_ns": 5, "memory_kB": 900, "sinks": [], "sources": [{"name": "can0", "kind": "socketcan", "address": "vcan0", "state": "up", "clock": "kernel", "frames": 10, "used": 8, "dropped": 0,
                                                                "rejected": 0, "errors": 0, "bus_state": "active", "rate_Hz": 1000.0, "last_error": ""}],
          "drives": [{"name": "axis1", "structure": "rigid_axis", "method": "fsm", "type": "f64", "state": "valid", "status": "ok", "t_ns": 5, "samples": 4, "rate_Hz": 1000.0,
                      "jitter_ns": 10, "gaps": 0, "dropped": 0, "rejected": 0, "restarts": 0, "time_to_first_trusted_s": 0.8, "residual": {"rms": 0.1, "unit": "N m", "alarm": False},
                      "parameters": [{"name": "J_kgm2", "value": 1.2e-4, "interval": [1.1e-4, 1.3e-4], "unit": "kg m^2", "valid": True, "age_s": 0.1},
                                     {"name": "B_Nms_rad", "value": None, "interval": None, "unit": "N m s/rad", "valid": False, "age_s": None}], "missing": ""}]}


class Handler(socketserver.StreamRequestHandler):
    def handle(self):
        for line in self.rfile:
            request = json.loads(line)
            self.server.seen.append(request)
            answer = {"driveid": 1, "id": request["id"], "ok": True}
            if request["cmd"] == "status":
                answer |= STATUS
            elif request["cmd"] == "subscribe":
                self.send(answer)
                for k in range(3):
                    self.send({"driveid": 1, "event": "estimate", "drive": "axis1", "t_ns": k, "state": "valid", "parameters": [], "residual": {}})
                if self.server.hang_up:
                    return
                continue
            elif request["cmd"] == "record_start":
                answer = {"driveid": 1, "id": request["id"], "ok": False, "error": "read_only", "message": "writing commands need [control] write_group"}
            elif request["cmd"] == "garbage":
                self.wfile.write(b"not json\n")
                continue
            elif request["cmd"] == "silence":
                continue
            self.send({"driveid": 1, "event": "event", "t_ns": 0, "level": "info", "component": "x", "text": "y"})  # events may come in between
            self.send(answer)

    def send(self, message):
        self.wfile.write(json.dumps(message).encode() + b"\n")


class Server(socketserver.ThreadingMixIn, socketserver.UnixStreamServer):
    daemon_threads = True
    hang_up = False


@pytest.fixture
def server(tmp_path):
    path = str(tmp_path / "c.sock")
    with Server(path, Handler) as s:
        s.seen = []
        threading.Thread(target=s.serve_forever, args=(0.02,), daemon=True).start()
        yield s
        s.shutdown()


def test_request_and_refusal(server):
    with Client(server.server_address) as client:
        assert client.status()["drives"][0]["name"] == "axis1"
        with pytest.raises(GatewayError, match="write_group"):
            client.request("record_start", file="a.drec")
        assert client.hello()["ok"]
    assert [r["id"] for r in server.seen] == [1, 2, 3]


def test_events_and_reconnection(server):
    server.hang_up = True
    with Client(server.server_address) as client:
        events = client.events(("estimate",), drives=["axis1"], decimate=2, reconnect_s=0.01)
        seen = [next(events)["event"] for _ in range(9)]
    assert seen[:4] == ["estimate"] * 3 + ["away"] and "back" in seen[4:6] and seen.count("estimate") >= 5
    subscribe = next(r for r in server.seen if r["cmd"] == "subscribe")
    assert subscribe["topics"] == ["estimate"] and subscribe["drives"] == ["axis1"] and subscribe["decimate"] == 2


def test_silence_and_nonsense(server):
    with Client(server.server_address, timeout_s=0.2) as client:
        with pytest.raises(GatewayError, match="silent for 0.2 s"):
            client.request("silence")
    with Client(server.server_address) as client:
        with pytest.raises(GatewayError, match="does not speak the control protocol"):
            client.request("garbage")


def test_nobody_there(tmp_path):
    with pytest.raises(GatewayError, match="start driveidd"):
        Client(tmp_path / "none.sock")


def test_status_command(server, driveid):
    code, out, err = driveid("status", "--socket", server.server_address)
    assert code == 0 and "axis1: rigid_axis, valid" in out and "J_kgm2" in out and "not known yet" in out
    assert "did not go into" not in out
    code, out, _ = driveid("status", "--socket", server.server_address, "--json", "-")
    assert code == 0 and json.loads(out)["drives"][0]["parameters"][0]["value"] == 1.2e-4
    code, out, err = driveid("status", env=os.environ | {"DRIVEID_SOCKET": "/tmp/no/such.sock"})
    assert code == 2 and out == "" and "no gateway at /tmp/no/such.sock" in err


def test_status_command_shows_what_was_lost(server, driveid, monkeypatch):
    monkeypatch.setitem(STATUS, "drives", [STATUS["drives"][0] | {"dropped": 3, "gaps": 2, "rejected": 41, "jumps": 7}])
    monkeypatch.setitem(STATUS, "sources", [STATUS["sources"][0] | {"errors": 13, "last_error": "bus off"}])
    code, out, _ = driveid("status", "--socket", server.server_address)
    assert code == 0 and "3 dropped, 2 gaps, 41 rejected, 7 jumps" in out
    titles, row = [line.split() for line in out.splitlines() if line.startswith(("source", "can0 "))]
    assert dict(zip(titles, row))["errors"] == "13" and "can0: bus off" in out


def test_record_command_is_refused_with_the_gateways_words(server, driveid):
    code, _, err = driveid("record", "a.drec", "--socket", server.server_address, "--seconds", "0.1")
    assert code == 2 and "write_group" in err
    code, _, err = driveid("record", "/tmp/a.drec", "--socket", server.server_address)
    assert code == 2 and "bare name, e.g. a.drec" in err

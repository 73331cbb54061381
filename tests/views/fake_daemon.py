# SPDX-License-Identifier: Apache-2.0
"""A small daemon that speaks docs/manual/control-protocol.md: one axis, eight signals, one bus. For screens that are tested without a bus."""

from __future__ import annotations

import asyncio
import json
import math
import sys
import time

SIGNALS = ("i_q_A", "i_d_A", "v_q_V", "v_d_V", "theta_rad", "omega_rad_s", "tau_Nm", "T_degC")


class FakeDaemon:
    """Serves until stopped. rate: samples per second; write: whether commands that change something are allowed."""

    def __init__(self, path: str, rate: float = 1000.0, write: bool = True) -> None:
        self.path, self.rate, self.write = path, rate, write
        self.marks: list[str] = []
        self.recording = ""
        self.begin = time.monotonic()
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task] = set()
        self._writers: set[asyncio.StreamWriter] = set()

    async def start(self) -> None:
        self._server = await asyncio.start_unix_server(self._client, self.path)

    async def stop(self) -> None:
        self._server.close()
        for task in list(self._tasks):
            task.cancel()
        for writer in list(self._writers):
            writer.close()

    def _parameters(self, age: float) -> list[dict]:
        spread = 1.0 / (1.0 + age)
        value = 1.2e-4 * (1 + 0.05 * spread * math.sin(3 * age))
        return [{"name": "J_kgm2", "value": value, "interval": [value * (1 - 0.01 * (1 + spread)), value * (1 + 0.01 * (1 + spread))], "unit": "kg m^2", "valid": age > 1, "age_s": 0.01},
                {"name": "B_Nms_rad", "value": 3e-5, "interval": [2.7e-5, 3.3e-5], "unit": "N m s/rad", "valid": age > 1, "age_s": 0.01},
                {"name": "psi_pm_Vs", "value": None, "interval": None, "unit": "V s", "valid": False, "age_s": None}]

    def _residual(self, age: float) -> dict:
        alarm = age % 60 > 50
        return {"rms": 3.1e-4 if not alarm else 4e-3, "unit": "N m", "alarm": alarm, "since_ns": 0, "regime": "low speed" if alarm else "", "likely_effect": "coulomb" if alarm else ""}

    def status(self) -> dict:
        age = time.monotonic() - self.begin
        drives = [{"name": "axis1", "structure": "rigid_axis", "method": "fsm", "type": "f64", "state": "valid" if age > 1 else "identifying", "status": "new estimate", "t_ns": time.monotonic_ns(),
                   "samples": int(age * self.rate), "rate_Hz": self.rate, "jitter_ns": 12_400, "gaps": 0, "dropped": 0, "rejected": 0, "restarts": 0, "time_to_first_trusted_s": 0.9,
                   "residual": self._residual(age), "parameters": self._parameters(age), "missing": "psi_pm_Vs needs v_q_V while the motor turns"},
                  {"name": "axis2", "structure": "dc_circuit", "method": "fsm", "type": "f32", "state": "waiting", "status": "not yet", "t_ns": 0, "samples": 0, "rate_Hz": 0.0, "jitter_ns": 0,
                   "gaps": 0, "dropped": 0, "rejected": 0, "restarts": 0, "time_to_first_trusted_s": None, "residual": {}, "parameters": [], "missing": ""}]
        sources = [{"name": "can0", "kind": "socketcan", "address": "vcan0", "state": "open", "clock": "software", "frames": int(age * 2000), "used": int(age * 2000), "dropped": 0, "rejected": 0,
                    "errors": 0, "bus_state": "active", "rate_Hz": 2000.0, "buffer_asked": 4194304, "buffer_granted": 4194304, "last_error": ""}]
        return {"t_ns": time.monotonic_ns(), "drives": drives, "sources": sources, "sinks": [], "memory_kB": 9000}

    def _answer(self, request: dict) -> dict:
        cmd = request.get("cmd")
        if cmd in ("record_start", "record_stop", "mark", "restart", "reload") and not self.write:
            return {"ok": False, "error": "read_only", "message": "this socket is read-only: set [control] write_group and join that group"}
        if cmd == "hello":
            return {"ok": True, "version": "0.1.0", "pid": 1, "uptime_s": 1.0, "config_file": "x.toml", "write": self.write, "drives": ["axis1", "axis2"], "sources": ["can0"], "sinks": []}
        if cmd == "status":
            return {"ok": True, **self.status()}
        if cmd == "record_start":
            self.recording = f"/var/lib/driveid/records/{request['file']}"
            return {"ok": True, "file": self.recording}
        if cmd == "record_stop":
            return {"ok": True, "file": self.recording, "entries": 1234, "bytes": 56789}
        if cmd == "mark":
            self.marks.append(request["text"])
        return {"ok": cmd in ("subscribe", "unsubscribe", "mark"), "error": "unknown", "message": f"no command {cmd}"}

    async def _client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        try:
            while line := await reader.readline():
                request = json.loads(line)
                self._send(writer, {"id": request["id"], **self._answer(request)})
                if request["cmd"] == "subscribe":
                    task = asyncio.create_task(self._publish(writer, request["topics"]))
                    self._tasks.add(task)
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            writer.close()

    @staticmethod
    def _send(writer: asyncio.StreamWriter, message: dict) -> None:
        writer.write(json.dumps({"driveid": 1, **message}).encode() + b"\n")

    async def _publish(self, writer: asyncio.StreamWriter, topics: list[str]) -> None:
        sent, second = 0, 0
        first = time.monotonic()
        if "event" in topics:
            self._send(writer, {"event": "event", "t_ns": 0, "level": "warning", "component": "can0", "text": "buffer smaller than asked", "mend": "raise net.core.rmem_max", "count": 1})
        while not writer.is_closing():
            await asyncio.sleep(0.02)
            now = time.monotonic()
            due = int((now - first) * self.rate)
            if "sample" in topics:
                for k in range(sent, due):
                    t = first + k / self.rate
                    values = {name: math.sin(2 * math.pi * (0.3 + 0.2 * n) * t) * (n + 1) + 0.03 * math.sin(997.0 * t * (n + 1)) for n, name in enumerate(SIGNALS)}
                    self._send(writer, {"event": "sample", "drive": "axis1", "t_ns": int(t * 1e9), "values": values})
            sent = due
            age = now - self.begin
            if "estimate" in topics:
                self._send(writer, {"event": "estimate", "drive": "axis1", "t_ns": int(now * 1e9), "state": "valid" if age > 1 else "identifying",
                                    "parameters": self._parameters(age), "residual": self._residual(age)})
            if "status" in topics and int(now - first) > second:
                second = int(now - first)
                self._send(writer, {"event": "status", **self.status()})
            await writer.drain()


async def _main(path: str) -> None:
    await FakeDaemon(path).start()
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(_main(sys.argv[1]))

# SPDX-License-Identifier: Apache-2.0
"""A running driveidd under test, fed over the inherited socketpair; an axis solved exactly; a client of the control socket."""
import contextlib
import json
import math
import os
import signal
import socket
import struct
import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("DRIVEID_BUILD", ROOT / "build"))
DAEMON = Path(os.environ.get("DRIVEIDD", BUILD / "daemon/driveidd"))
SLOW = float(os.environ.get("DRIVEID_SLOW", "1"))  # a sanitizer's build takes so many times longer
J, B, K_T = 2e-4, 1e-3, 0.05
COUNTS = 1 << 20


def frame(can_id, data, stamp_ns, fd=False, flags=0):
    """{struct can_frame | canfd_frame, int64 stamp} of the socketpair seam."""
    if fd:
        return struct.pack("<IBBBB64sq", can_id, len(data), flags, 0, 0, data, stamp_ns)
    return struct.pack("<IBBBB8sq", can_id, len(data), 0, 0, 0, data, stamp_ns)


class Axis:
    """J dw/dt = K_t i - B w under piecewise constant current, solved exactly."""

    def __init__(self, inertia=J, friction=B, dt_s=0.001, can_id=0x181):
        self.inertia, self.friction, self.dt_s, self.can_id = inertia, friction, dt_s, can_id
        self.theta, self.omega, self.k = 0.0, 0.0, 0

    def current(self):
        return 2.0 if (self.k * self.dt_s) % 0.271 < 0.137 else -1.5

    def sample(self, start_ns):
        """(stamp, current, angle) now; then one step on."""
        i, stamp, theta = self.current(), start_ns + round(self.k * self.dt_s * 1e9), self.theta
        a, end = self.friction / self.inertia, K_T * i / self.friction
        decay = math.exp(-a * self.dt_s)
        self.theta += end * self.dt_s + (self.omega - end) * (1 - decay) / a
        self.omega = end + (self.omega - end) * decay
        self.k += 1
        return stamp, i, theta

    def frames(self, n, start_ns):
        for _ in range(n):
            stamp, i, theta = self.sample(start_ns)
            data = struct.pack("<hI", round(i * 1000), math.floor(theta / (2 * math.pi) * COUNTS) & 0xFFFFFFFF)
            yield frame(self.can_id, data, stamp)


DRIVE = """
[[drive]]
name = "{name}"
structure = "rigid_axis"
given = {{ K_t_Nm_A = 0.05 }}
dt_s = 0.001
type = "{type}"
{keys}
  [[drive.signal]]
  name = "i_q_A"
  source = "{source}"
  can_id = {can_id}
  signed = true
  scale = 0.001
  hold = "zoh"
  [[drive.signal]]
  name = "theta_rad"
  source = "{source}"
  can_id = {can_id}
  start_bit = 16
  length = 32
  counts_per_turn = 1048576
"""


def drive(name="axis1", source="bus", can_id=0x181, type="f64", keys=""):
    return DRIVE.format(name=name, source=source, can_id=can_id, type=type, keys=keys)


class Control:
    """Independent client: lines in, lines out."""

    def __init__(self, path, timeout=10.0):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(timeout * SLOW)
        self.socket.connect(str(path))
        self.buffer, self.id = b"", 0

    def send(self, **request):
        self.id += 1
        self.socket.sendall(json.dumps({"driveid": 1, "id": self.id} | request).encode() + b"\n")
        return self.id

    def line(self):
        while b"\n" not in self.buffer:
            part = self.socket.recv(65536)
            if not part:
                raise ConnectionError("the daemon closed the connection")
            self.buffer += part
        text, _, self.buffer = self.buffer.partition(b"\n")
        return json.loads(text)

    def ask(self, cmd, **arguments):
        wanted = self.send(cmd=cmd, **arguments)
        while True:
            message = self.line()
            if message.get("id") == wanted:
                return message

    def close(self):
        self.socket.close()


class Gateway:
    def __init__(self, folder):
        self.folder, self.process, self.bus, self.controls = Path(folder), None, [], []
        self.socket = self.folder / "c.sock"
        self.log = self.folder / "log"

    def write(self, text, name="gw.toml", security='[security]\nseccomp = "on"\n', control=""):
        if os.environ.get("DRIVEID_SECCOMP") == "off":
            security = security.replace('"on"', '"off"')
        (self.folder / name).write_text(f'format = 1\n[control]\nsocket = "{self.socket}"\n{control}\n{security}\n{text}')

    def start(self, text=None, buses=1, options=(), wait=True, prefix=(), env=None, **write):
        """Descriptors of the buses are 10, 11, ... in the daemon; self.bus[k] is this side."""
        if text is not None:
            self.write(text, **write)
        theirs = []
        while self.bus:
            self.bus.pop().close()
        for _ in range(buses):
            mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            mine.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
            mine.settimeout(20 * SLOW)
            self.bus.append(mine)
            theirs.append(its)
        numbers = [its.fileno() for its in theirs]
        shell = "; ".join(f"exec {10 + k}<&{n}" for k, n in enumerate(numbers)) + '; exec "$@"' if numbers else 'exec "$@"'
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(["bash", "-c", shell, "bash", *prefix, str(DAEMON), "gw.toml", *options], cwd=self.folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                            pass_fds=numbers, env=os.environ | (env or {}))
        for its in theirs:
            its.close()
        if wait:
            self.wait_ready()
        return self

    def wait_ready(self):
        ends = time.monotonic() + 20 * SLOW
        while True:
            assert self.process.poll() is None, self.text()
            try:
                control = Control(self.socket)
                control.ask("hello")
                control.close()
                return
            except (OSError, ConnectionError):
                assert time.monotonic() < ends, self.text()
                time.sleep(0.02)

    def text(self):
        return self.log.read_text(errors="replace")

    def control(self):
        control = Control(self.socket)
        self.controls.append(control)
        return control

    def status(self):
        control = Control(self.socket)
        try:
            return control.ask("status")
        finally:
            control.close()

    def until(self, condition, seconds=10.0, what="what was waited for"):
        ends = time.monotonic() + seconds * SLOW
        while True:
            assert self.process.poll() is None, self.text()
            status = self.status()
            if condition(status):
                return status
            assert time.monotonic() < ends, f"{what} did not happen: {json.dumps(status)[:3000]}\n{self.text()[-2000:]}"
            time.sleep(0.03)

    def feed(self, axis, n, start_ns=None, bus=0):
        """n samples as fast as the daemon takes them; the last one is stamped about now unless told otherwise."""
        start_ns = time.monotonic_ns() - round((axis.k + n) * axis.dt_s * 1e9) if start_ns is None else start_ns
        for message in axis.frames(n, start_ns):
            self.bus[bus].send(message)
        return start_ns

    def drain(self, bus=0):
        """Messages that wait on this side of the bus, taken out."""
        self.bus[bus].setblocking(False)
        try:
            for _ in range(10000):
                self.bus[bus].recv(100)
        except BlockingIOError:
            pass
        finally:
            self.bus[bus].settimeout(20 * SLOW)

    def settle(self, frames, source=0, seconds=20):
        return self.until(lambda s: s["sources"][source]["frames"] >= frames, seconds, f"{frames} frames")

    def stop(self, sign=signal.SIGTERM):
        self.process.send_signal(sign)
        return self.process.wait(20 * SLOW)

    def close(self):
        for control in self.controls:
            control.close()
        if self.process and self.process.poll() is None:
            if "DRIVEID_GENTLE" in os.environ:  # a process that is killed leaves no coverage
                self.end_gently()
            self.process.kill()
            self.process.wait()
        for bus in self.bus:
            bus.close()
        self.bus.clear()

    def end_gently(self):
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(10)

    def memory_kB(self):
        for line in Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith("VmRSS"):
                return int(line.split()[1])
        return 0


SOCKETPAIR = """
[[source]]
name = "bus"
kind = "socketpair"
descriptor = 10
"""


def parameters(status, which=0):
    return {p["name"]: p for p in status["drives"][which]["parameters"]}


def near_truth(status, which=0, inertia=J, friction=B):
    """Trusted, and the truth inside three half-widths and within 5 %."""
    shown = parameters(status, which)
    truth = {"J_kgm2": inertia, "B_Nms_rad": friction}
    return all(shown[n]["valid"] and abs(shown[n]["value"] - v) <= min(1.5 * (shown[n]["interval"][1] - shown[n]["interval"][0]), 0.05 * v) for n, v in truth.items())

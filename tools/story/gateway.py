# SPDX-License-Identifier: Apache-2.0
"""Programs of the story and the daemon's control socket (docs/manual/control-protocol.md)."""
import json
import os
import select
import signal
import socket
import subprocess
import time


class Programs:
    """Starts programs in one folder; none outlives this object."""

    def __init__(self, folder):
        self.folder = folder
        self.running = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop_all()

    def stop_all(self):
        while self.running:
            stop(self.running.pop())

    def start(self, name, command, **options):
        with open(self.folder / f"{name}.log", "wb") as log:
            program = subprocess.Popen([str(word) for word in command], cwd=self.folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log, **options)
        program.name = name
        self.running.append(program)
        return program

    def check(self):
        """Raise where a program that should run has ended badly."""
        for program in self.running:
            if program.poll():
                raise RuntimeError(f"{program.name} ended with code {program.returncode}:\n{self.tail(program.name)}")

    def tail(self, name, lines=15):
        return "\n".join((self.folder / f"{name}.log").read_text(errors="replace").splitlines()[-lines:])


def stop(program):
    if program.poll() is None:
        program.send_signal(signal.SIGTERM)
        try:
            program.wait(5)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()


class Control:
    """Connection to driveidd: requests with answers."""

    def __init__(self, path, patience_s=10.0, check=lambda: None):
        self.buffer, self.last_id = b"", 0
        until = time.monotonic() + patience_s
        while True:
            self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                self.socket.connect(os.fspath(path))
                return
            except OSError:
                self.socket.close()
                check()
                if time.monotonic() > until:
                    raise TimeoutError(f"driveidd opened no control socket {path} within {patience_s:g} s") from None
                time.sleep(0.05)

    def close(self):
        self.socket.close()

    def message(self, timeout_s):
        until = time.monotonic() + timeout_s
        while b"\n" not in self.buffer:
            if not select.select([self.socket], [], [], max(0, until - time.monotonic()))[0]:
                raise TimeoutError("driveidd does not answer")
            data = self.socket.recv(65536)
            if not data:
                raise ConnectionError("driveidd closed its control socket")
            self.buffer += data
        line, self.buffer = self.buffer.split(b"\n", 1)
        return json.loads(line)

    def ask(self, cmd, timeout_s=5.0, **arguments):
        self.last_id += 1
        self.socket.sendall(json.dumps({"driveid": 1, "id": self.last_id, "cmd": cmd, **arguments}).encode() + b"\n")
        while True:
            answer = self.message(timeout_s)
            if answer.get("id") == self.last_id:
                if not answer["ok"]:
                    raise RuntimeError(f"{cmd}: {answer['message']}")
                return answer

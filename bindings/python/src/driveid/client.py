# SPDX-License-Identifier: Apache-2.0
"""Client of the gateway's control socket (docs/manual/control-protocol.md). For event loops see views.feed."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Iterator

from .errors import DriveidError

LINE_LIMIT = 1 << 18


def default_socket() -> str:
    return os.environ.get("DRIVEID_SOCKET", "/run/driveid/control.sock")


class GatewayError(DriveidError):
    """The gateway is away, or it refused the request; the text says what to do."""


def why_away(path: str, error: Exception, silent_s: float) -> str:
    """Why the gateway at `path` does not answer, and what to do."""
    if isinstance(error, FileNotFoundError):
        return f"no gateway at {path}: start driveidd, or give --socket"
    if isinstance(error, ConnectionRefusedError):
        return f"nobody listens at {path}: driveidd has ended"
    if isinstance(error, PermissionError):
        return f"no permission for {path}: join the group of the socket"
    if isinstance(error, TimeoutError):
        return f"the gateway at {path} has been silent for {silent_s:g} s"
    return f"{path}: {error.strerror or error}" if isinstance(error, OSError) else str(error) or type(error).__name__


class Client:
    """One connection. request() asks; events() listens and, when the gateway goes away, comes back with it."""

    def __init__(self, path: str | os.PathLike | None = None, timeout_s: float = 5.0):
        self.path = str(path or default_socket())
        self.timeout_s = timeout_s
        self._socket: socket.socket | None = None
        self._rest = b""
        self._id = 0
        self._events: list[dict] = []
        self.connect()

    def connect(self) -> None:
        self.close()
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        connection.settimeout(self.timeout_s)
        try:
            connection.connect(self.path)
        except OSError as e:
            connection.close()
            raise GatewayError(why_away(self.path, e, self.timeout_s)) from None
        self._socket, self._rest, self._events = connection, b"", []

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def request(self, cmd: str, **arguments) -> dict:
        """Send one request, wait for its answer. GatewayError where it is refused, with the gateway's own sentence."""
        if self._socket is None:
            raise GatewayError(f"not connected to {self.path}")
        self._id += 1
        wanted = self._id
        line = json.dumps({"driveid": 1, "id": wanted, "cmd": cmd, **arguments}).encode() + b"\n"
        try:
            self._socket.sendall(line)
        except OSError as e:
            self.close()
            raise GatewayError(why_away(self.path, e, self.timeout_s)) from None
        deadline = time.monotonic() + self.timeout_s
        while True:
            message = self._read(deadline)
            if "event" in message:
                self._events.append(message)
            elif message.get("id") == wanted:
                if not message.get("ok"):
                    raise GatewayError(message.get("message") or message.get("error") or f"the gateway refused {cmd}")
                return message

    def _read(self, deadline: float | None) -> dict:
        while b"\n" not in self._rest:
            if self._socket is None:
                raise GatewayError(f"not connected to {self.path}")
            try:
                self._socket.settimeout(None if deadline is None else max(deadline - time.monotonic(), 1e-3))
                data = self._socket.recv(1 << 16)
            except OSError as e:
                self.close()
                raise GatewayError(why_away(self.path, e, self.timeout_s)) from None
            if not data or len(self._rest) > LINE_LIMIT:
                self.close()
                raise GatewayError(f"the gateway at {self.path} closed the connection")
            self._rest += data
        line, _, self._rest = self._rest.partition(b"\n")
        try:
            message = json.loads(line)
        except ValueError:
            message = None
        if not isinstance(message, dict):
            self.close()
            raise GatewayError(f"{self.path} does not speak the control protocol")
        return message

    def events(self, topics: tuple[str, ...] = ("estimate", "event", "status"), *, drives: list[str] | None = None, decimate: int = 1,
               reconnect_s: float | None = 1.0) -> Iterator[dict]:
        """Events for ever. Where the gateway goes away an {"event": "away", "message"} is given, and again one {"event": "back"}.

        reconnect_s=None: GatewayError ends it instead."""
        arguments: dict = {"topics": list(topics), "decimate": decimate}
        if drives:
            arguments["drives"] = drives
        subscribed = False
        while True:
            try:
                if self._socket is None:
                    self.connect()
                    subscribed = False
                    self.request("hello")
                    yield {"driveid": 1, "event": "back"}
                if not subscribed:
                    self.request("subscribe", **arguments)
                    subscribed = True
                while self._events:
                    yield self._events.pop(0)
                yield self._read(None)
            except GatewayError as e:
                if reconnect_s is None:
                    raise
                self.close()
                yield {"driveid": 1, "event": "away", "message": str(e)}
                time.sleep(reconnect_s)

    def hello(self) -> dict:
        return self.request("hello")

    def status(self) -> dict:
        return self.request("status")

# SPDX-License-Identifier: Apache-2.0
"""Connection to the control socket that heals itself, for screens that run in an event loop."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable

from ..client import why_away
from .gateway import Gateway

LINE_LIMIT = 1 << 16
RETRY_S = 1.0
SILENCE_S = 5.0  # status comes once a second


class NotConnected(Exception):
    """The gateway is away, or it refused the request; the text says what to do."""


class Feed:
    """Keeps a Gateway fed. ``changed`` is called after each batch of messages and when the connection comes or goes."""

    def __init__(self, path: str, gateway: Gateway, topics: tuple[str, ...] = ("estimate", "event", "status"), changed: Callable[[], None] = lambda: None) -> None:
        self.path, self.gateway, self.topics, self.changed = path, gateway, topics, changed
        gateway.address = path
        self._writer: asyncio.StreamWriter | None = None
        self._waiting: dict[int, asyncio.Future] = {}
        self._id = 0

    async def run(self) -> None:
        """Connect, listen, and begin again for ever; ends when cancelled."""
        while True:
            try:
                await self._session()
                self._away("the gateway closed the connection")
            except (OSError, TimeoutError, ValueError, NotConnected) as error:
                self._away(why_away(self.path, error, SILENCE_S))
            await asyncio.sleep(RETRY_S)

    def _nobody_answers(self, listening: asyncio.Task) -> None:
        """Nobody listens any more: who waits for an answer is told at once."""
        error = None if listening.cancelled() else listening.exception()
        self._fail_waiting(why_away(self.path, error, SILENCE_S) if error else "the gateway closed the connection")

    def _fail_waiting(self, reason: str) -> None:
        for future in self._waiting.values():
            if not future.done():
                future.set_exception(NotConnected(reason))
        self._waiting.clear()

    def _away(self, reason: str) -> None:
        self._fail_waiting(reason)
        self._writer = None
        self.gateway.set_connected(False, reason)
        self.changed()

    async def _session(self) -> None:
        reader, writer = await asyncio.open_unix_connection(self.path, limit=LINE_LIMIT * 4)
        self._writer = writer
        listening = asyncio.create_task(self._listen(reader))
        listening.add_done_callback(self._nobody_answers)
        try:
            self.gateway.take(await self.request("hello"))
            self.gateway.take(await self.request("status"))
            await self.request("subscribe", topics=list(self.topics))
            self.gateway.set_connected(True)
            self.changed()
            await listening
        finally:
            listening.cancel()
            writer.close()
            with contextlib.suppress(asyncio.CancelledError, OSError, TimeoutError, ValueError):
                await listening

    async def _listen(self, reader: asyncio.StreamReader) -> None:
        rest = b""
        while True:
            async with asyncio.timeout(SILENCE_S):  # not wait_for: that may swallow a cancellation
                data = await reader.read(1 << 18)
            if not data:
                return
            lines = (rest + data).split(b"\n")
            rest = lines.pop()
            if len(rest) > LINE_LIMIT * 4:
                raise ValueError("the gateway sent a line that is too long")
            for line in lines:
                if line:
                    self._understand(line)
            self.changed()

    def _understand(self, line: bytes) -> None:
        try:
            self._take(json.loads(line))
        except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
            raise ValueError(f"what listens at {self.path} does not speak the control protocol ({line[:40]!r})") from error

    def _take(self, message: dict) -> None:
        future = self._waiting.pop(message.get("id"), None) if "event" not in message else None
        if future and not future.done():
            future.set_result(message)
        elif "event" in message:
            self.gateway.take(message)

    async def request(self, cmd: str, **arguments: object) -> dict:
        """Send one request and wait for its answer; NotConnected says why there is none."""
        if self._writer is None:
            raise NotConnected(self.gateway.trouble or "the gateway is not connected")
        self._id += 1
        future = asyncio.get_running_loop().create_future()
        self._waiting[self._id] = future
        message = {"driveid": 1, "id": self._id, "cmd": cmd, **arguments}
        self._writer.write(json.dumps(message).encode() + b"\n")
        try:
            await self._writer.drain()
            async with asyncio.timeout(SILENCE_S):
                answer = await future
        except (OSError, TimeoutError) as error:
            raise NotConnected(why_away(self.path, error, SILENCE_S)) from error
        if not answer.get("ok"):
            raise NotConnected(answer.get("message") or answer.get("error") or f"the gateway refused {cmd}")
        return answer

    async def record(self, name: str = "") -> str:
        """Start recording (with a name) or stop it; returns words for people."""
        if self.gateway.recording and not name:
            answer = await self.request("record_stop")
            self.gateway.recording = ""
            return f"{answer.get('entries', '?')} entries in {answer.get('file', '')}"
        answer = await self.request("record_start", file=name)
        self.gateway.recording = str(answer.get("file", name))
        return f"recording into {self.gateway.recording}"

    async def mark(self, text: str) -> None:
        await self.request("mark", text=text)
        self.gateway.note("info", "mark", text)

# SPDX-License-Identifier: Apache-2.0
"""Live page: what the gateway says, pushed to the browser as binary frames, each drawn before the next is sent."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time

from starlette.websockets import WebSocket

from .. import units
from ..feed import Feed, NotConnected
from ..gateway import STATES, Gateway, bus_rows, lamp, skew
from .wire import pack

LINGER_S = 5.0
MARKS_S = 12.0  # as long as the plots reach back
PERIOD_S = 0.04  # 25 pictures a second at most; the browser's word after each picture paces it


def panel(gateway: Gateway) -> dict:
    """Everything of the live page that is words and numbers."""
    drives = []
    for drive in gateway.drives.values():
        words, kind = STATES.get(drive.get("state", ""), (drive.get("state") or "unknown", "soft"))
        lamp_kind, lamp_words = lamp(drive)
        if not gateway.connected:
            words, kind, lamp_kind, lamp_words = "not seen", "soft", "soft", "the gateway is away"
        drives.append({
            "name": drive["name"], "structure": str(drive.get("structure", "")).replace("_", " "), "method": drive.get("method", ""),
            "state": words, "kind": kind, "lamp": lamp_kind, "lamp_words": lamp_words, "missing": drive.get("missing") or "",
            "rates": rates(drive), "parameters": [p | {"html": units.symbol_html(p["name"]), "trend": p["trend"][-80:]} for p in gateway.rows(drive)]})
    return {"connected": gateway.connected, "trouble": gateway.trouble, "since_s": round(time.monotonic() - gateway.changed, 1), "address": gateway.address,
            "write": bool(gateway.hello.get("write")), "version": gateway.hello.get("version", ""), "recording": gateway.recording, "lost": gateway.lost,
            "drives": drives, "buses": bus_rows(gateway.status), "events": list(gateway.events)[-40:]}


def rates(drive: dict) -> str:
    if "samples" not in drive:
        return ""
    jitter = units.number((drive.get("jitter_ns") or 0) * 1e-9, "s", 3)
    first = drive.get("time_to_first_trusted_s")
    trusted = f", first trusted estimate after {units.number(first, 's', 2)}" if first is not None else ""
    return (f"{units.number(drive.get('rate_Hz'), 'Hz', 4)}, jitter {jitter}, {drive.get('dropped', 0)} dropped, {drive.get('gaps', 0)} gaps, "
            f"{drive.get('restarts', 0)} restarts{trusted}" + (f", {skew(drive)}" if skew(drive) else ""))


class Live:
    """One connection to the gateway, shared by all live pages; open while a page looks (an idle workbench costs nothing)."""

    def __init__(self, socket: str) -> None:
        self.gateway = Gateway()
        self.feed = Feed(socket, self.gateway, ("estimate", "sample", "event", "status"))
        self._task: asyncio.Task | None = None
        self._lookers = 0
        self._leaving: set[asyncio.Task] = set()

    def _look(self) -> None:
        self._lookers += 1
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self.feed.run())

    async def _leave(self) -> None:
        """The last page keeps the connection some seconds, so that a reload does not lose the history."""
        self._lookers -= 1
        await asyncio.sleep(LINGER_S)
        if self._lookers == 0:
            await self.stop()

    async def stop(self) -> None:
        task, self._task = self._task, None
        if task is None:
            return
        task.cancel()
        self.gateway.connected, self.gateway.connections = False, 0
        with contextlib.suppress(asyncio.CancelledError):
            await task

    async def serve(self, socket: WebSocket) -> None:
        await socket.accept()
        self._look()
        drawn = asyncio.Event()
        drawn.set()
        wish: dict = {"drive": socket.query_params.get("drive", ""), "sent": -1}
        both = [asyncio.create_task(self._listen(socket, drawn, wish)), asyncio.create_task(self._push(socket, drawn, wish))]
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)  # the page left, went to sleep, or the workbench ends
        except asyncio.CancelledError:
            pass
        finally:
            for task in both:
                task.cancel()
            await asyncio.gather(*both, return_exceptions=True)
            self._leaving.add(task := asyncio.create_task(self._leave()))
            task.add_done_callback(self._leaving.discard)

    async def _push(self, socket: WebSocket, drawn: asyncio.Event, wish: dict) -> None:
        words_at = 0.0
        while True:
            async with asyncio.timeout(30.0):
                await drawn.wait()
            drawn.clear()
            begin = time.monotonic()
            head: dict = {}
            if begin - words_at >= 0.25:
                head["panel"], words_at = panel(self.gateway), begin
            await socket.send_bytes(self._picture(head, wish))
            await asyncio.sleep(max(0.0, PERIOD_S - (time.monotonic() - begin)))

    def _picture(self, head: dict, wish: dict) -> bytes:
        drive = wish["drive"] or next(iter(self.gateway.windows), "")
        window = self.gateway.windows.get(drive)
        if window is None:
            return pack(head, {})
        window.flush()
        if wish.get("names") != window.names or window.head < wish["sent"]:
            wish["sent"], wish["names"] = -1, list(window.names)
        first, values = window.since(wish["sent"])
        wish["sent"] = window.head  # the newest bucket is still being filled: it is sent again
        names = [{"name": n, "symbol": units.symbol(n), "unit": units.split_name(n)[1]} for n in window.names]
        head |= {"first": first, "count": int(values.shape[1]), "buckets": window.buckets, "bucket_s": window.bucket_ns * 1e-9, "signals": names,
                 "rate_Hz": float(self.gateway.drives.get(drive, {}).get("rate_Hz") or 0.0), "marks": self._marks()}
        return pack(head, {"values": values})

    def _marks(self) -> list[dict]:
        """Marks of the last seconds: how long ago, and their text."""
        now = time.time()
        return [{"age_s": round(now - e["wall"], 3), "text": e["text"]} for e in self.gateway.events if e["component"] == "mark" and now - e["wall"] < MARKS_S]

    async def _listen(self, socket: WebSocket, drawn: asyncio.Event, wish: dict) -> None:
        while True:
            text = await socket.receive_text()
            if text == "drawn":
                drawn.set()
                continue
            message = json.loads(text)
            if "drive" in message:
                wish.update(drive=str(message["drive"]), sent=-1)
            try:
                if message.get("cmd") == "record":
                    name = "" if self.gateway.recording else time.strftime("workbench-%Y%m%d-%H%M%S.drec")
                    self.gateway.note("info", "record", await self.feed.record(name))
                elif message.get("cmd") == "mark":
                    await self.feed.mark(str(message.get("text", ""))[:200])
            except NotConnected as error:
                self.gateway.note("warning", message["cmd"], str(error))

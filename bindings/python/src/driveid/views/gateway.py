# SPDX-License-Identifier: Apache-2.0
"""What the gateway says, as view data: drives, parameters, sources, events and the last seconds of the signals.

Fed with the messages of docs/manual/control-protocol.md; shared by the live page and the terminal monitor; draws nothing."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import units

STATES = {
    "waiting": ("waiting for samples", "soft"), "identifying": ("identifying", "warn"), "valid": ("valid", "good"),
    "frozen": ("frozen: too little motion", "warn"), "stale": ("stale: no samples", "bad"), "error": ("error", "bad"),
}
HISTORY = 240  # estimates kept for a sparkline


class Window:
    """Least and greatest value of each signal in buckets of equal time, over the last seconds."""

    def __init__(self, seconds: float = 10.0, buckets: int = 1000) -> None:
        self.buckets = buckets
        self.bucket_ns = int(seconds * 1e9 / buckets)
        self.names: list[str] = []
        self.lo = np.full((0, buckets), np.nan, dtype=np.float32)
        self.hi = self.lo.copy()
        self.head = -1  # number of the newest bucket since the epoch of the clock
        self._pending: list[tuple[int, dict[str, float]]] = []

    def add(self, t_ns: int, values: dict[str, float]) -> None:
        self._pending.append((t_ns, values))
        if len(self._pending) > 20_000:  # nobody looks: keep what the window can show
            self.flush()

    def _row(self, name: str) -> int:
        if name not in self.names:
            self.names.append(name)
            empty = np.full((1, self.buckets), np.nan, dtype=np.float32)
            self.lo, self.hi = np.vstack([self.lo, empty]), np.vstack([self.hi, empty])
        return self.names.index(name)

    def flush(self) -> None:
        """Put what came since the last call into the buckets."""
        pending, self._pending = self._pending, []
        if not pending:
            return
        number = np.array([t for t, _ in pending], dtype=np.int64) // self.bucket_ns
        newest = int(number.max())
        if newest < self.head - self.buckets:  # the clock was set back: another daemon
            self.head = -1
        if self.head < 0:
            self.head = newest - self.buckets
        gone = min(newest - self.head, self.buckets)
        if gone > 0:
            cleared = (np.arange(newest - gone + 1, newest + 1)) % self.buckets
            self.lo[:, cleared] = self.hi[:, cleared] = np.nan
            self.head = newest
        keep = number > self.head - self.buckets
        slot = number[keep] % self.buckets
        for name in dict.fromkeys(n for _, values in pending for n in values):
            row = self._row(name)
            value = np.array([values.get(name, np.nan) for _, values in pending], dtype=np.float32)[keep]
            np.fmin.at(self.lo[row], slot, value)
            np.fmax.at(self.hi[row], slot, value)

    def since(self, number: int) -> tuple[int, np.ndarray]:
        """First bucket and values[signals, count, 2] of the buckets from ``number`` on, as far as they are kept."""
        self.flush()
        first = max(number, self.head - self.buckets + 1)
        slot = np.arange(first, self.head + 1) % self.buckets
        return first, np.stack([self.lo[:, slot], self.hi[:, slot]], axis=2)


@dataclass
class Gateway:
    """State of one gateway as the last messages tell it."""

    address: str = ""
    connected: bool = False
    changed: float = field(default_factory=time.monotonic)
    trouble: str = ""
    hello: dict = field(default_factory=dict)
    status: dict = field(default_factory=dict)
    drives: dict[str, dict] = field(default_factory=dict)
    events: deque = field(default_factory=lambda: deque(maxlen=200))
    event_count: int = 0
    history: dict[tuple[str, str], deque] = field(default_factory=dict)
    windows: dict[str, Window] = field(default_factory=dict)
    recording: str = ""
    lost: int = 0
    connections: int = 0

    def set_connected(self, connected: bool, trouble: str = "") -> None:
        if connected != self.connected:
            self.changed = time.monotonic()
            self.connections += connected
            if connected and self.connections > 1:
                self.note("info", "gateway", "the gateway is back")
            elif not connected and self.connections:
                self.note("warning", "gateway", "the gateway does not answer")
                self.recording = ""
        self.connected, self.trouble = connected, trouble

    def note(self, level: str, component: str, text: str, mend: str = "", count: int = 1) -> None:
        last = self.events[-1] if self.events else {}
        if (last.get("component"), last.get("text")) == (component, text):  # the same again: counted, not listed
            last.update(wall=time.time(), count=last["count"] + count)
            return
        self.event_count += 1
        self.events.append({"level": level, "component": component, "text": text, "mend": mend, "count": count, "wall": time.time(), "number": self.event_count})

    def take(self, message: dict[str, Any]) -> None:
        """One event, or the answer to ``status`` or ``hello``."""
        event = message.get("event")
        if event == "sample":
            window = self.windows.get(message["drive"]) or self.windows.setdefault(message["drive"], Window())
            window.add(int(message["t_ns"]), message["values"])
        elif event == "estimate":
            drive = self.drives.setdefault(message["drive"], {"name": message["drive"]})
            drive |= {k: message[k] for k in ("t_ns", "state", "parameters", "residual", "skew") if k in message}
            self._remember(drive)
        elif event == "event":
            self.note(message.get("level", "info"), message.get("component", ""), message.get("text", ""), message.get("mend", ""), message.get("count", 1))
        elif event == "lost":
            self.lost += int(message.get("count", 0))
        elif event == "status" or "sources" in message:
            self._status(message)

    def _status(self, message: dict) -> None:
        if "drives" not in message or (message["drives"] and not isinstance(message["drives"][0], dict)):
            self.hello = message
            return
        self.status = message
        known = {}
        for drive in message["drives"]:
            known[drive["name"]] = self.drives.get(drive["name"], {}) | drive
            self._remember(known[drive["name"]])
        self.drives = known

    def _remember(self, drive: dict) -> None:
        for p in drive.get("parameters") or []:
            values = self.history.setdefault((drive["name"], p["name"]), deque(maxlen=HISTORY))
            stamp = drive.get("t_ns")
            if p.get("value") is not None and (not values or values[-1][0] != stamp):
                values.append((stamp, p["value"]))

    def rows(self, drive: dict) -> list[dict]:
        """Parameters of a drive, ready to be printed."""
        out = []
        for p in drive.get("parameters") or []:
            lo, hi = p.get("interval") or (None, None)
            out.append({"name": p["name"], "symbol": units.symbol(p["name"]), "text": units.estimate(p.get("value"), lo, hi, p.get("unit") or ""),
                        "valid": bool(p.get("valid")), "age_s": p.get("age_s"), "trend": [v for _, v in self.history.get((drive["name"], p["name"]), ())]})
        return out


def lamp(drive: dict) -> tuple[str, str]:
    """Residual lamp of a drive: kind (good, warn, bad, soft) and words."""
    residual = drive.get("residual") or {}
    size = units.number(residual.get("rms"), residual.get("unit") or "", 3) if residual.get("rms") is not None else ""
    if residual.get("alarm"):
        where = f" at {residual['regime']}" if residual.get("regime") else ""
        cause = f", likely {residual['likely_effect'].replace('_', ' ')}" if residual.get("likely_effect") else ""
        return "bad", f"model does not fit{where}{cause} ({size})" if size else f"model does not fit{where}{cause}"
    return ("good", f"model fits ({size})") if size else ("soft", "no residual yet")


def skew(drive: dict) -> str:
    """How much older than their stamps the current's readings are, where that is known; "" where it is not."""
    told = drive.get("skew") or {}
    lo, hi = told.get("interval_s") or (None, None)
    words = f"skew {units.estimate(told['value_s'], lo, hi, 's')}" if told.get("value_s") is not None else ""
    if told.get("corrected_s"):
        words = f"{words or 'skew'} ({units.number(told['corrected_s'], 's', 3)} corrected)"
    return words


def sparkline(values: list[float], width: int = 16) -> str:
    """Trend in one line of text."""
    if len(values) < 2:
        return ""
    picked = np.asarray(values[-width:] if len(values) <= width else [values[int(k)] for k in np.linspace(0, len(values) - 1, width)])
    span = float(picked.max() - picked.min())
    level = np.full(len(picked), 3) if span <= 1e-12 * abs(float(picked[-1])) else np.round((picked - picked.min()) / span * 7).astype(int)
    return "".join("▁▂▃▄▅▆▇█"[k] for k in level)


def bus_rows(status: dict) -> list[dict]:
    """Health of each source: what came, what was lost, what the bus says."""
    out = []
    for s in status.get("sources") or []:
        bad = bool(s.get("dropped") or s.get("errors")) or s.get("bus_state") not in (None, "", "ok", "active", "error_active", "error-active")
        down = s.get("state") not in (None, "", "open", "up", "ok", "running", "connected")
        out.append({"name": s.get("name", ""), "kind": s.get("kind", ""), "address": s.get("address", ""), "state": s.get("state") or "", "bus_state": s.get("bus_state") or "",
                    "rate": units.number(s.get("rate_Hz"), "Hz", 3) if s.get("rate_Hz") is not None else "", "frames": s.get("frames", 0), "dropped": s.get("dropped", 0),
                    "rejected": s.get("rejected", 0), "errors": s.get("errors", 0), "clock": s.get("clock") or "", "last_error": s.get("last_error") or "",
                    "lamp": "bad" if down else "warn" if bad else "good"})
    return out

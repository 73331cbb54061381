# SPDX-License-Identifier: Apache-2.0
"""Terminal monitor: what the gateway knows, on 80 x 24 characters, over ssh, through restarts of the daemon."""

from __future__ import annotations

import re
import time

from rich.console import Group, RenderableType
from rich.markup import escape
from rich.table import Table
from rich.text import Text
from textual import work
from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.widgets import Footer, Input, Static

from . import units
from .feed import Feed, NotConnected
from .gateway import STATES, Gateway, bus_rows, lamp, skew, sparkline

COLOUR = {"good": "bright_cyan", "warn": "yellow", "bad": "bold bright_red", "soft": "grey62"}
SIGN = {"good": "●", "warn": "◐", "bad": "✖", "soft": "○"}  # a shape beside each colour
DEFAULT_SOCKET = "/run/driveid/control.sock"


def _lamp(kind: str, words: str) -> str:
    return f"[{COLOUR[kind]}]{SIGN[kind]} {escape(words)}[/]"


def headline(gateway: Gateway, paused: bool, now: float) -> Text:
    since = units.duration(float(int(max(0.0, now - gateway.changed))))
    if gateway.connected:
        version = gateway.hello.get("version", "")
        link = _lamp("good", f"driveidd {version}, {since}")
    else:
        link = _lamp("bad", f"away for {since}, trying every second")
    extra = " [reverse] paused [/]" if paused else ""
    extra += " [bold red]● REC[/]" if gateway.recording else ""
    return Text.from_markup(f"[b]driveid watch[/]  {link}{extra}")


def drive_view(gateway: Gateway, drive: dict, width: int) -> RenderableType:
    """One drive: a line of state, its parameters, a line of rates."""
    words, kind = STATES.get(drive.get("state", ""), (drive.get("state") or "unknown", "soft"))
    if not gateway.connected:
        words, kind = "not seen: the gateway is away", "soft"
    lamp_kind, lamp_words = lamp(drive) if gateway.connected else ("soft", "")
    top = Text.from_markup(f"[b]{escape(drive['name'])}[/]  "
                           f"{_lamp(kind, words)}  {_lamp(lamp_kind, lamp_words) if lamp_words else ''}")
    top.truncate(width, overflow="ellipsis")
    table = Table.grid(padding=(0, 2))
    for _ in range(4):
        table.add_column(no_wrap=True, overflow="ellipsis")
    for row in gateway.rows(drive):
        ok = row["valid"] and gateway.connected
        table.add_row(f"  {row['symbol']}", Text(row["text"], style="" if ok else "grey62"),
                      Text("valid" if ok else "not valid", style=COLOUR["good" if ok else "warn"]), Text(sparkline(row["trend"]), style="cyan"))
    parts: list[RenderableType] = [top, table]
    if drive.get("missing"):
        parts.append(Text(f"  needs: {drive['missing']}", style="yellow", no_wrap=True, overflow="ellipsis"))
    if "samples" in drive:
        jitter = units.number((drive.get("jitter_ns") or 0) * 1e-9, "s", 3)
        parts.append(Text(f"  {units.number(drive.get('rate_Hz'), 'Hz', 4)}  jitter {jitter}  drops {drive.get('dropped', 0)}  gaps {drive.get('gaps', 0)}  "
                          f"restarts {drive.get('restarts', 0)}  {drive.get('structure', '')} {drive.get('method', '')}  {skew(drive)}".rstrip(), style="grey62", no_wrap=True, overflow="ellipsis"))
    return Group(*parts)


def drives_view(gateway: Gateway, pattern: str, width: int) -> RenderableType:
    if not gateway.drives:
        reason = gateway.trouble or "no drive is configured: add a [[drive]] to the daemon's configuration"
        return Text(reason, style="yellow")
    shown = [d for name, d in gateway.drives.items() if pattern.lower() in name.lower()]
    if not shown:
        return Text(f"no drive matches “{pattern}”: press / and Enter to show all {len(gateway.drives)}", style="yellow")
    return Group(*(part for drive in shown for part in (drive_view(gateway, drive, width), Text(""))))


def sources_view(gateway: Gateway) -> RenderableType:
    table = Table(box=None, padding=(0, 1), expand=True, header_style="grey62")
    for name, justify in (("source", "left"), ("state", "left"), ("rate", "right"), ("frames", "right"), ("drops", "right"), ("bad", "right"), ("errors", "right")):
        table.add_column(name, justify=justify, no_wrap=True, overflow="ellipsis")
    for s in bus_rows(gateway.status):
        state = " ".join(v for v in (s["state"], s["bus_state"]) if v)
        table.add_row(f"{s['name']} {s['kind']}", Text.from_markup(_lamp(s["lamp"] if gateway.connected else "soft", state)), s["rate"],
                      *(str(s[k]) for k in ("frames", "dropped", "rejected", "errors")))
    return table


def events_view(gateway: Gateway, rows: int, width: int) -> Text:
    lines = []
    for event in list(gateway.events)[-rows:]:
        clock = time.strftime("%H:%M:%S", time.localtime(event["wall"]))
        style = {"error": "bright_red", "warning": "yellow"}.get(event["level"], "")
        mend = f" → {event['mend']}" if event["mend"] else ""
        line = Text(f"{clock} ", "grey62").append(f"{event['component']}: {event['text']}{mend}", style)
        line.truncate(width, overflow="ellipsis")
        lines.append(line)
    return Text("\n").join(lines)


class Watch(App):
    """The monitor. Keys: / filter, p pause, r record, m mark, q quit."""

    TITLE = "driveid watch"
    ENABLE_COMMAND_PALETTE = False
    CSS = """
    Screen { layout: vertical; }
    #head { height: 1; padding: 0 1; background: $boost; }
    #drives { height: 1fr; padding: 0 1; }
    #sources { height: auto; max-height: 6; padding: 0; border-top: solid $surface-lighten-2; }
    #events { height: auto; max-height: 4; padding: 0 1; border-top: solid $surface-lighten-2; }
    #ask { display: none; height: 3; }
    #ask.open { display: block; }
    """
    BINDINGS = [
        Binding("slash", "ask('filter')", "filter"), Binding("p", "pause", "pause"), Binding("r", "record", "record"),
        Binding("m", "ask('mark')", "mark"), Binding("escape", "close", "close", show=False), Binding("q", "quit", "quit"),
    ]

    def __init__(self, socket: str = DEFAULT_SOCKET) -> None:
        super().__init__()
        self.gateway = Gateway()
        self.feed = Feed(socket, self.gateway)
        self.paused = False
        self.pattern = ""
        self.asking = ""

    def compose(self) -> ComposeResult:
        yield Static(id="head")
        with VerticalScroll(id="drives"):
            yield Static(id="list")
        yield Static(id="sources")
        yield Static(id="events")
        yield Input(id="ask")
        yield Footer(show_command_palette=False)

    def on_mount(self) -> None:
        self.listen()
        self.set_interval(0.25, self.show)
        self.show()

    @work(exclusive=True)
    async def listen(self) -> None:
        await self.feed.run()

    def show(self) -> None:
        """Draw what is known; a paused screen keeps its figures, and its head goes on."""
        if not self.is_running or not self.query("#head"):
            return  # the last tick may come when the screen is gone already
        now = time.monotonic()
        self.query_one("#head", Static).update(headline(self.gateway, self.paused, now))
        if self.paused:
            return
        width = max(self.size.width - 4, 20)
        self.query_one("#list", Static).update(drives_view(self.gateway, self.pattern, width))
        self.query_one("#sources", Static).update(sources_view(self.gateway))
        self.query_one("#sources").display = bool(self.gateway.status.get("sources"))
        self.query_one("#events", Static).update(events_view(self.gateway, 3, width))
        self.query_one("#events").display = bool(self.gateway.events)

    def action_pause(self) -> None:
        self.paused = not self.paused
        self.show()

    @work
    async def action_record(self) -> None:
        name = "" if self.gateway.recording else time.strftime("watch-%Y%m%d-%H%M%S.drec")
        try:
            self.gateway.note("info", "record", await self.feed.record(name))
        except NotConnected as error:
            self.gateway.note("warning", "record", str(error))
        self.show()

    def action_ask(self, what: str) -> None:
        self.asking = what
        box = self.query_one("#ask", Input)
        box.placeholder = {"filter": "show drives whose name holds … (empty: all)", "mark": "text of the mark"}[what]
        box.value = self.pattern if what == "filter" else ""
        box.add_class("open")
        box.focus()

    def action_close(self) -> None:
        box = self.query_one("#ask", Input)
        box.remove_class("open")
        self.set_focus(None)

    def on_input_submitted(self, event: Input.Submitted) -> None:
        if self.asking == "filter":
            self.pattern = event.value.strip()
        elif event.value.strip():
            self.send_mark(re.sub(r"\s+", " ", event.value.strip()))
        self.action_close()
        self.show()

    @work
    async def send_mark(self, text: str) -> None:
        try:
            await self.feed.mark(text)
        except NotConnected as error:
            self.gateway.note("warning", "mark", str(error))
        self.show()


def run(socket: str = DEFAULT_SOCKET) -> None:
    Watch(socket).run()

# SPDX-License-Identifier: Apache-2.0
"""The table that a person watches: parameters as they arrive, the truth next to them."""
import os

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

LIVE = os.environ.get("DRIVEID_LIVE") == "1"
console = Console(force_terminal=LIVE, width=int(os.environ.get("COLUMNS", 110)), highlight=False, soft_wrap=not LIVE)


def number(value):
    return "" if value is None else f"{value:.4g}"


def judged(parameter, truth):
    """(within, sentence): the rule of the main job for one parameter."""
    value, interval = parameter["value"], parameter["interval"]
    if value is None or not parameter["valid"]:
        return False, "no trusted value"
    half_width = (interval[1] - interval[0]) / 2
    off = abs(value - truth)
    widths, share = off / half_width if half_width else float("inf"), off / abs(truth) if truth else 0.0
    return widths <= 3 and share <= 0.05, f"{100 * share:.2f} %, {widths:.1f} half-widths"


def parameter_table(drive, truth, title):
    table = Table(title=title, title_justify="left", title_style="bold", expand=False)
    for name, justify in [("parameter", "left"), ("value", "right"), ("unit", "left"), ("95 % interval", "left"), ("valid", "left"),
                          ("true value", "right"), ("off by", "left")]:
        table.add_column(name, justify=justify, no_wrap=True)
    for parameter in drive["parameters"]:
        lo, hi = parameter["interval"] or (None, None)
        true = truth.get(parameter["name"])
        within, sentence = judged(parameter, true) if true is not None else (True, "")
        table.add_row(parameter["name"], number(parameter["value"]), parameter["unit"], f"{number(lo)} .. {number(hi)}" if lo is not None else "",
                      Text("yes", "green") if parameter["valid"] else Text("not yet", "yellow"), number(true), Text(sentence, "green" if within else "yellow"))
    return table


def headline(drive, t_s, note):
    first = drive.get("time_to_first_trusted_s")
    residual = drive.get("residual") or {}
    words = [f"{t_s:5.1f} s", drive["state"], f"{drive['samples']} samples", f"{drive['rate_Hz']:.0f} Hz",
             f"first trusted estimate after {first:.2f} s" if first is not None else "no trusted estimate yet",
             f"restarts {drive['restarts']}", f"gaps {drive['gaps']}"]
    if residual.get("alarm"):
        words.append("the model no longer explains this drive" + (f": {residual['likely_effect']}?" if residual.get("likely_effect") else ""))
    return Text(" · ".join(words) + (f" · {note}" if note else ""), "cyan")


class Screen:
    """Live table on a terminal; elsewhere a line a second, and the table where an act ends."""

    def __init__(self, title):
        self.title, self.live, self.last_line_s = title, None, -1e9

    def __enter__(self):
        if LIVE:
            self.live = Live(console=console, refresh_per_second=10, transient=False)
            self.live.__enter__()
        return self

    def __exit__(self, *error):
        if self.live:
            self.live.__exit__(*error)

    def show(self, drive, truth, t_s, note="", final=False):
        if self.live:
            self.live.update(Group(parameter_table(drive, truth, self.title), headline(drive, t_s, note)), refresh=final)
        elif final:
            console.print(parameter_table(drive, truth, self.title))
            console.print(headline(drive, t_s, note))
        elif t_s - self.last_line_s >= 1:
            self.last_line_s = t_s
            values = "  ".join(f"{p['name']} {number(p['value'])}{'' if p['valid'] else '?'}" for p in drive["parameters"] if p["value"] is not None)
            console.print(headline(drive, t_s, note), Text(values))

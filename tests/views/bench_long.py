#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How long an hour at 1 kHz with six signals takes to open and to zoom in the workbench, and what the live page costs.

    tests/views/bench_long.py [--minutes 60] [--live SECONDS]     prints a markdown table

The browser and the server share this machine. Opening is from the address to the first drawn picture of all signals, with a cold server
that has not read the file; zooming is from the wheel's request to the drawn picture."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from conftest import TOKEN, Server, build_folder, wait_for
from driveid.views.workbench.projects import Project
from driveid.views.workbench.run import free_port as a_port

LOCAL = "127.0.0.1"
MODEL = 'format = 1\nstructure = "rigid_axis"\n[parameters.K_t_Nm_A]\nvalue = 0.05\nunit = "N m/A"\nstate = "given"\n'


def write_record(path: Path, minutes: float) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = int(minutes * 60_000)
    t = np.arange(rows) * 1e-3
    rng = np.random.default_rng(1)
    omega = 60 * np.sin(2 * np.pi * 0.3 * t) + 20 * np.sin(2 * np.pi * 0.021 * t)
    columns = {"t_s": t, "theta_rad": np.cumsum(omega) * 1e-3, "omega_rad_s": omega + 0.1 * rng.standard_normal(rows), "i_q_A": np.cos(t) + 0.01 * rng.standard_normal(rows),
               "i_d_A": 0.01 * rng.standard_normal(rows), "v_q_V": 12 * np.sin(t) + 0.1 * rng.standard_normal(rows), "T_degC": 25 + t / 300}
    pq.write_table(pa.table(columns), path)


def cpu_seconds(pid: int) -> float:
    """User and system time of a process and its children that live."""
    total, ticks = 0.0, os.sysconf("SC_CLK_TCK")
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            except OSError:
                continue
            if int(entry.name) == pid or int(fields[1]) in _family(pid):
                total += (int(fields[11]) + int(fields[12])) / ticks
    return total


def _family(pid: int) -> set[int]:
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            except OSError:
                continue
    family = {pid}
    while more := {p for p, parent in parents.items() if parent in family} - family:
        family |= more
    return family


def wait_js(page, expression: str, seconds: float) -> None:
    """Wait for an expression (the pages' own policy forbids Playwright's evaluation inside the page)."""
    end = time.perf_counter() + seconds
    while not page.evaluate(expression):
        if time.perf_counter() > end:
            raise TimeoutError(f"{expression}; the page shows: {page.inner_text('main')[:400]}")
        time.sleep(0.005)


def measure_record(page, server: Server) -> list[tuple[str, str]]:
    begin, used = time.perf_counter(), time.process_time()
    page.goto(f"{server.base}/compare?p={server.project.id}&s=signals&token={TOKEN}")
    wait_js(page, "window.driveidTraceMs !== undefined && document.querySelectorAll('.uplot').length >= 6", 60)
    opened, used = time.perf_counter() - begin, time.process_time() - used
    zooms = []
    box = page.locator(".u-over").first.bounding_box()
    page.mouse.move(box["x"] + box["width"] * 0.4, box["y"] + box["height"] / 2)
    for _ in range(24):
        page.evaluate("window.driveidTraceMs = undefined")
        page.mouse.wheel(0, -100)
        wait_js(page, "window.driveidTraceMs !== undefined", 10)
        zooms.append(page.evaluate("window.driveidTraceMs"))
    return [("open, first picture of 6 signals", f"{opened:.2f} s"), ("open, processor time of the server", f"{used:.2f} s"), ("zoom, median of 24 steps", f"{np.median(zooms):.0f} ms"), ("zoom, slowest", f"{max(zooms):.0f} ms")]


class RealGateway:
    """driveidd reads eight signals of a simulated PMSM drive at 1 kHz over Modbus TCP."""

    MORE = "".join(f'\n  [[drive.signal]]\n  name = "{name}"\n  source = "bus"\n  address = {address}\n  encoding = "f32"\n' for name, address in (("omega_rad_s", 12), ("tau_Nm", 14), ("T_degC", 16)))

    def __init__(self, folder: str) -> None:
        build = build_folder()
        config, self.socket = Path(folder) / "d.toml", f"{folder}/g.sock"
        self.drive = subprocess.Popen([build / "tools/sim/driveid-sim", "run", "--bus", f"modbus:{LOCAL}:{a_port(LOCAL)}", "--structure", "pmsm_drive", "--rate", "1000", "--config", config, "--socket", self.socket],
                                      stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(lambda: config.exists() and "theta_rad" in config.read_text(), 10, "the simulator's configuration")
        text = re.sub(r"(poll_s|dt_s) = .*", r"\1 = 0.001", config.read_text()).rstrip()
        config.write_text(text + "\n" + "".join(block for block in re.split(r"(?=\n  \[\[drive)", self.MORE) if block and re.search(r'name = "(.*?)"', block)[1] not in re.findall(r'name = "(.*?)"', text)))
        self.daemon = subprocess.Popen([build / "daemon/driveidd", config], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(lambda: Path(self.socket).exists(), 10, "the control socket")

    def stop(self) -> None:
        for process in (self.daemon, self.drive):
            process.terminate()
            process.wait(5)


def measure_live(page, server: Server, gateway: RealGateway, seconds: float, browser_pid: int) -> list[tuple[str, str]]:
    page.goto(f"{server.base}/live?token={TOKEN}")
    wait_js(page, "window.driveidRedraws > 20 && document.querySelectorAll('.uplot').length === 8", 30)
    parts = {"workbench": lambda: time.process_time(), "browser": lambda: cpu_seconds(browser_pid), "driveidd": lambda: cpu_seconds(gateway.daemon.pid)}
    count = lambda: page.evaluate("window.driveidRedraws")
    drawn, begin, used = count(), time.perf_counter(), {name: ask() for name, ask in parts.items()}
    time.sleep(seconds)
    span = time.perf_counter() - begin
    rates = page.inner_text(".live").split("jitter")[0].split()[-2:]
    return [("live, real daemon over Modbus TCP, samples per second of 8 signals", " ".join(rates).rstrip(",")),
            ("live, redraws per second of each of the 8 plots", f"{(count() - drawn) / span:.1f}"),
            *[(f"live, CPU of {name}", f"{100 * (ask() - used[name]) / span:.0f} % of a core") for name, ask in parts.items()]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--live", type=float, default=10.0)
    options = parser.parse_args()
    from playwright.sync_api import sync_playwright

    with tempfile.TemporaryDirectory(prefix="dv-", dir="/tmp") as folder, sync_playwright() as p:
        record = Path(folder) / "hour.parquet"
        write_record(record, options.minutes)
        gateway = RealGateway(folder)
        server = Server(Project("hour", MODEL, (str(record),)), gateway.socket, Path(folder) / "state")
        browser = p.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        pid = max(int(e.name) for e in Path("/proc").iterdir() if e.name.isdigit() and b"--remote-debugging-pipe" in (e / "cmdline").read_bytes() and b"--type=" not in (e / "cmdline").read_bytes())
        rows = measure_record(page, server) + measure_live(page, server, gateway, options.live, pid)
        browser.close()
        server.stop()
        gateway.stop()
    print(f"Record of {options.minutes:g} min x 1 kHz x 6 signals (Parquet); load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores.\n\n| what | measured |\n|---|---|")
    print("\n".join(f"| {name} | {value} |" for name, value in rows))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Make the pictures of this folder: every page with the bundled example, the live page and the monitor on a simulated drive.

    DRIVEID_BUILD=build .venv/bin/python docs/screens/make.py

Needs Debian's chromium and the built programs driveidd and driveid-sim."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
sys.path.insert(0, str(TOP / "tests/views"))
os.environ.setdefault("DRIVEID_BUILD", str(TOP / "build"))

from conftest import Screen, Server
from driveid.views.workbench.projects import bundled_example
from test_live import Gateway
from test_workbench import READY


def accepted(screen: Screen) -> list[str]:
    """Effects that page 4 finds, in its order."""
    screen.go("missing")
    screen.until(READY["missing"], 300)
    return screen.page.evaluate("[...document.querySelectorAll('.candidate')].filter((c) => c.querySelector('.tag.warn')).map((c) => c.dataset.effect)")


def select_cloud(screen: Screen) -> None:
    box = screen.page.locator("canvas[data-key=speed]").bounding_box()
    screen.page.mouse.move(box["x"] + box["width"] * 0.62, box["y"] + 14)
    screen.page.mouse.down()
    screen.page.mouse.move(box["x"] + box["width"] * 0.9, box["y"] + box["height"] * 0.42, steps=5)
    screen.page.mouse.up()


def pages(browser, server: Server, scheme: str, size: tuple[int, int], suffix: str) -> None:
    screen = Screen(browser, server, *size, scheme)
    chain = ",".join(accepted(screen))
    first = chain.split(",")[0]
    for name, query in (("compare", {"add": first, "models": "0,1", "t": "2,9"}), ("where", {}), ("missing", {}), ("falls", {"add": chain})):
        screen.go(name, **query)
        screen.until(READY[name], 300)
        screen.until("document.querySelectorAll('[role=progressbar]').length === 0", 300)
        if name == "where":
            select_cloud(screen)
        screen.page.wait_for_timeout(600)
        screen.page.screenshot(path=str(HERE / f"{name}{suffix}.png"))
    screen.close()


def live(browser, server: Server, scheme: str, size: tuple[int, int], suffix: str) -> None:
    screen = Screen(browser, server, *size, scheme)
    screen.page.goto(f"{server.base}/live")
    screen.until("document.querySelectorAll('.uplot').length >= 2", 30)
    screen.page.wait_for_timeout(11_000)
    screen.page.screenshot(path=str(HERE / f"live{suffix}.png"))
    screen.close()


def monitor(browser, socket: Path) -> None:
    """The terminal as it is, drawn by the browser. Runs in a process of its own: Playwright's loop and Textual's do not mix."""
    import subprocess

    program = ("import asyncio, sys\nfrom driveid.views.watch import Watch\napp = Watch(sys.argv[1])\n"
               "async def main():\n    async with app.run_test(size=(80, 24)) as pilot:\n        await pilot.pause(8)\n        print(app.export_screenshot())\nasyncio.run(main())")
    svg = subprocess.run([sys.executable, "-c", program, str(socket)], capture_output=True, text=True, check=True).stdout
    page = browser.new_page(viewport={"width": 1000, "height": 640})
    page.set_content(f"<body style='margin:0'>{re.sub(r'@font-face {.*?}', '', svg, flags=re.S)}")
    page.screenshot(path=str(HERE / "watch.png"))


def main() -> None:
    from playwright.sync_api import sync_playwright

    programs = {"driveidd": Path(os.environ["DRIVEID_BUILD"]) / "daemon/driveidd", "driveid-sim": Path(os.environ["DRIVEID_BUILD"]) / "tools/sim/driveid-sim"}
    folder = Path(tempfile.mkdtemp(prefix="dv-", dir="/tmp"))
    gateway = Gateway(programs, folder)
    server = Server(bundled_example(), str(gateway.socket), folder / "state")
    try:
        with sync_playwright() as p:
            browser = p.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            for scheme, size, suffix in (("light", (1280, 720), ""), ("dark", (1024, 768), "-dark")):
                live(browser, server, scheme, size, suffix)
                pages(browser, server, scheme, size, suffix)
            monitor(browser, gateway.socket)
    finally:
        server.stop()
        gateway.stop()
        shutil.rmtree(folder, ignore_errors=True)


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""A workbench on a free port, a browser, and a fake gateway, for the tests of the screens."""

from __future__ import annotations

import asyncio
import os
import shutil
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
os.environ.setdefault("XDG_STATE_HOME", tempfile.mkdtemp(prefix="driveid-state-"))

TOKEN = "token-of-the-tests"
SHOTS = os.environ.get("DRIVEID_SCREENSHOTS")
LOOKS = [(scheme, size) for scheme in ("light", "dark") for size in ((1280, 720), (1024, 768))]  # desktop and tablet


class Server:
    """A workbench in a thread."""

    def __init__(self, project, control_socket: str, state: Path) -> None:
        import uvicorn
        from driveid.views.workbench.projects import Projects
        from driveid.views.workbench.run import build, free_port

        self.port = free_port("127.0.0.1")
        self.project = project
        self.base = f"http://127.0.0.1:{self.port}"
        gate, self.address = build(Projects(state), control_socket, self.port, TOKEN, project=project)
        self.engine = gate.workbench.engine
        self.server = uvicorn.Server(uvicorn.Config(gate, port=self.port, log_level="error", ws="websockets-sansio", timeout_graceful_shutdown=1))
        self.thread = threading.Thread(target=self.server.run, daemon=True)
        self.thread.start()
        wait_for(lambda: self.server.started, 15)

    def stop(self) -> None:
        self.server.should_exit = True
        self.thread.join(10)


class FakeGateway:
    """The fake daemon in a thread; may be stopped and started again."""

    def __init__(self, path: str, **options) -> None:
        self.path, self.options = path, options
        self.start()

    def start(self) -> None:
        from fake_daemon import FakeDaemon

        Path(self.path).unlink(missing_ok=True)
        self.loop = asyncio.new_event_loop()
        self.daemon = FakeDaemon(self.path, **self.options)
        ready = threading.Event()

        def run() -> None:
            asyncio.set_event_loop(self.loop)
            self.loop.run_until_complete(self.daemon.start())
            ready.set()
            self.loop.run_forever()

        self.thread = threading.Thread(target=run, daemon=True)
        self.thread.start()
        assert ready.wait(5)

    def stop(self) -> None:
        asyncio.run_coroutine_threadsafe(self.daemon.stop(), self.loop).result(5)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(5)
        Path(self.path).unlink(missing_ok=True)


def wait_for(condition, seconds: float = 5.0, what: str = "condition") -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"{what} did not come true within {seconds} s"
        time.sleep(0.03)


@pytest.fixture(scope="session")
def short_tmp():
    """Unix sockets need short paths."""
    folder = tempfile.mkdtemp(prefix="dv-", dir="/tmp")
    yield Path(folder)
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def chromium():
    """Debian's Chromium, headless. Tests that need it are skipped by name where it is missing."""
    path = shutil.which("chromium")
    if not path:
        pytest.skip("chromium is not installed (apt-get install chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as p:
        browser = p.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        yield browser
        browser.close()


def run_async(coroutine, seconds: float = 60.0) -> None:
    """Run to its end in a thread of its own: Playwright keeps a loop in the main thread for the whole session."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as pool:
        pool.submit(lambda: asyncio.run(asyncio.wait_for(coroutine, seconds))).result()


def build_folder() -> Path:
    return Path(os.environ.get("DRIVEID_BUILD") or Path(__file__).resolve().parents[2] / "build")


@pytest.fixture(scope="session")
def programs():
    """driveidd and driveid-sim of this build."""
    found = {name: build_folder() / folder / name for name, folder in (("driveidd", "daemon"), ("driveid-sim", "tools/sim"))}
    for name, path in found.items():
        if not path.is_file():
            pytest.skip(f"{name} is not built ({path}): run tools/setup, or set DRIVEID_BUILD")
    return found


class Screen:
    """One browser page that remembers what the console said."""

    def __init__(self, browser, server: Server, width: int = 1280, height: int = 720, scheme: str = "light") -> None:
        self.server = server
        self.context = browser.new_context(viewport={"width": width, "height": height}, color_scheme=scheme, accept_downloads=True)
        self.page = self.context.new_page()
        self.complaints: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda e: self.complaints.append(str(e)))
        self.page.goto(server.address)

    def go(self, name: str, **query) -> None:
        text = "&".join(f"{k}={v}" for k, v in query.items())
        self.page.goto(f"{self.server.base}/{name}?p={self.server.project.id if self.server.project else ''}&{text}")

    def until(self, expression: str, seconds: float = 60.0) -> None:
        """Wait for an expression of the page. The pages' policy forbids eval inside them, so that it is asked from outside."""
        end = time.monotonic() + seconds
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, f"{expression} did not come true; the page shows:\n{self.page.inner_text('main')[:1500]}\n{self.complaints}"
            time.sleep(0.05)

    def close(self) -> None:
        self.context.close()


def shot(screen: Screen, name: str, folder: Path) -> None:
    """Kept where DRIVEID_SCREENSHOTS points, else only made."""
    picture = screen.page.screenshot(path=str(Path(SHOTS or folder) / f"{name}.png"))
    assert len(picture) > 8000, "the picture is empty"

# SPDX-License-Identifier: Apache-2.0
"""The live page and the monitor on a real daemon that reads a simulated drive over Modbus TCP."""

import re
import signal
import socket
import subprocess
import time

import pytest
from conftest import LOOKS, Screen, Server, run_async, shot, wait_for
from driveid.views.workbench.projects import bundled_example


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Gateway:
    """driveidd and the drive that it reads."""

    def __init__(self, programs, folder) -> None:
        self.programs, self.config, self.socket = programs, folder / "d.toml", folder / "c.sock"
        (folder / "rec").mkdir()
        self.drive = subprocess.Popen([programs["driveid-sim"], "run", "--bus", f"modbus:127.0.0.1:{free_port()}", "--seed", "5", "--rate", "250", "--config", str(self.config),
                                       "--socket", str(self.socket), "--record-folder", str(folder / "rec")], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(lambda: self.config.exists() and "[[drive" in self.config.read_text(), 10, "the simulator's configuration")
        text = self.config.read_text()
        group = __import__("grp").getgrgid(__import__("os").getgid()).gr_name
        self.config.write_text(re.sub(r"\[control\]\n", f'[control]\nwrite_group = "{group}"\n', text))
        self.daemon = None
        self.start()

    def start(self) -> None:
        self.daemon = subprocess.Popen([self.programs["driveidd"], str(self.config)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        time.sleep(0.3)
        assert self.daemon.poll() is None, self.daemon.stderr.read()

    def kill(self) -> None:
        self.daemon.send_signal(signal.SIGKILL)
        self.daemon.wait(5)

    def stop(self) -> None:
        for process in (self.daemon, self.drive):
            process.terminate()
            process.wait(5)


@pytest.fixture(scope="module")
def gateway(programs, short_tmp):
    folder = short_tmp / "live"
    folder.mkdir()
    gateway = Gateway(programs, folder)
    yield gateway
    gateway.stop()


@pytest.fixture(scope="module")
def server(gateway, tmp_path_factory):
    server = Server(bundled_example(), str(gateway.socket), tmp_path_factory.mktemp("state"))
    yield server
    server.stop()


# A dashed line of the selection's colour from top to bottom of the first plot: dashes over a quarter of some column of its canvas.
MARK_IS_DRAWN = """(() => {
  const plot = document.querySelector('.uplot canvas'), { width, height } = plot;
  const own = Object.assign(document.createElement('canvas'), { width, height }), c = own.getContext('2d', { willReadFrequently: true });
  c.fillStyle = getComputedStyle(document.body).getPropertyValue('--select');
  c.fillRect(0, 0, 1, 1);
  const [r, g, b] = c.getImageData(0, 0, 1, 1).data;
  c.clearRect(0, 0, 1, 1);
  c.drawImage(plot, 0, 0);
  const pixels = c.getImageData(0, 0, width, height).data;
  let most = 0;
  for (let x = 0; x < width; x++) {
    let hits = 0;
    for (let y = 0; y < height; y++) {
      const k = 4 * (y * width + x);
      if (pixels[k + 3] > 60 && Math.abs(pixels[k] - r) + Math.abs(pixels[k + 1] - g) + Math.abs(pixels[k + 2] - b) < 60) hits++;
    }
    most = Math.max(most, hits);
  }
  return most > height / 4;
})()"""


def test_live_page_streams_records_marks_and_survives_a_dead_daemon(chromium, server, gateway):
    screen = Screen(chromium, server)
    screen.page.goto(f"{server.base}/live")
    screen.until("document.body.dataset.gateway === 'up' && document.querySelectorAll('.uplot').length >= 2", 30)
    screen.until("document.querySelector('.live .lamp.good')?.textContent === 'valid'", 30)
    drawn = screen.page.evaluate("window.driveidRedraws || 0")
    screen.page.wait_for_timeout(3000)
    assert screen.page.evaluate("window.driveidRedraws") > drawn + 20, "the plots do not move"
    assert "J" in screen.page.inner_text(".live table") and "±" in screen.page.inner_text(".live table")
    screen.page.get_by_text("Record", exact=False).first.click()
    screen.until("document.body.textContent.includes('Stop recording')", 10)
    screen.page.on("dialog", lambda d: d.accept("half way"))
    screen.page.get_by_role("button", name="Mark").click()
    screen.until("document.querySelector('.events').textContent.includes('half way')", 10)
    screen.until(MARK_IS_DRAWN, 10)
    screen.page.get_by_text("Stop recording").click()
    screen.until("document.querySelector('.events').textContent.includes('entries in')", 10)
    assert list((gateway.config.parent / "rec").glob("workbench-*.drec"))
    gateway.kill()
    screen.until("document.body.dataset.gateway === 'away' && document.body.textContent.includes('does not answer')", 15)
    gateway.start()
    screen.until("document.body.dataset.gateway === 'up'", 15)
    screen.until("document.querySelector('.events').textContent.includes('the gateway is back')", 10)
    assert screen.complaints == []
    screen.close()


@pytest.mark.parametrize(("scheme", "size"), LOOKS)
def test_live_page_at_two_sizes_light_and_dark(chromium, server, tmp_path, scheme, size):
    screen = Screen(chromium, server, *size, scheme)
    screen.page.goto(f"{server.base}/live")
    screen.until("document.body.dataset.gateway === 'up' && document.querySelectorAll('.uplot').length >= 2", 30)
    screen.until("document.querySelector('.live table')?.textContent.includes('±')", 30)
    shot(screen, f"live-{scheme}-{size[0]}", tmp_path)
    assert screen.page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    assert screen.complaints == []
    screen.close()


def test_live_page_without_a_gateway_says_how_to_get_one(chromium, tmp_path):
    server = Server(bundled_example(), "/tmp/driveid-nobody.sock", tmp_path)
    screen = Screen(chromium, server)
    screen.page.goto(f"{server.base}/live")
    screen.until("document.querySelector('.hint')?.textContent.includes('driveid config new')", 10)
    screen.page.get_by_role("button", name="Look at records instead").click()
    screen.until("location.pathname === '/compare' && document.querySelectorAll('.uplot').length >= 2", 60)
    assert screen.complaints == []
    screen.close()
    server.stop()


def test_monitor_on_the_real_daemon(gateway):
    from driveid.views.watch import Watch
    from test_watch import screen as text

    app = Watch(str(gateway.socket))

    async def main():
        async with app.run_test(size=(80, 24)) as pilot:
            for _ in range(150):
                await pilot.pause(0.1)
                if "± " in text(app):
                    break
            shown = text(app)
            assert "axis1" in shown and "±" in shown and "bus modbus_tcp" in shown, shown
            assert max(len(line) for line in shown.split("\n")) <= 80

    run_async(main())


def test_page_left_and_entered_again_is_connected_once(chromium, short_tmp, tmp_path, monkeypatch):
    from conftest import FakeGateway
    from driveid.views.workbench import live

    monkeypatch.setattr(live, "LINGER_S", 0.1)
    daemon = FakeGateway(str(short_tmp / "again.sock"))
    server = Server(bundled_example(), daemon.path, tmp_path)
    screen = Screen(chromium, server)
    for _ in range(4):
        screen.page.goto(f"{server.base}/live")
        screen.until("document.body.dataset.gateway === 'up' && document.querySelectorAll('.uplot').length === 8", 20)
        screen.page.wait_for_timeout(400)
        assert screen.page.evaluate("document.body.dataset.gateway") == "up"
        screen.page.goto("about:blank")
        wait_for(lambda: len([w for w in daemon.daemon._writers if not w.is_closing()]) == 0, 5, "the feed's end")
    screen.close()
    server.stop()
    daemon.stop()

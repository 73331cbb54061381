# SPDX-License-Identifier: Apache-2.0
"""The terminal monitor on 80 x 24 characters, compared with committed screens.

To accept a changed screen: DRIVEID_ACCEPT=1 pytest tests/views/test_watch.py, then look at the diff."""

import asyncio
import os
import re
from pathlib import Path

import pytest
from conftest import FakeGateway, run_async
from driveid.views.gateway import Gateway
from driveid.views.watch import Watch

SCREENS = Path(__file__).parent / "screens"


def screen(app) -> str:
    """The characters of the screen, line by line."""
    strips = app.screen._compositor.render_strips()
    return "\n".join("".join(segment.text for segment in strip).rstrip() for strip in strips)


def same_every_time(text: str) -> str:
    """Times and counters do not belong to the picture."""
    text = re.sub(r"\d\d:\d\d:\d\d", "HH:MM:SS", text)
    return re.sub(r"\d+ s\b", "N s", text)


def check(name: str, shown: str) -> None:
    path = SCREENS / f"{name}.txt"
    shown = same_every_time(shown) + "\n"
    assert [line for line in shown.split("\n") if len(line) > 80] == [] and shown.count("\n") <= 24
    if os.environ.get("DRIVEID_ACCEPT"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(shown, "utf-8")
    assert shown == path.read_text("utf-8")


STATUS = {"t_ns": 5, "drives": [
    {"name": "axis1", "structure": "rigid_axis", "method": "fsm", "state": "valid", "t_ns": 5, "samples": 5000, "rate_Hz": 1000.0, "jitter_ns": 12400, "gaps": 0, "dropped": 2, "restarts": 1,
     "residual": {"rms": 3.1e-4, "unit": "N m", "alarm": False}, "missing": "",
     "parameters": [{"name": "J_kgm2", "value": 1.2e-4, "interval": [1.19e-4, 1.21e-4], "unit": "kg m^2", "valid": True, "age_s": 0.0},
                    {"name": "B_Nms_rad", "value": None, "interval": None, "unit": "N m s/rad", "valid": False, "age_s": None}]},
    {"name": "axis2", "structure": "pmsm_drive", "method": "fsm", "state": "frozen", "t_ns": 5, "samples": 10, "rate_Hz": 250.0, "jitter_ns": 0, "gaps": 3, "dropped": 0, "restarts": 0,
     "residual": {"rms": 0.02, "unit": "N m", "alarm": True, "regime": "low speed", "likely_effect": "coulomb"}, "missing": "psi_pm_Vs needs v_q_V while it turns", "parameters": []}],
    "sources": [{"name": "can0", "kind": "socketcan", "state": "open", "bus_state": "passive", "rate_Hz": 2000.0, "frames": 10000, "dropped": 7, "rejected": 1, "errors": 3}], "sinks": []}


def still() -> Watch:
    """A monitor with a state of the test's own, without a daemon."""
    app = Watch("/tmp/driveid-nobody.sock")
    app.feed.run = lambda: asyncio.sleep(60)
    app.gateway.take({"version": "0.1.0", "write": True, "drives": ["axis1", "axis2"], "sources": ["can0"]})
    app.gateway.take(STATUS)
    for k in range(1, 40):
        app.gateway.take({"event": "estimate", "drive": "axis1", "t_ns": k, "parameters": [dict(STATUS["drives"][0]["parameters"][0], value=1.2e-4 + 1e-7 * k)]})
    app.gateway.take({"event": "status", **STATUS})
    app.gateway.set_connected(True)
    return app


def run(app: Watch, steps) -> None:
    async def main():
        async with app.run_test(size=(80, 24)) as pilot:
            await pilot.pause(0.1)
            await steps(pilot)

    run_async(main(), 40)


def test_screen_of_a_running_gateway():
    app = still()

    async def steps(pilot):
        app.show()
        await pilot.pause()
        check("running", screen(app))

    run(app, steps)


def test_screen_when_the_gateway_is_away():
    app = still()

    async def steps(pilot):
        app.gateway.set_connected(False, "nobody listens")
        app.show()
        await pilot.pause()
        check("away", screen(app))

    run(app, steps)


def test_screen_without_a_gateway_says_what_to_do():
    app = Watch("/tmp/driveid-nobody.sock")

    async def steps(pilot):
        await pilot.pause(0.5)
        check("nobody", screen(app))

    run(app, steps)


def test_filter_shows_only_what_matches():
    app = still()

    async def steps(pilot):
        await pilot.press("slash", *"axis2", "enter")
        await pilot.pause(0.3)
        assert "axis1" not in screen(app) and "axis2" in screen(app)
        await pilot.press("slash", *"zzz", "enter")
        await pilot.pause(0.3)
        assert "no drive matches" in screen(app)

    run(app, steps)


def test_pause_keeps_the_figures():
    app = still()

    async def steps(pilot):
        await pilot.press("p")
        app.gateway.drives["axis1"]["state"] = "error"
        await pilot.pause(0.6)
        assert "paused" in screen(app) and "error" not in screen(app).split("source")[0]
        await pilot.press("p")
        await pilot.pause(0.6)
        assert "error" in screen(app)

    run(app, steps)


def test_record_and_mark_reach_the_daemon_and_a_restart_is_survived(short_tmp):
    path = str(short_tmp / "watch.sock")
    daemon = FakeGateway(path)
    app = Watch(path)

    async def until(pilot, words, seconds=8.0):
        for _ in range(int(seconds / 0.1)):
            if words in screen(app):
                return
            await pilot.pause(0.1)
        raise AssertionError(f"{words!r} did not appear:\n{screen(app)}")

    async def steps(pilot):
        await until(pilot, "valid")
        await pilot.press("r")
        await until(pilot, "REC")
        await pilot.press("m", *"start of test", "enter")
        await until(pilot, "mark: start of test")
        assert daemon.daemon.marks == ["start of test"]
        await asyncio.to_thread(daemon.stop)
        await until(pilot, "away for")
        assert "REC" not in screen(app)
        await asyncio.to_thread(daemon.start)
        await until(pilot, "driveidd 0.1.0")
        assert "the gateway is back" in screen(app)

    run(app, steps)
    daemon.stop()


@pytest.mark.parametrize("size", [(40, 10), (200, 60)])
def test_any_size_of_terminal(size):
    app = still()

    async def main():
        async with app.run_test(size=size) as pilot:
            await pilot.pause(0.4)
            assert "driveid watch" in screen(app)

    run_async(main())


def test_gateway_without_anything_is_shown():
    app = Watch("/x")
    app.gateway = Gateway(connected=True)
    app.feed.run = lambda: asyncio.sleep(60)

    async def steps(pilot):
        app.show()
        await pilot.pause()
        assert "no drive is configured" in screen(app)

    run(app, steps)


def test_skew_stands_where_it_is_known():
    from driveid.views.gateway import skew
    assert skew({}) == skew({"skew": {"value_s": None, "interval_s": None, "corrected_s": 0}}) == ""
    assert skew({"skew": {"value_s": 3.1e-4, "interval_s": [2.9e-4, 3.3e-4], "corrected_s": 0}}).startswith("skew 310")
    corrected = skew({"skew": {"value_s": 3.1e-4, "interval_s": [2.9e-4, 3.3e-4], "corrected_s": 3e-4}})
    assert "310" in corrected and "300 µs corrected" in corrected
    assert "corrected" in skew({"skew": {"value_s": None, "interval_s": None, "corrected_s": 3e-4}})

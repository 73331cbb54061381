# SPDX-License-Identifier: Apache-2.0
"""Gateway state and the connection that heals itself."""

import asyncio
import json

import numpy as np
import pytest
from conftest import FakeGateway, run_async
from driveid.views.feed import Feed, NotConnected
from driveid.views.gateway import Gateway, Window, lamp, sparkline


def test_window_keeps_least_and_greatest_of_each_bucket():
    window = Window(seconds=1.0, buckets=100)
    values = np.sin(np.arange(3000) * 0.1)
    for k, v in enumerate(values):
        window.add(10**15 + k * 1_000_000, {"u": float(v)})
    first, shown = window.since(-1)
    assert shown.shape == (1, 100, 2)
    inside = values[2000:]
    assert np.nanmax(shown) == pytest.approx(inside.max(), abs=1e-6) and np.nanmin(shown) == pytest.approx(inside.min(), abs=1e-6)
    again, rest = window.since(window.head)
    assert again == window.head and rest.shape == (1, 1, 2)


def test_window_survives_a_gap_a_new_signal_and_a_clock_set_back():
    window = Window(seconds=1.0, buckets=10)
    window.add(0, {"a": 1.0})
    window.flush()
    window.add(50_000_000_000, {"a": 2.0, "b": 3.0})
    _, shown = window.since(-1)
    assert np.count_nonzero(~np.isnan(shown[0, :, 0])) == 1 and window.names == ["a", "b"]
    window.add(1_000_000, {"a": 4.0})
    window.flush()
    assert window.head == 0


def test_lamp_says_where_and_why():
    kind, words = lamp({"residual": {"rms": 0.004, "unit": "N m", "alarm": True, "regime": "low speed", "likely_effect": "coulomb"}})
    assert kind == "bad" and "low speed" in words and "coulomb" in words and "4 mN·m" in words
    assert lamp({})[0] == "soft"


@pytest.mark.parametrize(("values", "text"), [([], ""), ([1.0], ""), ([1, 1, 1], "▄▄▄"), ([0, 7], "▁█"), (list(range(100)), "▁▁▂▂▃▃▄▄▅▅▆▆▇▇██")])
def test_sparkline(values, text):
    shown = sparkline(values)
    assert shown == text or (len(values) == 100 and shown[0] == "▁" and shown[-1] == "█" and len(shown) == 16)


def test_feed_comes_back_after_the_daemon_died(short_tmp):
    path = str(short_tmp / "feed.sock")
    daemon = FakeGateway(path)
    gateway = Gateway()
    feed = Feed(path, gateway)

    async def until(condition, seconds=8.0):
        for _ in range(int(seconds / 0.05)):
            if condition():
                return True
            await asyncio.sleep(0.05)
        return False

    async def main():
        task = asyncio.create_task(feed.run())
        assert await until(lambda: gateway.connected and "axis1" in gateway.drives)
        assert (await feed.record("a.drec")).endswith("a.drec") and gateway.recording
        await asyncio.to_thread(daemon.stop)
        assert await until(lambda: not gateway.connected)
        assert "no gateway at" in gateway.trouble or "closed" in gateway.trouble
        with pytest.raises(NotConnected):
            await feed.mark("lost")
        await asyncio.to_thread(daemon.start)
        assert await until(lambda: gateway.connected)
        assert any("back" in e["text"] for e in gateway.events)
        task.cancel()

    run_async(main())
    daemon.stop()


def test_refusal_carries_the_mend(short_tmp):
    path = str(short_tmp / "ro.sock")
    daemon = FakeGateway(path, write=False)
    gateway = Gateway()
    feed = Feed(path, gateway)

    async def main():
        task = asyncio.create_task(feed.run())
        while not gateway.connected:
            await asyncio.sleep(0.05)
        with pytest.raises(NotConnected, match="write_group"):
            await feed.record("a.drec")
        task.cancel()

    run_async(main(), 10)
    daemon.stop()


@pytest.mark.parametrize("answer", [b"\x00\xff garbage\n", b"[]\n", b'{"driveid": 1, "id": 1, "ok": false}\n', b"x" * 400_000])
def test_a_peer_that_is_no_gateway_is_shown_as_such(short_tmp, answer):
    path = str(short_tmp / "bad.sock")

    async def main():
        async def client(reader, writer):
            writer.write(answer)
            await asyncio.sleep(0.4)

        server = await asyncio.start_unix_server(client, path)
        gateway = Gateway()
        feed = Feed(path, gateway)
        task = asyncio.create_task(feed.run())
        for _ in range(140):
            await asyncio.sleep(0.05)
            if gateway.trouble:
                break
        assert gateway.trouble and not gateway.connected and not task.done()
        task.cancel()
        server.close()

    run_async(main())


def test_lost_events_are_counted():
    gateway = Gateway()
    gateway.take(json.loads('{"event": "lost", "count": 12}'))
    assert gateway.lost == 12

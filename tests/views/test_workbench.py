# SPDX-License-Identifier: Apache-2.0
"""The five pages in Debian's Chromium, with the bundled example and the library's own answers."""

import subprocess

import pytest
from conftest import LOOKS, Screen, Server, shot
from driveid.views.workbench.projects import bundled_example

READY = {
    "compare": "document.querySelectorAll('.uplot').length >= 2 && document.querySelectorAll('table').length >= 1",
    "where": "document.querySelectorAll('.clouds canvas').length >= 5 && document.querySelectorAll('.bars .track, .where .card > div > p.soft').length >= 1",
    "missing": "document.querySelectorAll('.candidate svg.plot').length >= 1",
    "falls": "document.querySelectorAll('[data-steps] svg.plot').length === 1 && document.querySelectorAll('table').length >= 1",
}


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    server = Server(bundled_example(), "/tmp/driveid-nobody.sock", tmp_path_factory.mktemp("state"))
    yield server
    server.stop()


@pytest.fixture
def screen(chromium, server):
    screen = Screen(chromium, server)
    yield screen
    complaints = screen.complaints
    screen.close()
    assert complaints == []


@pytest.mark.parametrize("page", list(READY))
@pytest.mark.parametrize(("scheme", "size"), LOOKS)
def test_page_shows_real_data_at_two_sizes_light_and_dark(chromium, server, tmp_path, page, scheme, size):
    screen = Screen(chromium, server, *size, scheme)
    screen.go(page, add="" if page == "missing" else "coulomb")
    screen.until(READY[page], 120)
    screen.page.wait_for_timeout(300)
    shot(screen, f"{page}-{scheme}-{size[0]}", tmp_path)
    wide = screen.page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0, "the page is wider than the screen"
    assert screen.complaints == []
    screen.close()


def test_first_start_opens_the_bundled_example(chromium, tmp_path):
    server = Server(None, "/tmp/driveid-nobody.sock", tmp_path)
    screen = Screen(chromium, server)
    screen.until("document.querySelector('#strip .name')?.textContent.includes('Example')")
    assert "/compare?p=" in screen.page.url and "token" not in screen.page.url
    screen.close()
    server.stop()


def test_linked_selection_selects_in_every_view_and_is_in_the_address(screen):
    screen.go("where")
    screen.until(READY["where"], 120)
    canvas = screen.page.locator("canvas[data-key=speed]")
    box = canvas.bounding_box()
    screen.page.mouse.move(box["x"] + box["width"] * 0.55, box["y"] + 12)
    screen.page.mouse.down()
    screen.page.mouse.move(box["x"] + box["width"] * 0.8, box["y"] + box["height"] * 0.8, steps=6)
    screen.page.mouse.up()
    count = int(screen.page.get_attribute("[data-selected]", "data-selected"))
    assert count > 20 and "sel=speed" in screen.page.url
    lit = "(c) => { const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0; for (let k = 0; k < d.length; k += 4) if (d[k] > 190 && d[k+1] > 60 && d[k+1] < 130 && d[k+2] < 60) n++; return n; }"
    for key in ("speed", "acceleration", "turn", "current"):
        assert screen.page.locator(f"canvas[data-key={key}]").evaluate(lit) > 20, key
    assert screen.page.locator(".uplot canvas").first.evaluate(lit) > 20
    screen.page.reload()
    screen.until("document.querySelector('[data-selected]')?.dataset.selected > 0", 60)
    assert int(screen.page.get_attribute("[data-selected]", "data-selected")) == pytest.approx(count, abs=3)
    screen.page.keyboard.press("Escape")
    assert "sel=" not in screen.page.url


def test_selection_by_keys_alone(screen):
    screen.go("where")
    screen.until(READY["where"], 120)
    counts = []
    screen.page.locator("canvas[data-key=speed]").focus()
    for keys in (["Enter"], ["ArrowRight", "ArrowUp"], ["Shift+ArrowRight"] * 6 + ["Shift+ArrowUp"] * 6):
        for key in keys:
            screen.page.keyboard.press(key)
        counts.append(int(screen.page.get_attribute("[data-selected]", "data-selected")))
    assert len(set(counts)) == 3 and counts[2] > counts[1] > 0 and "sel=speed" in screen.page.url, counts
    screen.page.keyboard.press("Escape")
    assert "sel=" not in screen.page.url


def test_button_adds_the_effect_the_staircase_grows_and_undo_takes_it_out(screen):
    screen.go("missing")
    screen.until("document.querySelectorAll('.candidate button.primary').length >= 1", 120)
    first = screen.page.get_attribute(".candidate", "data-effect")
    screen.page.click(".candidate button.primary")
    screen.until(f"location.pathname === '/falls' && document.querySelector('[data-steps]')?.dataset.steps === '2' && location.search.includes('add={first}')", 120)
    held = screen.page.evaluate("[...document.querySelectorAll('rect.held title')].map((t) => t.textContent)")
    assert len(held) == 2
    assert screen.page.locator(f"[data-added={first}]").count() == 1
    screen.page.reload()
    screen.until("document.querySelector('[data-steps]')?.dataset.steps === '2'", 60)
    screen.page.keyboard.press("u")
    screen.until("document.querySelector('[data-steps]')?.dataset.steps === '1' && !location.search.includes('add=')", 60)
    screen.page.go_back()
    screen.until("document.querySelector('[data-steps]')?.dataset.steps === '2'", 60)


def test_all_that_is_missing_with_every_order_of_cogging(screen):
    screen.go("falls")
    screen.until(READY["falls"], 120)
    screen.page.get_by_role("button", name="Add all").click()
    screen.until("document.querySelector('[data-steps]')?.dataset.steps === '4'", 200)
    assert screen.page.evaluate("new URLSearchParams(location.search).get('add')") == "coulomb,cogging,cogging"
    assert "cogging (2)" in screen.page.inner_text("#strip")
    held = screen.page.evaluate("[...document.querySelectorAll('rect.held')].map((r) => r.getBBox().height)")
    assert len(held) == 4 and max(held[1:]) < held[0]


def test_an_effect_of_ones_own_is_added_as_a_formula(screen):
    screen.go("missing")
    screen.until("document.querySelectorAll('.own').length === 1 && document.querySelectorAll('.candidate').length >= 1", 120)
    screen.page.get_by_text("An effect of your own").click()
    screen.page.fill("#own-name", "my_drag")
    screen.page.fill("#own-formula", "c * max(omega_rad_s, 0) + (")
    screen.page.get_by_role("button", name="Add and fit").click()
    screen.until("document.querySelector('.own .error').textContent.includes('formula, column')", 20)
    screen.complaints.clear()  # the browser reports the refused question itself
    screen.page.fill("#own-formula", "c * max(sign(omega_rad_s), 0) + d * min(sign(omega_rad_s), 0)")
    screen.page.get_by_role("button", name="Add and fit").click()
    screen.until("document.querySelector('[data-steps]')?.dataset.steps === '2' && document.querySelectorAll('table').length >= 1", 120)
    assert "+ my drag" in screen.page.inner_text("#strip")
    held = screen.page.evaluate("[...document.querySelectorAll('rect.held')].map((r) => r.getBBox().height)")
    assert held[1] < held[0], "a friction of two directions must lower the error of this drive"
    assert "my drag" in screen.page.inner_text("main table")
    screen.page.reload()
    screen.until("document.querySelector('[data-steps]')?.dataset.steps === '2'", 60)


def test_zoom_asks_for_detail_and_stays_in_the_address(screen):
    screen.go("compare")
    screen.until(READY["compare"], 120)
    over = screen.page.locator(".u-over").first.bounding_box()
    screen.page.mouse.move(over["x"] + over["width"] * 0.3, over["y"] + 40)
    screen.page.mouse.down()
    screen.page.mouse.move(over["x"] + over["width"] * 0.5, over["y"] + 40, steps=5)
    screen.page.mouse.up()
    screen.until("location.search.includes('t=')", 10)
    begin, end = (float(v) for v in screen.page.evaluate("new URLSearchParams(location.search).get('t')").split(","))
    assert 0.25 < begin / 16 < 0.35 and 0.45 < end / 16 < 0.55
    screen.page.reload()
    screen.until("document.querySelector('.cap span:last-child')?.textContent.includes('…')", 60)
    screen.page.locator(".u-over").first.hover()
    screen.page.keyboard.press("0")
    screen.until("!location.search.includes('t=')", 10)


def test_two_fingers_zoom_and_one_moves(screen):
    """Real touches, sent through the browser's own protocol: the gestures that the page's listeners see on a tablet."""
    screen.go("compare", t="4,12")
    screen.until(READY["compare"], 120)
    over = screen.page.locator(".u-over").first.bounding_box()
    touch = screen.context.new_cdp_session(screen.page)

    def send(kind: str, *parts: float) -> None:
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": over["x"] + over["width"] * part, "y": over["y"] + 60, "id": k} for k, part in enumerate(parts)]})

    def shown() -> tuple[float, float]:
        begin, end = screen.page.evaluate("new URLSearchParams(location.search).get('t')").split(",")
        return float(begin), float(end)

    send("touchStart", 0.4, 0.6)
    for k in range(1, 6):
        send("touchMove", 0.4 - 0.04 * k, 0.6 + 0.04 * k)
    send("touchEnd")
    # Fingers three times as far apart: a third of 8 s, about the same middle. The address follows the last move a moment later.
    screen.until("(([a, b]) => b - a < 2.75)(new URLSearchParams(location.search).get('t').split(',').map(Number))", 10)
    begin, end = shown()
    assert 2.5 < end - begin and abs((begin + end) / 2 - 8) < 0.6, (begin, end)
    send("touchStart", 0.7)
    for k in range(1, 6):
        send("touchMove", 0.7 - 0.08 * k)
    send("touchEnd")
    screen.until(f"Number(new URLSearchParams(location.search).get('t').split(',')[0]) > {begin} + 0.5", 10)
    moved = shown()
    assert abs((moved[1] - moved[0]) - (end - begin)) < 0.02 * (end - begin) and abs(moved[0] - begin - 0.4 * (end - begin)) < 0.15 * (end - begin), (begin, end, moved)


def test_side_by_side_and_several_models(screen):
    screen.go("compare", add="coulomb", r="0%2B1", models="0,1")
    screen.until("document.querySelectorAll('.uplot').length === 4", 120)
    assert screen.page.locator(".halves .legend .model1").count() == 2


def test_keys_lead_through_the_pages(screen):
    screen.go("compare")
    for key, page in (("5", "falls"), ("4", "missing"), ("3", "where"), ("2", "compare")):
        screen.page.keyboard.press(key)
        screen.until(f"location.pathname === '/{page}'", 5)
    screen.page.keyboard.press("?")
    assert screen.page.locator("dialog[open]").count() == 1


def test_exports(screen, tmp_path, programs):
    screen.go("falls", add="coulomb")
    screen.until(READY["falls"], 120)
    for name, words in (("model.toml", 'name = "coulomb"'), ("driveidd.toml", "[[drive]]"), ("report.html", "The error falls")):
        with screen.page.expect_download(timeout=120_000) as download:
            screen.page.click(f"[data-export='{name}']")
        path = tmp_path / name
        download.value.save_as(path)
        assert words in path.read_text("utf-8")
    checked = subprocess.run([programs["driveidd"], "--check", "driveidd.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert checked.returncode == 0, checked.stderr


def test_unknown_project_says_what_to_do(screen):
    screen.page.goto(f"{screen.server.base}/compare?p=gone")
    screen.until("document.querySelector('.trouble')?.textContent.includes('open its model and records')", 10)
    screen.complaints.clear()  # the browser reports the refused question itself


def test_open_dialog_reads_a_record_of_the_user(screen, tmp_path):
    import example

    data = example.drive(rows=4000)
    record = tmp_path / "mine.csv"
    record.write_text(",".join(data) + "\n" + "\n".join(",".join(f"{v:.8g}" for v in row) for row in zip(*data.values(), strict=True)))
    screen.go("compare")
    screen.page.click("#open-button")
    screen.page.fill("#f-training", "/no/such.csv")
    screen.page.click("dialog button.primary")
    screen.until("document.querySelector('dialog .error').textContent.includes('/no/such.csv')", 10)
    screen.complaints.clear()  # the browser reports the refused question itself
    screen.page.fill("#f-training", str(record))
    screen.page.fill("#f-given", "K_t_Nm_A=0.05")
    screen.page.click("dialog button.primary")
    screen.until("document.querySelector('#strip .name')?.textContent === 'mine'", 30)
    screen.until(READY["compare"], 120)

# SPDX-License-Identifier: Apache-2.0
"""The report: whole, small, without outside links, safe against what a file may contain."""

import re
from html.parser import HTMLParser

import example
import pytest
from driveid.views import notebook, report
from driveid.views.series import Series

COMMAND = "driveid explain model.toml train.csv --held-out held_out.csv --html r.html"


def _series():
    data = example.drive()
    header, values = example.series(data, False)
    return Series.of(data["t_s"], header, values, "train.csv")


class Links(HTMLParser):
    """Collects everything that a browser would fetch, and checks that elements close."""

    VOID = {"meta", "br", "link", "img", "input", "hr"}

    def __init__(self):
        super().__init__()
        self.found, self.open = [], []

    def handle_starttag(self, tag, attrs):
        self.found += [v for k, v in attrs if k in ("href", "src", "action", "data", "srcset", "xlink:href") and v]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag in self.open:
            while self.open.pop() != tag:
                pass


@pytest.mark.parametrize("verdict", ["missing", "nothing_missing", "cannot_tell", "unknown", "bad_data"])
def test_report_is_one_small_file_without_links(tmp_path, verdict):
    path = report.write_html(example.explain(verdict), tmp_path / "r.html", [_series()], COMMAND)
    text = path.read_text("utf-8")
    links = Links()
    links.feed(text)
    assert links.found == [] and links.open == []
    assert "url(" not in text and "@import" not in text and not re.search(r"https?://", text)
    assert path.stat().st_size < 2_000_000


def test_report_holds_what_a_reader_needs(tmp_path):
    text = report.html(example.explain("cannot_tell"), [_series()], COMMAND)
    for words in ("Which physical effect", "train.csv", "Parameters", "Comparison", "Where it fails", "What was found", "What cannot be told", "The record that would tell", COMMAND, "0.1.0", "noise floor", "9f9f"):
        assert words in text, words


def test_staircase_report(tmp_path):
    text = report.html(example.improve(), [], "driveid improve")
    assert "The error falls" in text and "noise floor" in text and "[[" not in text.split("<main")[0]


def test_long_record_stays_small(tmp_path):
    data = example.drive(rows=2000)
    tiled = {k: (v if k == "t_s" else v) for k, v in data.items()}
    header, values = example.series(tiled, False)
    import numpy as np
    times = 300
    series = Series.of(np.arange(2000 * times) * 1e-3, header | {"rows": 2000 * times}, np.tile(values, times), "long.csv")
    assert report.write_html(example.compare(), tmp_path / "r.html", [series] * 3, COMMAND).stat().st_size < 2_000_000


def test_hostile_names_are_text():
    document = example.explain()
    document["records"][0]["name"] = "<img src=x onerror=alert(1)>"
    document["ranked"][0]["effect"] = "</script><script>alert(2)</script>"
    document["notices"] = ["<b onmouseover=alert(3)>"]
    text = report.html(document, [], "<script>")
    assert "<img" not in text and "<script>alert" not in text and "<b onmouseover" not in text and text.count("<script") == 1


def test_notebook_fragment_and_text():
    bundle = notebook.bundle(example.explain(), [_series()])
    assert bundle["text/html"].startswith('<div class="driveid notebook">') and "<svg" in bundle["text/html"]
    assert "An effect is missing" in bundle["text/plain"]
    assert "tau_c_Nm" in notebook.bundle(example.improve())["text/html"]


def test_print_style_gives_a_pdf(tmp_path, chromium):
    path = report.write_html(example.explain(), tmp_path / "r.html", [_series()], COMMAND)
    page = chromium.new_page(color_scheme="dark")
    complaints = []
    page.on("console", lambda m: complaints.append(m.text))
    page.goto(path.as_uri())
    pdf = page.pdf(prefer_css_page_size=True)
    page.close()
    assert pdf.startswith(b"%PDF") and 20_000 < len(pdf) < 3_000_000 and complaints == []


def test_power_report_says_what_would_be_missed():
    document = example._common([]) | {"effects": [
        {"effect": "coulomb", "equation": "torque", "found": True, "smallest": {"tau_c_Nm": {"value": 4e-4, "unit": "N m"}}, "rms": 4e-4, "unit": "N m", "times_floor": 1.3},
        {"effect": "cogging", "equation": "torque", "found": False, "why": "this motion does not show it at any size; record: slow turns"}]}
    text = report.html(document, [], "driveid power")
    for words in ("How small an effect", "400 µN·m", "1.3 × floor", "would be missed", "slow turns"):
        assert words in text, words

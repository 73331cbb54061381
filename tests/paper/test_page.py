# SPDX-License-Identifier: Apache-2.0
"""docs/papers.md is what the tests of this folder measure: the same lines, each number within its own tolerance."""

import importlib.util
import os
import re
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def papers():
    spec = importlib.util.spec_from_file_location("papers", TOP / "docs" / "papers.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def cells(text):
    """(table, entry) -> cells; headings carry the table."""
    table, out = "", {}
    for line in text.splitlines():
        if line.startswith("###"):
            table = line
        elif line.startswith("| ") and not line.startswith("| |"):
            entry, *rest = (c.strip() for c in line.strip("|").split(" | "))
            out[table, entry.strip("| ")] = [c.strip(" |") for c in rest]
    return out


def test_the_committed_page_is_that_of_the_tests(papers):
    rows = papers.measure(Path(os.environ.get("DRIVEID_BUILD", TOP / "build")))
    fresh, committed = cells(papers.render(rows)), cells((TOP / "docs" / "papers.md").read_text())
    assert list(fresh) == list(committed), "docs/papers.md lacks lines or has others: make it again (python3 docs/papers.py > docs/papers.md)"
    assert len(fresh) == len(rows) > 300
    for (_, table, _, entry, _, _, expected, slack, kind), (key, (printed, here, told)), (printed_now, _, told_now) in zip(rows_in_page_order(papers, rows), committed.items(), fresh.values(), strict=True):
        assert (printed, told) == (printed_now, told_now), key
        value = float(here)
        if kind == "below":
            assert value <= float(expected), f"{key}: the page says {here}"
        else:
            assert abs(value - float(expected)) <= 1.0001 * float(slack) + 1e-4 * abs(value), f"{key}: the page says {here}"


def rows_in_page_order(papers, rows):
    out = []
    for paper in papers.PAPERS:
        tables = {}
        for row in rows:
            if row[0] == paper:
                tables.setdefault(row[1], []).append(row)
        out += [row for entries in tables.values() for row in entries]
    return out


def test_every_table_of_the_thesis_and_the_papers_has_its_place():
    text = (TOP / "docs" / "papers.md").read_text()
    for table in ["Table 1", "Table 2", "Example 3", "Table (10)", "Table (11)", "Control application", "(13)", "Sliding window", "2.1", "3.1", "3.2", "3.3 to 3.5", "3.6", "3.7", "3.8", "3.9", "3.10", "3.11", "3.12",
                  "3.13", "3.14", "3.15", "4.1 and 4.2", "4.5", "4.6", "4.7", "4.8", "4.9", "4.10 and 4.11", "5.2", "5.3", "5.4", "6.1"]:
        assert re.search(rf"^### .*{re.escape(table)}", text, re.M), table


# As many lines as the paper's table has numbers, or as what it claims asks for (estimates with two quadratures: twice).
ROWS = {"Table 1: mean": 8, "Table 2: error": 3, "Section 3.2": 2, "Table 2: standard": 3, "Example 3: errors": 12, "Table (10)": 10, "Table (11)": 10, "Control application": 2, "G(s) from": 6, "Least squares in z": 4, "Short sliding": 6, "No singular": 2, "Cramer-Rao bound of": 1,
        "Table 2.1": 12, "Table 3.1:": 4, "Table 3.2": 8, "Table 3.3:": 4, "Table 3.4": 16, "Table 3.5": 4, "Table 3.6": 16, "Table 3.7": 16, "Table 3.8": 16, "Table 3.9": 16, "Table 3.10": 12,
        "Table 3.11": 16, "Table 3.12": 16, "Table 3.13": 10, "Table 3.14": 10, "Table 3.15": 20, "Table 4.1:": 9, "Tables 4.1 and 4.2": 12, "Table 4.3": 12, "Table 4.4": 18, "Table 4.5": 12,
        "Table 4.6 (Fourier)": 8, "Table 4.6 (Walsh)": 8, "Table 4.7: b from derivatives (Fourier)": 9, "Table 4.7: b from derivatives (Walsh)": 3, "Table 4.8": 8, "Table 4.9": 8, "Table 4.10": 5,
        "Tables 4.10 and 4.11": 4, "Table 5.1": 24, "Table 5.2": 12, "Table 5.3": 32, "Table 5.4": 26, "Table 6.1": 33, "Table 6.2": 6}


@pytest.mark.parametrize("table", ROWS)
def test_every_number_of_a_table_has_its_line(table):
    sections = re.split(r"^### ", (TOP / "docs" / "papers.md").read_text(), flags=re.M)
    found = [section for section in sections if section.startswith(table)]
    assert len(found) == 1, table
    assert len(re.findall(r"^\| [^|]", found[0], re.M)) == ROWS[table]

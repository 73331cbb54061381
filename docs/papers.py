# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of tests/paper and writes docs/papers.md from what they measured: python3 docs/papers.py [BUILD] > docs/papers.md"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[1]
PAPERS = {
    "Kasac 2018": "J. Kasac, Z. Majetic, D. Brezak: frequency-shifting method, 2018",
    "Oueslati 2011": "M. Oueslati et al.: algebraic identification of a mass-spring-damper, 2011",
    "Fliess 2006": "M. Fliess et al.: discrete-time identification in z and q, 2006",
    "El-Shafey 1987": "M. H. El-Shafey: modal functions, University of British Columbia, 1987",
    "Cramer-Rao": "Methods against the Cramer-Rao bound",
    "Beyond the papers": "Beyond the papers",
}
HEAD = """# The papers' numbers, and ours

Made by `python3 docs/papers.py > docs/papers.md`, which runs the tests of `tests/paper`; do not edit by hand. Each line is an assertion of these tests: *asserted* is what a correct
implementation reaches (a value with its tolerance, or the largest error allowed), *printed* is what the paper has, a dash where it has nothing or the text is lost.
"""


def measure(build: Path) -> list[list[str]]:
    """Rows (paper, table, why, entry, printed, ours, asserted, slack, kind) in the order of the tests; a failing test is an error."""
    programs = sorted(p for p in (build / "tests" / "paper").glob("paper_*") if p.is_file() and os.access(p, os.X_OK))
    if not programs:
        raise SystemExit(f"no tests in {build / 'tests' / 'paper'}: build them first (tools/setup)")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for program in programs:
            file = Path(folder) / f"{program.name}.tsv"
            done = subprocess.run([program], env={**os.environ, "DRIVEID_PAPERS": str(file)}, capture_output=True, text=True)
            if done.returncode:
                raise SystemExit(f"{program.name} failed:\n{done.stdout[-2000:]}")
            if file.exists():
                rows += [line.split("\t") for line in file.read_text().splitlines()]
    return rows


def number(text: str, digits: int = 4) -> str:
    value = float(text)
    return "-" if math.isnan(value) else f"{value:.{digits}g}"


def asserted(expected: str, slack: str, kind: str) -> str:
    return f"at most {number(expected, 3)}" if kind == "below" else f"{number(expected, 5)} ± {number(slack, 2)}"


def render(rows: list[list[str]]) -> str:
    out = [HEAD]
    for paper, title in PAPERS.items():
        out.append(f"## {title}\n")
        tables: dict[tuple[str, str], list[list[str]]] = {}
        for row in rows:
            if row[0] == paper:
                tables.setdefault((row[1], row[2]), []).append(row)
        for (table, why), entries in tables.items():
            out.append(f"### {table}\n")
            if why:
                out.append(f"{why[0].upper()}{why[1:]}.\n")
            out.append("| | printed | here | asserted |\n|---|---|---|---|")
            out += [f"| {entry} | {number(printed)} | {number(ours, 5)} | {asserted(expected, slack, kind)} |" for _, _, _, entry, printed, ours, expected, slack, kind in entries]
            out.append("")
    return "\n".join(out)


if __name__ == "__main__":
    print(render(measure(Path(sys.argv[1]) if len(sys.argv) > 1 else TOP / "build")), end="")

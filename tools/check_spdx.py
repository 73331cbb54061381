#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Each source file in git names its licence once, in its first lines, and leaves no work for later unsaid.

    tools/check_spdx.py [ROOT]
"""
import re
import subprocess
import sys
from pathlib import Path

LINE = "SPDX-License-Identifier: Apache-2.0"
SUFFIXES = {".c", ".h", ".cpp", ".hpp", ".inc", ".py", ".pyi", ".sh", ".cmake", ".css", ".js"}
NAMES = {"CMakeLists.txt"}
LATER = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b")


def is_source(root, path):
    file = root / path
    if file.suffix in SUFFIXES or file.name in NAMES:
        return True
    return file.suffix == "" and file.is_file() and file.read_bytes()[:2] == b"#!"


def findings(root):
    listed = subprocess.run(["git", "-C", root, "ls-files", "-z", "--cached", "--others", "--exclude-standard"], check=True, capture_output=True, text=True).stdout
    for path in filter(None, listed.split("\0")):
        if not (root / path).is_file() or "/vendor/" in path or "/third_party/" in path or not is_source(root, path):
            continue
        lines = (root / path).read_text(errors="replace").splitlines()
        if not lines:
            continue
        if not any(LINE in line for line in lines[:3]):
            yield f"{path}: no '{LINE}' in its first three lines"
        if path != "tools/check_spdx.py":
            for number, line in enumerate(lines, 1):
                if LATER.search(line):
                    yield f"{path}:{number}: work left for later: {line.strip()[:80]}"


def main():
    root = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).resolve().parent.parent)
    found = list(findings(root))
    for finding in found:
        print(finding)
    print(f"check_spdx: {len(found)} findings" if found else "check_spdx: one licence line a file, nothing left for later")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

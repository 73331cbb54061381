#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Keep the arrows of ARCHITECTURE.md true: read includes, link lines and imports.

    tools/check_layers.py [ROOT]

Prints each breach as file:line: what, and why; exit code 1 where there is one.
"""
import re
import sys
from pathlib import Path

# room -> (folders, rooms it may include). The longest folder that matches a file wins.
ROOMS = {
    "base": (["lib/base"], []),
    "effect": (["lib/effect"], ["base"]),
    "model": (["lib/model"], ["base", "effect"]),
    "model file": (["lib/model/file"], ["base", "effect", "model"]),
    "estimate": (["lib/estimate"], ["base", "effect", "model"]),
    "batch": (["lib/batch"], ["base", "effect", "model", "model file"]),
    "diagnose": (["lib/diagnose"], ["base", "effect", "model", "model file", "batch"]),
    "daemon": (["daemon"], []),
    "bindings": (["bindings/python"], []),
    "simulator": (["tools/sim"], []),
}
# public header -> room it belongs to
HEADERS = {
    "status": "base", "time": "base", "sample": "base", "version": "base", "regression": "base", "filter": "base", "fixed": "base",
    "filter": "base", "effect": "effect", "model": "model", "simulate": "model", "model_file": "model file", "batch": "batch",
    "modal": "batch", "lti": "batch", "control": "batch", "diagnose": "diagnose", "fsm": "estimate", "discrete": "estimate", "monitor": "estimate", "watch": "estimate", "estimate": "estimate", "fleet": "estimate", "frequency": "estimate", "excitation": "estimate",
}
# ARCHITECTURE.md: driveid_estimate is plain data that model maps to physical parameters; its page is included by both.
SHARED_HEADERS = {"estimate": {"model", "model file", "batch", "diagnose"}}
# Rooms that see public headers only, and which ones.
PUBLIC_ONLY = {"daemon": None, "bindings": None, "simulator": {"status", "time", "sample", "version"}}
# CMake target -> targets of ours that it may link
LINKS = {
    "driveid": set(), "driveid_file": {"driveid"}, "driveid_batch": {"driveid"}, "driveidd_core": {"driveid", "driveid_file"},
    "driveid-sim": {"driveid", "driveid_sim", "driveid-simlib"}, "driveid_sim": {"driveid"},
}
OUR_TARGETS = re.compile(r"^(driveid(_\w+|-\w+|::\w+)?|driveidd\w*)$")
IMPORTS_FORBIDDEN = {
    "bindings/python": {"daemon", "tools", "tests"},
    "tests/hidden": {"driveid"},   # the judge calls the command line and knows no code that it judges
    "tools/sim": {"driveid"},
}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')
IMPORT = re.compile(r"^\s*(?:from\s+([\w.]+)\s+import|import\s+([\w., ]+))")
C_FILES = {".c", ".h", ".cpp", ".hpp", ".inc"}


def room_of(path):
    """Room of a path below the root, or None."""
    best, name = "", None
    for room, (folders, _) in ROOMS.items():
        for folder in folders:
            if path.startswith(folder + "/") and len(folder) > len(best):
                best, name = folder, room
    return name


def header_breach(room, header):
    """Why this room may not include <driveid/header.h>, or None."""
    allowed = PUBLIC_ONLY.get(room, False)
    if allowed is not False:
        return None if allowed is None or header in allowed else f"{room} may include only {', '.join(sorted(allowed))}"
    owner = HEADERS.get(header)
    if owner is None:
        return f"no room is known for <driveid/{header}.h>: enter it in HEADERS of tools/check_layers.py"
    if owner == room or owner in ROOMS[room][1] or room in SHARED_HEADERS.get(header, ()):
        return None
    return f"{room} may not use {owner}"


def resolve(root, path, target):
    """Path below the root of a quoted include, or None where it is not ours."""
    for folder in (Path(path).parent, Path("lib"), Path("lib/include"), *(Path(f) for fs, _ in ROOMS.values() for f in fs), Path(".")):
        candidate = (root / folder / target).resolve()
        if candidate.is_file() and candidate.is_relative_to(root):
            return candidate.relative_to(root).as_posix()
    return None


def include_breaches(root, path, lines):
    room = room_of(path)
    for number, line in enumerate(lines, 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        target = match.group(2)
        if target.startswith("driveid/"):
            why = header_breach(room, Path(target).stem)
        elif match.group(1) == '"' and (found := resolve(root, path, target)):
            other = room_of(found)
            if other is None or other == room or other in ROOMS[room][1]:
                continue
            why = f"{room} may not use {other} ({found})"
        else:
            continue
        if why:
            yield f'{path}:{number}: includes "{target}": {why}'


def public_header_breaches(path, lines):
    """A public header includes public headers and the C standard library, nothing else."""
    for number, line in enumerate(lines, 1):
        match = INCLUDE.match(line)
        if match and match.group(1) == '"':
            yield f'{path}:{number}: a public header includes "{match.group(2)}": only <driveid/...> and C headers'


def link_breaches(path, text):
    for match in re.finditer(r"target_link_libraries\s*\(\s*([^\s)]+)([^)]*)\)", text):
        target = match.group(1)
        if target not in LINKS:
            continue
        number = text.count("\n", 0, match.start()) + 1
        for word in match.group(2).split():
            other = word.replace("driveid::batch", "driveid_batch").replace("driveid::driveid", "driveid")
            if OUR_TARGETS.match(other) and other not in LINKS[target]:
                yield f"{path}:{number}: {target} may not link {other}"


def import_breaches(path, lines):
    forbidden = next((names for folder, names in IMPORTS_FORBIDDEN.items() if path.startswith(folder + "/")), set())
    for number, line in enumerate(lines, 1):
        match = IMPORT.match(line)
        if not match:
            continue
        for name in re.split(r"[,\s]+", match.group(1) or match.group(2)):
            if name.split(".")[0] in forbidden:
                yield f"{path}:{number}: imports {name}, which this folder may not use"


def breaches(root):
    root = Path(root).resolve()
    for file in sorted(root.rglob("*")):
        path = file.relative_to(root).as_posix()
        if not file.is_file() or path.startswith(("build", ".", "out/")) or "/build/" in path:
            continue
        if file.suffix in C_FILES:
            lines = file.read_text(errors="replace").splitlines()
            if path.startswith("lib/include/"):
                yield from public_header_breaches(path, lines)
            elif room_of(path):
                yield from include_breaches(root, path, lines)
        elif file.suffix == ".py":
            yield from import_breaches(path, file.read_text(errors="replace").splitlines())
        elif file.name == "CMakeLists.txt":
            yield from link_breaches(path, file.read_text(errors="replace"))


def main():
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent.parent
    found = list(breaches(root))
    for breach in found:
        print(breach)
    print(f"check_layers: {len(found)} breaches" if found else "check_layers: every arrow holds")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

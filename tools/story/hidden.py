# SPDX-License-Identifier: Apache-2.0
"""The last act: an effect that the model lacks is switched on in the drive; it is noticed, explained from the recorded frames, added, and the error falls."""
import grp
import json
import os
import random
import signal
import subprocess
import time

from common import DAEMON, DRIVEID, SIM, free_port, pace, rate_on, steadily, wait_for, watch
from gateway import Control
from table import console

EFFECTS = ["coulomb", "constant_load", "quadratic_drag", "gravity_unbalance"]
FAST_EFFECTS = ["cogging"]  # need more than the 250 samples a second of Modbus
EFFECT_AT_S, BEFORE_S, AFTER_S = 75, 25, 40


def driveid(folder, *words):
    """Run the command line as a person would; its JSON where it writes one to standard output."""
    console.print("$ driveid " + " ".join(map(str, words)), style="dim")
    done = subprocess.run([DRIVEID, *map(str, words)], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if done.returncode:
        raise RuntimeError(f"driveid {words[0]} ended with code {done.returncode}:\n{done.stderr[-2000:]}")
    return json.loads(done.stdout) if "--json" in words else None


def record(control, name, seconds):
    """The gateway's own record, for so long."""
    control.ask("record_start", file=name)
    time.sleep(seconds)
    return control.ask("record_stop")["file"]


def load(config, model, daemon, control):
    """Give the daemon another model while it runs."""
    text = config.read_text()
    head, rest = text.split("[[drive]]", 1)
    lines = [line for line in rest.splitlines() if not line.startswith(("structure =", "given =", "model ="))]
    lines.insert(2, f'model = "{model}"')
    config.write_text(head + "[[drive]]" + "\n".join(lines) + "\n")
    before = control.ask("status")["drives"][0]["samples"]
    daemon.send_signal(signal.SIGHUP)
    # The drive is built anew: its samples count from zero.
    wait_for(lambda: control.ask("status")["drives"][0]["samples"] < before + 1, 10, "the new model's loading", lambda: None)


def explained(answer, effect):
    first = next((r for r in answer["ranked"] if r["accepted"]), None)
    if not first:
        return False, f"verdict {answer['verdict']}, no effect"
    names = [first["effect"], *(t if isinstance(t, str) else t.get("effect", "") for t in first["not_told_apart_from"])]
    return effect in names, f"{first['effect']} takes {100 * first['share']:.0f} % of the removable error" + (f", not told apart from {', '.join(names[1:])}" if names[1:] else "")


def start(given, programs, effect):
    folder, on_can = programs.folder, given.inside == "vcan"
    address = "can:vcan0" if on_can else f"modbus:127.0.0.1:{free_port()}"
    config = folder / "hidden.toml"
    programs.start("driveid-sim-hidden", [SIM, "run", "--bus", address, "--seed", given.seed + 1, "--rate", rate_on(given), "--average", "--effect", effect, "--effect-at", EFFECT_AT_S, "--size", 1,
                                          "--truth", "hidden.json", "--config", config, "--socket", folder / "hidden.sock", "--record-folder", folder])
    wait_for((folder / "hidden.json").exists, 15, "the simulated drive's start", programs.check)
    text = config.read_text().replace("[control]\n", f'[control]\nwrite_group = "{grp.getgrgid(os.getgid()).gr_name}"\n', 1)
    config.write_text(text)
    if on_can:
        pace(config)
    daemon = programs.start("driveidd-hidden", [DAEMON, config])
    return config, daemon, Control(folder / "hidden.sock", check=programs.check), time.monotonic()


def residual(drive):
    return drive["residual"]


def named(drive, noticed, effect):
    r, told = residual(drive), "noticed: the model no longer explains this drive"
    if not noticed:
        return False, told + " was not said"
    ties = r["not_told_apart_from"]
    return effect in [r["likely_effect"], *ties], (f"{told}; likely effect: {r['likely_effect']}" + (f", not told apart from {', '.join(ties)}" if ties else "")
                                                   + f"; switched on was {effect}; residual {r['rms']:.3g} {r['unit']}, usual {r['usual_rms']:.3g}")


def hidden_act(given, programs):
    folder, effect = programs.folder, random.Random(given.seed + 2).choice(EFFECTS + (FAST_EFFECTS if given.inside == "vcan" else []))
    console.print(f"drive: rigid_axis drawn from seed {given.seed + 1}; after {EFFECT_AT_S} s an effect that its model lacks is switched on")
    config, daemon, control, began = start(given, programs, effect)
    truth = json.loads((folder / "hidden.json").read_text())["phases"][0]["drive"]
    time.sleep(2)
    driveid(folder, "model", "new", "rigid_axis", "--given", f"K_t_Nm_A={truth['K_t_Nm_A']!r}", "-o", "axis.toml")
    before = record(control, "before", BEFORE_S)
    driveid(folder, "fit", "axis.toml", before, "-o", "fitted.toml")
    load(config, "fitted.toml", daemon, control)

    switched_ns = json.loads((folder / "hidden.json").read_text())["start_monotonic_ns"] + EFFECT_AT_S * 10**9
    left = EFFECT_AT_S + 60 - (time.monotonic() - began)
    settled = steadily(lambda d: residual(d)["likely_effect"] and residual(d)["since_ns"] > switched_ns - 10**9, 5)
    drive, noticed = watch(control, programs, "the fitted model runs beside the drive; something will change", truth, left, settled)
    yield named(drive, noticed, effect)
    if not noticed:
        return
    after = record(control, "after", AFTER_S)
    drive = control.ask("status")["drives"][0]
    right, sentence = explained(driveid(folder, "explain", "fitted.toml", after, "--json", "-"), effect)
    yield right, f"explained from the recorded frames: {sentence}; switched on was {effect}"
    if not right:
        return
    driveid(folder, "add", "fitted.toml", effect, "-o", "more.toml")
    driveid(folder, "fit", "more.toml", after, "-o", "final.toml")
    high, usual = residual(drive)["rms"], residual(drive)["usual_rms"]
    load(config, "final.toml", daemon, control)
    drive, fallen = watch(control, programs, f"the model with {effect} runs beside the drive", truth, 40,
                          steadily(lambda d: residual(d)["usual_rms"] and not residual(d)["alarm"] and residual(d)["rms"] < max(0.6 * high, 1.1 * usual), 5))
    yield bool(fallen), f"added and loaded: the streamed residual fell from {high:.3g} to {residual(drive)['rms']:.3g} {residual(drive)['unit']}" + ("" if fallen else ": not by enough, or the alarm stayed")
    control.close()
    programs.stop_all()

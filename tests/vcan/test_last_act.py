# SPDX-License-Identifier: Apache-2.0
"""Frames of a last act of tools/run: a drive with a fitted model, in which Coulomb friction is switched on; what the daemon says of them.

last-act/ has the frames, the model fitted before the change, the model that explain, add and fit made of the frames after it, and the truth."""
import gzip
import json
import shutil
from pathlib import Path

ACT = Path(__file__).resolve().parent / "last-act"
EFFECT = "coulomb"


def frames(after_s=0.0):
    """Lines of the session from so many seconds after its start; the effect comes after 12 s."""
    lines = gzip.decompress((ACT / "frames.log.gz").read_bytes()).decode().splitlines(True)
    first = float(lines[0][1:lines[0].index(")")])
    return "".join(line for line in lines if float(line[1:line.index(")")]) >= first + after_s)


def configure(folder, model, source):
    shutil.copy(ACT / model, folder / "fitted.toml")
    (folder / "gw.toml").write_text(f'format = 1\n[control]\nsocket = "{folder / "c.sock"}"\n[[source]]\nname = "bus"\n{source}\n{(ACT / "drive.toml").read_text()}')


def named(residual):
    return residual["alarm"] and EFFECT in [residual["likely_effect"], *residual["not_told_apart_from"]]


def test_the_effect_is_said_and_the_model_with_it_explains_the_drive(gateway):
    configure(gateway.folder, "fitted.toml", 'kind = "socketcan"\ninterface = "vcan0"')
    truth = json.loads((ACT / "truth.json").read_text())
    assert truth["phases"][1]["what"] == "effect" and [e["effect"] for e in truth["phases"][1]["effects"]] == [EFFECT]

    def play(after_s):
        (gateway.folder / "frames.log").write_text(frames(after_s))
        return gateway.programs.start("canplayer", ["canplayer", "-I", "frames.log"])

    gateway.listen("gw.toml")
    player = play(0)
    gateway.until(lambda s: s["drives"][0]["samples"] > 2500, 30, "the first 10 s")
    assert not gateway.status()["drives"][0]["residual"]["alarm"], "nothing before the switch-on"
    status = gateway.until(lambda s: named(s["drives"][0]["residual"]), 20, f"{EFFECT} as likely effect")
    high = status["drives"][0]["residual"]["rms"]
    player.wait(30)
    gateway.programs.stop_all()

    configure(gateway.folder, "final.toml", 'kind = "socketcan"\ninterface = "vcan0"')
    gateway.listen("gw.toml")
    player = play(12.5)
    player.wait(30)
    residual = gateway.status()["drives"][0]["residual"]
    assert not residual["alarm"] and residual["usual_rms"] and residual["rms"] < 0.3 * high

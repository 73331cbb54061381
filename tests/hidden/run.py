# SPDX-License-Identifier: Apache-2.0
"""Run cases: make the records, ask the command line `driveid`, score. The truth is read and deleted before driveid starts."""
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).resolve().parent))
import judge  # noqa: E402

LIMIT_S = float(os.environ.get("DRIVEID_HIDDEN_LIMIT_S", "180"))  # for one command


def programs():
    build = Path(os.environ.get("DRIVEID_BUILD", TOP / "build"))
    sim = Path(os.environ.get("DRIVEID_SIM", build / "tools/sim/driveid-sim"))
    cli = Path(os.environ.get("DRIVEID_CLI", TOP / ".venv/bin/driveid"))
    for program, mend in ((sim, "cmake --build build"), (cli, "tools/setup")):
        if not program.exists():
            raise FileNotFoundError(f"{program} is not there: {mend}")
    return str(sim), str(cli)


class Failure(Exception):
    """The command line did not answer."""


class Bench:
    """One case on disk: records and models in a folder; the truth only in memory."""

    def __init__(self, case, keep=None):
        self.sim, self.cli = programs()
        self.case = case
        self.folder = Path(keep) if keep else Path(tempfile.mkdtemp(prefix="driveid-hidden-"))
        self.kept = keep is not None
        self.seconds = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if not self.kept:
            shutil.rmtree(self.folder, ignore_errors=True)

    def make(self):
        with tempfile.TemporaryDirectory(prefix="driveid-truth-") as elsewhere:
            file = Path(elsewhere) / "truth.json"
            done = subprocess.run([self.sim, "case", *self.case.arguments(), "--out", str(self.folder), "--truth", str(file)],
                                  capture_output=True, text=True, timeout=LIMIT_S, stdin=subprocess.DEVNULL)
            if done.returncode:
                raise RuntimeError(f"driveid-sim: {done.stderr.strip()}")
            text = file.read_text()
        self.truth, self.truth_hash = json.loads(text), hashlib.sha256(text.encode()).hexdigest()
        self.known = json.loads((self.folder / "case.json").read_text())
        (self.folder / "case.json").unlink()

    def driveid(self, *arguments, codes=(0,)):
        started = time.monotonic()
        try:
            done = subprocess.run([self.cli, *arguments], cwd=self.folder, capture_output=True, text=True, timeout=LIMIT_S, stdin=subprocess.DEVNULL)
        except subprocess.TimeoutExpired as late:
            raise Failure(f"driveid {arguments[0]}: no answer within {LIMIT_S} s") from late
        finally:
            self.seconds += time.monotonic() - started
        if done.returncode not in codes:
            raise Failure(f"driveid {arguments[0]}: exit code {done.returncode}: {done.stderr.strip()[-300:]}")
        return done

    def model(self):
        given = [f"--given={k}={v!r}" for k, v in self.known["given"].items()]
        self.driveid("model", "new", self.known["structure"], *given, "-o", "m.toml")
        for effect in self.known["effects_known"]:
            self.driveid("add", "m.toml", effect, "-o", "m.toml")

    def explain(self):
        self.model()
        self.driveid("fit", "m.toml", "train.csv", "-o", "fitted.toml", codes=(0, 3))
        model = "fitted.toml" if (self.folder / "fitted.toml").exists() else "m.toml"
        self.driveid("explain", model, "train.csv", "--held-out", "held_out.csv", "--json", "e.json", codes=(0, 3))
        return json.loads((self.folder / "e.json").read_text())

    def held_out_error(self, effects):
        """Equation error on the held-out record of the model with these effects, fitted on the training record."""
        self.driveid("add", "m.toml", effects[0], "-o", "t.toml")
        for effect in effects[1:]:
            self.driveid("add", "t.toml", effect, "-o", "t.toml")
        self.driveid("fit", "t.toml", "train.csv", "-o", "tf.toml")
        self.driveid("compare", "tf.toml", "held_out.csv", "--json", "c.json")
        return json.loads((self.folder / "c.json").read_text())["records"][-1]["errors"]["equation"]["rmse"]


def run_case(case, deep=False, keep=None):
    """Everything that is known about a case afterwards, as one JSON object. deep: fit the true model too, wherever an effect was answered."""
    out = {"case": case.name, **case.as_dict()}
    with Bench(case, keep) as bench:
        bench.make()
        out.update(truth_hash=bench.truth_hash, equation=bench.truth["equation"], ratio=bench.truth["train"]["ratio"], ratio_held_out=bench.truth["held_out"]["ratio"],
                   significance=bench.truth["train"]["significance"], significance_held_out=bench.truth["held_out"]["significance"],
                   dirt=bench.truth["dirt"], rate_Hz=bench.truth["rate_Hz"], known=bench.known["effects_known"])
        try:
            answer = bench.explain()
            out["seconds"] = round(bench.seconds, 2)  # of model, fit and explain; ties are checked after
            out.update(judge.judge(case.as_dict(), bench.truth, answer, lambda names: tie_is_real(bench, case, names)))
            bench.truth["measures_torque"] = not any(k.startswith("K_") for k in bench.known["given"]) and bool({"tau_Nm", "F_N"} & columns(bench))
            bench.truth["has_temperature"] = "T_degC" in columns(bench)
            out["coverage"] = judge.coverage(case.as_dict(), bench.truth, answer, bench.known["given"])
            out["ranked"] = [{k: e.get(k) for k in ("effect", "accepted", "share", "confidence", "not_told_apart_from")} for e in answer.get("ranked", [])[:4]]
            if deep and out["first"] and case.group == "single":
                after = answer["error_after"]["held_out"]["equation"]["rmse"]
                out["held_out_over_true"] = after / bench.held_out_error(case.effects)
        except Failure as failure:
            out.update(right=False, verdict="failed", failure=str(failure), seconds=round(bench.seconds, 2))
    return out


def columns(bench):
    with open(bench.folder / "train.csv") as f:
        return set(f.readline().strip().split(","))


def tie_is_real(bench, case, names):
    """Each member fits held-out data within 5 % of the true model's error."""
    true = bench.held_out_error(case.effects)
    return all(bench.held_out_error([name]) <= (1 + judge.TIE_TOLERANCE) * true for name in names if name not in case.effects)

# SPDX-License-Identifier: Apache-2.0
"""The package for engineers: models, fits, on-line replay, progress and interruption."""

import copy
import os
import signal
import threading
import time

import numpy as np
import pytest

import driveid
from driveid import _core, online
from driveid.records.table import Record
from conftest import drive


def record(**more) -> Record:
    columns = drive(6.0, **more)
    t = columns.pop("t_s")
    columns.pop("omega_rad_s")
    return Record("run", np.rint(t * 1e9).astype(np.int64), columns)


def test_record_from_arrays():
    r = driveid.Record.of("mine", t_s=[0, 0.5], i_A=np.array([1, 2], dtype=np.float32), theta_rad=[0, 1])
    assert r.t_ns.tolist() == [0, 500_000_000] and r["i_A"].dtype == np.float64
    for words, arguments in (("one time", {"i_A": [1]}), ("is no signal", {"t_s": [0], "amps": [1]}), ("shape", {"t_s": [0, 1], "i_A": [1]})):
        with pytest.raises(driveid.UsageError, match=words):
            driveid.Record.of("mine", **arguments)


def test_model():
    m = driveid.Model.new("rigid_axis", K_t_Nm_A=0.05)
    assert m.structure == "rigid_axis" and m.parameters["K_t_Nm_A"].value == 0.05 and m.parameters["J_kgm2"].value is None
    two = m.add("coulomb").add("cogging")
    assert [e.name for e in two.effects] == ["coulomb", "cogging"] and not m.effects
    assert driveid.Model(two.toml).toml == two.toml
    with pytest.raises(driveid.UsageError, match="Did you mean 'rigid_axis'"):
        driveid.Model.new("rigid_axi")
    with pytest.raises(driveid.FileError, match="line 2"):
        driveid.Model("format = 1\nstructur = 3\n", "x.toml")


def test_save_is_whole_or_nothing(tmp_path):
    m = driveid.Model.new("rigid_axis")
    m.save(tmp_path / "m.toml")
    assert driveid.Model.load(tmp_path / "m.toml").toml == m.toml and [p.name for p in tmp_path.iterdir()] == ["m.toml"]
    with pytest.raises(driveid.FileError, match="cannot be written"):
        m.save(tmp_path / "none" / "m.toml")


def test_fit_with_progress():
    seen = []
    f = driveid.fit(driveid.Model.new("rigid_axis", K_t_Nm_A=0.05).add("coulomb"), record(), progress=lambda done, what: seen.append(done))
    J = f.parameters["J_kgm2"]
    assert J.interval[0] < J.value < J.interval[1] and J.value == pytest.approx(2.0e-4, rel=0.05)
    assert f.parameters["tau_c_Nm"].value == pytest.approx(0.004, rel=0.1)
    assert f.model.structure == "rigid_axis" and f.document["format"] == 1
    assert all(0 <= d <= 1 for d in seen)


def test_bad_data_carries_its_document():
    r = record()
    short = Record("short", r.t_ns[:4], {n: v[:4] for n, v in r.columns.items()}, notices=["seen while reading"])
    with pytest.raises(driveid.DataError) as e:
        driveid.explain(driveid.Model.new("rigid_axis"), short)
    assert e.value.document["verdict"] == "bad_data" and e.value.document["notices"][0]["text"] == "seen while reading"


def test_keyboard_interrupt_cancels_and_other_threads_run():
    """explain works without the GIL: a Python thread counts meanwhile, and Ctrl-C comes through."""
    m, r = driveid.Model.new("rigid_axis", K_t_Nm_A=0.05), record()
    started, count, stop = threading.Event(), [0], threading.Event()

    def meanwhile():
        while not stop.is_set():
            count[0] += 1
            time.sleep(0.001)
    thread = threading.Thread(target=meanwhile)
    thread.start()

    def progress(done, what):
        if not started.is_set():
            started.set()
            os.kill(os.getpid(), signal.SIGINT)
    before = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            driveid.improve(m, r, progress=progress)
            pytest.skip("SKIPPED BECAUSE the walk ended before its first progress report")
    finally:
        stop.set()
        thread.join()
    assert time.monotonic() - before < 10 and count[0] > 5


def test_an_error_in_the_callback_comes_back():
    def progress(done, what):
        raise LookupError("mine")
    with pytest.raises(LookupError, match="mine"):
        driveid.improve(driveid.Model.new("rigid_axis", K_t_Nm_A=0.05), record(), progress=progress)


def test_series():
    r = record()
    f = driveid.fit(driveid.Model.new("rigid_axis", K_t_Nm_A=0.05).add("coulomb"), r)
    s = driveid.series(f.model, r)
    assert s.data.shape[0] == len(s.header["series"]) and s.data.shape[1] == len(s.t_s)
    assert any(e["what"] == "residual" for e in s.header["series"])


class TestOnline:
    model = driveid.Model.new("rigid_axis", K_t_Nm_A=0.05).add("coulomb")

    @pytest.mark.parametrize("type", ["f64", "f32"])
    def test_finds_the_drive(self, type):
        result = online.replay(self.model, record(), type=type, every=100)
        value, lo, hi, valid = result.final()["J_kgm2"]
        assert valid and value == pytest.approx(2.0e-4, rel=0.05) and lo < value < hi
        assert len(result.t_ns) == 60 and result.t_ns[-1] == 5_999_000_000

    def test_same_bits_each_time_whatever_the_pieces(self):
        r = record()
        whole = online.replay(self.model, r, dt_s=0.001)
        names = list(r.columns)
        engine = _core.Online(self.model.toml, names, dt_s=0.001)
        parts, cut = [], 2345
        for rows in (slice(0, cut), slice(cut, None)):
            parts.append(engine.run(np.ascontiguousarray(r.t_ns[rows]), [(n, np.ascontiguousarray(r.columns[n][rows])) for n in names]))
            engine = copy.copy(engine)  # a snapshot goes on with the same bits
        valid = np.concatenate([p["valid"] for p in parts]).astype(bool)
        value = np.concatenate([p["value"] for p in parts])
        assert valid.any() and np.array_equal(valid, whole.valid) and np.array_equal(value[valid], whole.value[whole.valid])

    def test_refusals(self):
        with pytest.raises(driveid.UsageError, match="choose"):
            online.replay(self.model, record(), method="magic")
        with pytest.raises(driveid.UsageError, match="Did you mean 'gap_s'"):
            online.replay(self.model, record(), gaps_s=3)
        r = record()
        del r.columns["theta_rad"]
        with pytest.raises(driveid.UsageError, match="model on line"):
            online.replay(self.model, r)

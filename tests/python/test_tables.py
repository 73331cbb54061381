# SPDX-License-Identifier: Apache-2.0
"""Parquet, written by pyarrow."""

import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import driveid
from driveid.errors import FileError


def test_parquet(tmp_path):
    table = pa.table({"t_ns": pa.array([10**18 + k for k in range(3)]), "i [mA]": pa.array([1.0, None, 3.0]), "theta_rad": pa.array([1, 2, 3], pa.int32()), "note": ["a", "b", "c"]})
    pq.write_table(table, tmp_path / "r.parquet")
    r = driveid.read(tmp_path / "r.parquet")
    assert r.t_ns.tolist() == [10**18 + k for k in range(3)]
    np.testing.assert_allclose(r["i_A"], [1e-3, np.nan, 3e-3])
    assert r["theta_rad"].tolist() == [1, 2, 3]


def test_timestamps_and_float32(tmp_path):
    start = datetime.datetime(2024, 1, 1, tzinfo=datetime.timezone.utc)
    stamps = pa.array([start, start + datetime.timedelta(microseconds=1)], pa.timestamp("us", tz="UTC"))
    pq.write_table(pa.table({"time": stamps, "pos": pa.array([90, 180], pa.float32())}), tmp_path / "r.parquet")
    r = driveid.read(tmp_path / "r.parquet", {"theta_rad": "pos:deg"})
    assert np.diff(r.t_ns).tolist() == [1000] and r.t_ns[0] == 1_704_067_200 * 10**9
    np.testing.assert_allclose(r["theta_rad"], [np.pi / 2, np.pi])


def test_damaged_and_textual(tmp_path):
    (tmp_path / "r.parquet").write_bytes(b"PAR1 and then nothing")
    with pytest.raises(FileError, match="not a readable Parquet"):
        driveid.read(tmp_path / "r.parquet")
    pq.write_table(pa.table({"t_s": [0.0, 1.0], "i_A": ["x", "y"]}), tmp_path / "s.parquet")
    with pytest.raises(FileError, match="'i_A'.*string"):
        driveid.read(tmp_path / "s.parquet")


def test_mdf4(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="SKIPPED BECAUSE asammdf (extra mdf) is not installed")
    t = np.arange(200) * 1e-3
    slow = np.arange(40) * 5e-3
    file = asammdf.MDF()
    file.append([asammdf.Signal(1000 * np.sin(t), t, name="Iq", unit="mA"), asammdf.Signal(np.arange(200, dtype=np.int32), t, name="pos")])
    file.append([asammdf.Signal(20 + slow, slow, name="T_degC", unit="degC")])
    file.save(tmp_path / "r.mf4")
    r = driveid.read(tmp_path / "r.mf4", {"i_q_A": "Iq", "theta_rad": "pos:counts/100"})
    assert r.rows == 200 and np.array_equal(r.t_ns, np.arange(200) * 1_000_000)
    np.testing.assert_allclose(r["i_q_A"], np.sin(t), atol=1e-12)
    np.testing.assert_allclose(r["theta_rad"], 2 * np.pi * np.arange(200) / 100)
    inside = t <= slow[-1]
    np.testing.assert_allclose(r["T_degC"][inside], 20 + t[inside], atol=1e-9)
    (tmp_path / "bad.mf4").write_bytes(b"MDF     4.10    nothing behind it")
    with pytest.raises(FileError, match="not a readable MDF"):
        driveid.read(tmp_path / "bad.mf4")

# SPDX-License-Identifier: Apache-2.0
"""The CSV reader: what real loggers write, and what is said when a file is damaged."""

import gzip
import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import driveid
from driveid.errors import FileError


def write(tmp_path, text, name="run.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_plain(tmp_path):
    path = write(tmp_path, "t_s,i_A,theta_rad\n0,1,0\n0.001,2,0.5\n0.002,3,1\n")
    r = driveid.read(path)
    assert r.t_ns.tolist() == [0, 1_000_000, 2_000_000] and r.t_ns.dtype == np.int64
    assert r["i_A"].tolist() == [1, 2, 3] and r["theta_rad"].tolist() == [0, 0.5, 1]
    assert r.hash == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("text", [
    "t [s];i [mA];theta [deg]\n0;1000;0\n0.5;2000;180\n",
    "t [s];i [mA];theta [deg]\n0,0;1000,0;0,0\n0,5;2000,0;180,0\n",
    "t [ms]\ti (A)\ttheta_deg\n0\t1\t0\n500\t2\t180\n",
    "t,i,theta\ns,A,deg\n0,1,0\n0.5,2,180\n",
    "# t_ms i_A theta_deg\n0 1 0\n500 2 180\n",
    "\ufefft_s,i_A,theta_rad,\r\n0,1,0,\r\n0.5,2,3.141592653589793,\r\n",
    "% made by a logger\n\n\"t_s\", \"i_A\", \"theta_rad\"\n0,1,0\n0.5,2,3.141592653589793\n",
])
def test_dialects_mean_the_same(tmp_path, text):
    r = driveid.read(write(tmp_path, text))
    assert r.t_ns.tolist() == [0, 500_000_000]
    np.testing.assert_allclose(r["i_A"], [1, 2], rtol=1e-15)
    np.testing.assert_allclose(r["theta_rad"], [0, np.pi], rtol=1e-15)


def test_no_header_takes_numbers_of_columns(tmp_path):
    r = driveid.read(write(tmp_path, "0,1,90\n0.5,2,180\n"), ["t_s=1", "i_A=2", "theta_rad=3:deg"])
    np.testing.assert_allclose(r["theta_rad"], [np.pi / 2, np.pi])


def test_gzip(tmp_path):
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"t_s,i_A\n0,1\n1,2\n"))
    assert driveid.read(path)["i_A"].tolist() == [1, 2]


def test_epoch_times_are_exact(tmp_path):
    first = 1_700_000_000_123_456_789
    r = driveid.read(write(tmp_path, f"t_ns,i_A\n{first},1\n{first + 1},2\n"))
    assert r.t_ns.tolist() == [first, first + 1]
    r = driveid.read(write(tmp_path, "t_s,i_A\n1700000000.123456789,1\n1700000000.123456790,2\n"))
    assert r.t_ns.tolist() == [first, first + 1]
    r = driveid.read(write(tmp_path, "time,i_A\n2023-11-14T22:13:20.123456789,1\n2023-11-14T22:13:20.123456790Z,2\n"))
    assert r.t_ns.tolist() == [first, first + 1]


def test_missing_values_and_lost_times(tmp_path):
    r = driveid.read(write(tmp_path, "t_s,i_A,theta_rad\n0,1,0\n0.1,,NaN\n,3,1\n0.3,n/a,2\n"))
    assert r.rows == 3 and np.isnan(r["i_A"]).tolist() == [False, True, True] and np.isnan(r["theta_rad"]).tolist() == [False, True, False]
    assert any("1 rows without a time" in n for n in r.notices)


def test_a_cut_off_last_line_is_dropped_and_said(tmp_path):
    r = driveid.read(write(tmp_path, "t_s,i_A,theta_rad\n0,1,0\n0.1,2,1\n0.2,3"))
    assert r.rows == 2 and any("cut off" in n for n in r.notices)


def test_text_columns_that_nobody_asks_for_do_no_harm(tmp_path):
    assert driveid.read(write(tmp_path, "t_s,state,i_A\n0,IDLE,1\n1,RUN,2\n"))["i_A"].tolist() == [1, 2]


@pytest.mark.parametrize("text, words", [
    ("t_s,i_A\n0,1\n1,two\n", ["line 3", "'i_A'", "'two' is not a number"]),
    ("t_s,i_A\n0,1\n1,2,3\n2,3\n", ["line 3", "3 fields where the header has 2"]),
    ("", ["is empty"]),
    ("# only a comment\n", ["is empty"]),
    ("zeit,strom,winkel\n0,1,0\n1,2,1\n2,3,1\n", ["no time column", "--map t_s=zeit"]),
    ("t_s,i_A\n0,1\nyesterday,2\n", ["line 3", "'t_s'", "no time"]),
])
def test_errors_name_place_and_mend(tmp_path, text, words):
    with pytest.raises(FileError) as e:
        driveid.read(write(tmp_path, text))
    for word in ["run.csv", *words]:
        assert word in str(e.value)


def test_other_kinds_of_file(tmp_path):
    (tmp_path / "x.csv").write_bytes(b"\x7fELF\0\0\0")
    with pytest.raises(FileError, match="is not text"):
        driveid.read(tmp_path / "x.csv")
    (tmp_path / "run.xyz").write_text("hello")
    with pytest.raises(FileError, match="unknown kind"):
        driveid.read(tmp_path / "run.xyz")
    write(tmp_path, "t_s,i_A\n0,1\n", "run1.csv")
    with pytest.raises(FileError, match="no such file.*'run1.csv'"):
        driveid.read(tmp_path / "runl.csv")


def test_runs_of_one_file(tmp_path):
    path = write(tmp_path, "run,t_s,i_A\n" + "".join(f"{r},{k * 0.1},{r + k}\n" for r in range(3) for k in range(10)))
    records = driveid.read_all(path)
    assert [r.name for r in records] == ["run.csv[run=0]", "run.csv[run=1]", "run.csv[run=2]"]
    assert records[2]["i_A"].tolist() == [2 + k for k in range(10)] and records[2].t_ns[0] == 0
    with pytest.raises(driveid.UsageError, match="3 runs"):
        driveid.read(path)


def test_static_curve_becomes_rests(tmp_path):
    r = driveid.read(write(tmp_path, "u,y\n-1,-90\n0,0\n1,90\n"), ["v_V=u", "omega_rad_s=y:deg/s"])
    jumps = np.flatnonzero(np.diff(r.t_ns) > 1_000_000_000)
    assert len(jumps) == 2 and any("steady map, 3 points" in n for n in r.notices)
    for part, volt in zip(np.split(np.arange(r.rows), jumps + 1), (-1, 0, 1)):
        assert set(r["v_V"][part]) == {volt}
        np.testing.assert_allclose(r["omega_rad_s"][part], volt * np.pi / 2)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.integers(-10**15, 10**15), st.floats(-1e12, 1e12)), min_size=1, max_size=30), st.sampled_from([",", ";", "\t", " "]))
def test_what_was_written_is_read(tmp_path_factory, rows, delimiter):
    path = tmp_path_factory.mktemp("h") / "r.csv"
    path.write_text(delimiter.join(["t_ns", "i_A"]) + "\n" + "".join(f"{t}{delimiter}{v!r}\n" for t, v in rows))
    r = driveid.read(path)
    assert r.t_ns.tolist() == [t for t, _ in rows] and r["i_A"].tolist() == [v for _, v in rows]


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=300))
def test_garbage_gives_one_of_our_errors(tmp_path_factory, blob):
    path = tmp_path_factory.mktemp("g") / "r.csv"
    path.write_bytes(b"t_s,i_A\n" + blob)
    try:
        driveid.read(path)
    except driveid.DriveidError as e:
        assert "r.csv" in str(e)


def test_measured_records(data):
    r = driveid.read(data / "emps" / "emps_train.csv", {"F_N": "force_N", "x_m": "q_meas_m"})
    assert r.rows == 24841 and r.t_ns[1] - r.t_ns[0] == 1_000_000
    assert r["F_N"][0] == 89.2344322 and r["x_m"][1] == 0.0000143
    r = driveid.read(data / "odrive_cogging" / "slow2_nocomp_1.csv", ["theta_rad=pos:counts/8192", "i_A=current_A"])
    assert r["theta_rad"][0] == pytest.approx(8157.97 * 2 * np.pi / 8192, rel=1e-15)
    assert len(driveid.read_all(data / "odrive_cogging" / "accel_spinup_1.csv", ["theta_rad=pos_counts:counts/8192", "i_A=meas_current_A"])) == 8
    r = driveid.read(data / "un_dcmotor" / "DCmotor_static_gain_response.csv", ["v_V=u", "omega_rad_s=y:deg/s"])
    assert any("steady map, 100 points" in n for n in r.notices)

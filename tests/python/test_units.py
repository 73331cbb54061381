# SPDX-License-Identifier: Apache-2.0
"""--map and the units behind it; expected factors are written out by hand."""

import math

import numpy as np
import pytest

import driveid
from driveid import units
from driveid.errors import UsageError


@pytest.mark.parametrize("target, unit, raw, si", [
    ("theta_rad", "counts/8192", 8192, 2 * math.pi), ("theta_rad", "deg", 180, math.pi), ("theta_rad", "°", 90, math.pi / 2),
    ("theta_rad", "turn", 0.5, math.pi), ("theta_rad", "arcsec", 3600, math.pi / 180), ("theta_rad", "cnt/4096", 1024, math.pi / 2),
    ("omega_rad_s", "rpm", 60, 2 * math.pi), ("omega_rad_s", "1/min", 60, 2 * math.pi), ("omega_rad_s", "deg/s", 360, 2 * math.pi),
    ("omega_rad_s", "Hz", 2, 4 * math.pi), ("omega_rad_s", "counts/8192/s", 4096, math.pi), ("omega_rad_s", "counts/s/8192", 4096, math.pi),
    ("i_A", "mA", 1500, 1.5), ("i_q_A", "0.001", 1500, 1.5), ("v_V", "mV", 24000, 24), ("tau_Nm", "mN m", 250, 0.25), ("tau_Nm", "N·cm", 100, 1),
    ("F_N", "kN", 1.2, 1200), ("x_m", "mm", 5, 0.005), ("x_m", "µm", 5, 5e-6), ("x_m", "0.5um", 10, 5e-6), ("v_m_s", "mm/s", 7, 0.007),
    ("T_degC", "K", 293.15, 20), ("T_degC", "degF", 212, 100), ("t_s", "ms", 3, 0.003),
])
def test_conversions(target, unit, raw, si):
    assert units.conversion(unit, target)(raw) == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize("target, unit", [("i_A", "deg"), ("theta_rad", "rpm"), ("x_m", "counts/4096"), ("omega_rad_s", "counts/4096"), ("F_N", "Nm"), ("i_A", "0")])
def test_what_does_not_convert_is_refused_with_a_list(target, unit):
    with pytest.raises(UsageError, match=target):
        units.conversion(unit, target)


def test_headers():
    assert units.split_header("y [deg/s]") == ("y", "deg/s")
    assert units.split_header("Iq (mA)") == ("Iq", "mA")
    assert units.split_header("theta_deg") == ("theta", "deg")
    assert units.split_header("omega_rad_s") == ("omega_rad_s", None)
    assert units.split_header("i_A") == ("i_A", None)
    assert units.split_header("my_strange_ms") == ("my_strange_ms", None)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t_s,Iq,pos,speed [rpm],a:b\n0,1000,0,60,5\n0.001,2000,4096,120,6\n")
    return path


def test_map(table):
    r = driveid.read(table, ["i_q_A=-Iq:mA", "theta_rad=pos:counts/8192", "omega_rad_s=speed", "u=a:b"])
    assert r["i_q_A"].tolist() == [-1, -2]
    np.testing.assert_allclose(r["theta_rad"], [0, np.pi])
    np.testing.assert_allclose(r["omega_rad_s"], [2 * np.pi, 4 * np.pi])
    assert r["u"].tolist() == [5, 6]
    r = driveid.read(table, {"omega_rad_s": "speed:deg/s"})  # the user's word goes before the header's
    np.testing.assert_allclose(r["omega_rad_s"], np.deg2rad([60, 120]))


@pytest.mark.parametrize("maps, words", [
    (["i_A=Iqq"], "Did you mean 'Iq'"), (["ia=Iq"], "is no signal. Did you mean 'i_A'"), (["i_A"], "write NAME=COLUMN"), (["i_A="], "names no column"),
    (["i_A=Iq:rpm"], "does not convert to i_A"), (["i_A=Iq", "i_A=pos"], "given twice"), (["t_s=Iq", "t_ns=pos"], "one time"), (["t_s=-Iq"], "time runs forward"),
])
def test_map_errors(table, maps, words):
    with pytest.raises(UsageError) as e:
        driveid.read(table, maps)
    assert words in str(e.value)


def test_hold_is_one_of_three(table):
    assert driveid.read(table, ["i_A=Iq"], hold="zoh").hold == "zoh"
    with pytest.raises(UsageError, match="average, zoh, instant"):
        driveid.read(table, ["i_A=Iq"], hold="foh")

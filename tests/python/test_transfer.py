# SPDX-License-Identifier: Apache-2.0
"""driveid.lti and driveid.modal: the functions of the C library on numpy arrays. Truth: closed-form responses written here."""

import numpy as np
import pytest

import driveid
from driveid import lti, modal

T = 1e-3
POLES = np.array([-20 + 60j, -20 - 60j])


def steps(seed, n=6000):
    """Held random steps and the exact response of 4000 / (s^2 + 40 s + 4000), by its sampled modes."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.choice([-1.0, 1.0], n // 40), 40)
    residue = 4000 / (POLES - POLES[::-1])
    x, y = np.zeros(2, complex), np.zeros(n)
    step, gain = np.exp(POLES * T), (np.exp(POLES * T) - 1) / POLES
    for k in range(n - 1):
        x = step * x + gain * u[k]
        y[k + 1] = (residue * x).sum().real
    return y, u


def test_fit_finds_poles_with_intervals():
    inside = 0
    for seed in range(20):
        y, u = steps(seed)
        g = lti.fit(y + 0.05 * np.random.default_rng(100 + seed).standard_normal(len(y)), u, T, order=2, zeros=0, method="oe")
        assert g.converged and abs(g.a[0] / 4000 - 1) < 0.02
        modes = g.modes()
        inside += abs(modes.omega_rad_s[0] - abs(POLES[0])) <= modes.omega_half[0]
        assert g.half.shape == (3,) and abs(modes.gain - 1) < 3 * modes.gain_half
    assert inside >= 16  # 95 % of 20; fewer than 16 has a chance of 0.03 %


@pytest.mark.parametrize("method", ["ls", "tls", "iv", "srivc", "oe"])
def test_every_method_is_exact_without_noise(method):
    y, u = steps(3, 1600)
    for every in (1, 2, 10):  # T = 1, 2 and 10 ms
        g = lti.fit(y[::every], u[::every], T * every, order=2, method=method)
        assert g.converged
        np.testing.assert_allclose([*g.a, g.b[0]], [4000, 40, 4000], rtol=1e-6)
        assert abs(g.b[1]) < 1e-6 * 4000 / 63


def test_search_takes_order_and_delay():
    y, u = steps(1)
    late = y[193:-7] + 0.01 * np.random.default_rng(2).standard_normal(len(y) - 200)  # seven samples, in the middle of a run
    g = lti.search(late, u[200:], T, order_max=3, zeros_max=1, delay_max=10)
    assert (g.order, g.delay) == (2, 7)


def test_forms_and_back():
    g = lti.TransferFunction.of([4000, 40], [4000], T)
    az, bz = g.to_z()
    np.testing.assert_allclose(np.roots([1, *az[::-1]]), np.exp(POLES * T), rtol=1e-9)
    back = lti.TransferFunction.from_z(az, bz, T)
    np.testing.assert_allclose(back.a, g.a, rtol=1e-6)
    Aq, Bq = g.to_q()
    W = 2 / T
    np.testing.assert_allclose(np.sort_complex(np.roots([*Aq[::-1], 1])), np.sort_complex(W * np.tanh(POLES / W)), rtol=1e-6)
    w = np.array([1.0, 63.0, 500.0])
    np.testing.assert_allclose(g.frequency(w), 4000 / ((1j * w) ** 2 + 40 * (1j * w) + 4000), rtol=1e-12)


def test_controller_for_the_plant():
    g = lti.TransferFunction.of([4000, 4], [4000], T)  # rings: zeta 0.03
    c = lti.design(g, T, phase_margin_deg=60)
    assert len(c.notches) == 1 and c.sections().shape == (2, 5)
    m, s = c.margins(g), c.step(g, 5000)
    assert m.stable and m.phase_margin_deg >= 59.5 and m.gain_margin_db >= 6
    assert abs(s.y[-1] - 1) < 0.02 and s.overshoot_percent < 25
    L = c.open_loop(g, [m.crossover_rad_s])[0]
    assert abs(abs(L) - 1) < 1e-6 and abs(180 + np.degrees(np.angle(L)) - m.phase_margin_deg) < 1e-6
    with pytest.raises(driveid.UsageError, match="at most .* degrees: ask for a slower one"):
        lti.design(g, T, crossover_rad_s=900)


def test_modal_parameters_hold_for_every_initial_state():
    a = np.array([52.0, 30.0, 4.0])  # poles -2, -1 +- 5j
    poles, Ts, shift = np.array([-2, -1 + 5j, -1 - 5j]), np.pi / 420, [40, 80, 120]
    p = modal.parameters_from_a(a, Ts, shift, derivatives=3)
    np.testing.assert_allclose(modal.a(p), a, rtol=1e-6)
    random = np.random.default_rng(3)
    y = np.array([(c * np.exp(poles * k * Ts)).sum().real for c in [random.standard_normal(1) + np.array([1, 0.5 + 1j, 0.5 - 1j])] for k in range(600)])
    found, _ = modal.parameters(y, Ts, shift, windows=[(120, 500)], stride=10)
    np.testing.assert_allclose(found[0], p[0], rtol=1e-6)
    exponents, condition = modal.prony(y, 3, Ts, lag=40, equations=12)
    np.testing.assert_allclose(np.sort_complex(exponents), np.sort_complex(poles), rtol=1e-6)
    assert condition > 1
    free, roots = modal.free_response(y, Ts, [40, 80, 120], start=120, block=20, hop=20, blocks=20, untustin=False)
    np.testing.assert_allclose(np.sort_complex(roots), np.sort_complex(poles), rtol=1e-4)


def test_the_rest_of_the_modal_functions():
    """H = (6.5 s + 52)/(s^3 + 4 s^2 + 30 s + 52), responses by residues; every function of modal.h answers in Python."""
    a, numerator, poles, Ts, hold = np.array([52.0, 30, 4]), np.array([6.5, 52]), np.array([-2, -1 + 5j, -1 - 5j]), 0.01, 20
    shift = [hold, 2 * hold, 3 * hold]
    residue = np.array([np.polyval(numerator, s) / np.prod(s - poles[poles != s]) for s in poles])
    t = np.arange(400) * Ts
    g = 1.0 + (residue / poles * np.exp(np.outer(t, poles))).sum(1).real
    p = modal.parameters_from_a(a, Ts, shift, derivatives=3)
    Q = modal.observer(p[:3], hold, g)
    assert Q.shape == (3, 4) and abs(Q[0, 1] - 0.145541) < 1e-6 and abs(modal.observer(p[:3], hold, g, phase=10)[2, 3] - 0.16255) < 1e-5
    np.testing.assert_allclose(modal.state_input(p, hold, g), [0, 6.5, 26], atol=1e-8)
    with pytest.raises((ValueError, driveid.DriveidError)):
        modal.state_input(p, hold, g[:50])
    h = modal.impulse_response(3, g, Ts, hold=hold, period=192, functions=6, count=100)
    np.testing.assert_allclose(h, (residue * np.exp(np.outer(t[:100], poles))).sum(1).real, atol=5e-3)
    levels = [1, 1, 2, 2, -1, -1, 0, 0, 1, 2, 1, -2]
    y = sum(np.concatenate([np.zeros(hold * k), g])[:240] * (v - w) for k, (v, w) in enumerate(zip(levels, [0, *levels])))
    np.testing.assert_allclose(modal.step_response(y, hold, levels, p[0], 200), g[:200], atol=1e-8)
    # one tone, so two modes: b from q of all derivatives, and H(j4)
    H, A_c = np.polyval(numerator, 4j) / np.polyval([1, 4, 30, 52], 4j), np.array([[0, 4.0], [-4, 0]])
    phase = np.arange(700) * 2 * np.pi / 400
    step = 2 * np.pi / 400 / 4
    q = np.array([H * ((4j) ** j + (row * np.exp(-4j * np.array(shift) * step)).sum()) for j, row in enumerate(modal.parameters_from_a(a, step, shift, derivatives=3))])
    np.testing.assert_allclose(modal.b(a, 1, [(A_c, [1, 0], np.column_stack([q.real, q.imag]))]), numerator[::-1], rtol=1e-8)
    p_o = modal.parameters_from_a(a, step, shift)[0]
    np.testing.assert_allclose(modal.frequency_response(np.real(-1j * H * np.exp(1j * phase)), np.sin(phase), step, shift, (100, 500), p_o, [4.0]), [H], rtol=1e-6)
    # two tones: a and b from output modal functions alone
    def tone(w):
        gain = np.polyval(numerator, 1j * w) / np.polyval([1, 4, 30, 52], 1j * w) * (1 + (p_o * np.exp(-1j * w * np.array(shift) * step)).sum())
        return np.array([[0, w], [-w, 0]]), np.array([1.0, 0]), np.array([gain.real, gain.imag])
    found_a, found_b = modal.ab(step, shift, np.tile(p_o, (3, 1)), [tone(2.0), tone(4.0), tone(6.0)])
    np.testing.assert_allclose(found_a, a, rtol=1e-6)
    np.testing.assert_allclose(found_b, [52, 6.5, 0], atol=1e-5)
    np.testing.assert_allclose(modal.deflate(np.polymul([1, 4, 30, 52], [1, 0, 16])[::-1][:5], [16, 0]), a, rtol=1e-9)
    taps = modal.prefilter(A_c, [1, 1], step, [30, 60])
    np.testing.assert_allclose((np.sin(phase) + np.cos(phase))[60:] + sum(l * (np.sin(phase) + np.cos(phase))[60 - d:len(phase) - d] for l, d in zip(taps, (30, 60))), 0, atol=1e-12)


@pytest.mark.parametrize("call", [
    lambda: lti.fit(np.zeros(5), np.zeros(4), T, order=1),
    lambda: lti.fit(np.zeros(50), np.zeros(50), T, order=1),
    lambda: lti.fit(np.zeros(50), np.zeros(50), T, order=1, method="magic"),
    lambda: lti.fit(np.ones(50), np.ones(50), T, order=1, hold="sometimes"),
    lambda: lti.TransferFunction.of([1] * 9, [1], T),
    lambda: lti.Controller(T, 1, 1, [(1, 1, 1)] * 5),
    lambda: modal.a(np.zeros((3, 3))),
    lambda: modal.parameters(np.zeros(50), T, [60], windows=[(0, 40)]),
    lambda: modal.b([1, 2], 1, [(np.eye(2), np.ones(2), np.ones(5))]),
])
def test_refusals_are_usage_errors(call):
    with pytest.raises(driveid.UsageError):
        call()

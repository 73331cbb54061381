# SPDX-License-Identifier: Apache-2.0
"""driveid.discrete: the function of discrete.h. Truth: the sampled response of a damped oscillator by its modes, written here."""

import numpy as np
import pytest

import driveid
from driveid import discrete

T = 0.01
POLES = np.array([-3 + 8j, -3 - 8j])


def record(periods: int, noise: float = 0.0, seed: int = 1):
    """Held steps and the exact response of 73 / (s^2 + 6 s + 73)."""
    random = np.random.default_rng(seed)
    u = np.repeat(random.choice([-1.0, 1.0], periods), 20)
    residue, step = 73 / (POLES - POLES[::-1]), np.exp(POLES * T)
    x, y = np.zeros(2, complex), np.zeros(len(u))
    for k in range(len(u) - 1):
        x = step * x + (step - 1) / POLES * u[k]
        y[k + 1] = (residue * x).sum().real
    return y + noise * random.standard_normal(len(y)), u


def test_z_finds_the_difference_equation():
    y, u = record(10)
    found = discrete.identify(y, u, T, order=2, domain="z")
    np.testing.assert_allclose(found.a, np.poly(np.exp(POLES * T)).real[:0:-1], rtol=1e-7)
    assert found.blocks == 1 and found.b.shape == (2,) and np.all(np.isinf(found.a_interval))


def test_q_finds_the_poles_with_intervals():
    """Tustin's poles W tanh(s/W); blocks of 200 samples, the interval of the mean from their scatter."""
    q_poles = 2 / T * np.tanh(POLES * T / 2)
    truth = (np.poly(q_poles) / np.poly(q_poles)[-1]).real[1::-1]
    inside = 0
    for seed in range(20):
        y, u = record(200, noise=2e-4, seed=seed)
        found = discrete.identify(y, u, T, order=2, zeros=1, block=200)
        assert found.blocks == sum(np.ptp(u[k:k + 200]) > 0 for k in range(0, len(u), 200))  # a block of one input value cannot tell B~_1: it is dropped
        np.testing.assert_allclose(found.a, truth, rtol=0.02)
        inside += found.a_interval[0, 0] <= truth[0] <= found.a_interval[1, 0]
    assert inside >= 15  # 95 % of 20: fewer than 15 has a chance of 0.03 %
    y, u = record(100)
    np.testing.assert_allclose(discrete.identify(y, u, T, order=2, zeros=1, block=500).a, truth, rtol=1e-6)


def test_refusals():
    y, u = record(10)
    with pytest.raises(driveid.UsageError, match="domain"):
        discrete.identify(y, u, T, order=2, domain="s")
    with pytest.raises(driveid.UsageError, match="skipped"):
        discrete.identify(y, u, T, order=2, skipped=1)
    with pytest.raises(driveid.UsageError, match="order"):
        discrete.identify(y, u, T, order=9)
    with pytest.raises(driveid.UsageError, match="rows"):
        discrete.identify(y, u[:-1], T, order=2)
    for domain, value in (("z", 1.0), ("q", 0.0)):
        with pytest.raises(driveid.DataError, match="tells the coefficients apart"):
            discrete.identify(np.full(200, value), np.full(200, value), T, order=2, domain=domain)

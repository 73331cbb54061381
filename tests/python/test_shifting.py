# SPDX-License-Identifier: Apache-2.0
"""Frequency shifting's full form from Python: an oscillator with its initial conditions; a sinusoid with bias and no input; refusals."""
import dataclasses

import numpy as np
import pytest

import driveid
from driveid import shifting


def oscillator(t, w=14.2, zeta=0.07, y0=0.4, v0=0.3, gain=0.0106, u=4.0):
    decay, wd = zeta * w, w * np.sqrt(1 - zeta**2)
    a, rest = y0 - gain * u, gain * u
    return rest + np.exp(-decay * t) * (a * np.cos(wd * t) + (v0 + decay * a) / wd * np.sin(wd * t))


def test_oscillator_and_its_initial_conditions():
    t = np.arange(1001) * 1e-3
    settings = shifting.suggest(order=2, zeros=0, dt_s=1e-3, bandwidth_rad_s=14.2)
    found = shifting.identify(t, oscillator(t), np.full_like(t, 4.0), settings)
    a1 = 2 * 0.07 * 14.2
    assert found.a == pytest.approx([14.2**2, a1], rel=1e-4)  # the straight line between samples costs 1e-5
    assert found.b == pytest.approx([0.0106 * 14.2**2], rel=1e-4)
    assert found.c == pytest.approx([0.3 + a1 * 0.4, 0.4], rel=1e-3)
    noisy = oscillator(t) + 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    again = shifting.identify(t, noisy, np.full_like(t, 4.0), shifting.suggest(order=2, zeros=0, dt_s=1e-3, bandwidth_rad_s=14.2, noise=0.01))
    assert again.a[0] == pytest.approx(14.2**2, rel=0.02)


def test_sinusoid_with_bias():
    """The paper's Example 1: y''' + 25 y' = 0."""
    t = np.arange(2001) * 1e-3
    settings = shifting.suggest(order=3, zeros=None, dt_s=1e-3, bandwidth_rad_s=5, known_zero=(0, 2))
    found = shifting.identify(t, 0.2 * np.sin(5 * t + 1) + 0.1, None, settings)
    assert found.a == pytest.approx([0, 25, 0], rel=1e-4, abs=1e-12)


def test_refusals():
    with pytest.raises(driveid.UsageError, match="sample"):
        shifting.suggest(order=2, dt_s=0.1, bandwidth_rad_s=30)
    with pytest.raises(driveid.UsageError, match="order"):
        shifting.suggest(order=7, dt_s=1e-3, bandwidth_rad_s=30)
    settings = shifting.suggest(order=2, dt_s=1e-3, bandwidth_rad_s=30)
    for wrong in ({"order": 258}, {"order": 0}, {"zeros": 256}, {"zeros": -5}):  # not what is left of them in eight bits
        with pytest.raises(driveid.UsageError, match="order"):
            shifting.identify(np.arange(500) * 1e-3, np.zeros(500), np.zeros(500), dataclasses.replace(settings, **wrong))
    with pytest.raises(driveid.UsageError, match="input"):
        shifting.identify([0, 1e-3], [0, 0], None, settings)
    with pytest.raises(driveid.DataError, match="apart"):
        shifting.identify(np.arange(500) * 1e-3, np.zeros(500), np.zeros(500), settings)

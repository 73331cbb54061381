# SPDX-License-Identifier: Apache-2.0
"""The frequencies of a signal of one or two sinusoids with bias, and the sinusoid to excite a resonance with.

    found = driveid.sinusoids.frequencies(record, "theta_rad")           # vibration, torque ripple; a fraction of a period is enough
    found[0].omega_rad_s, found[0].interval
    plan = driveid.sinusoids.excitation(omega_0_rad_s=60, zeta=0.02, amplitude=5, sigma=1e-4, dt_s=1e-3, span_s=2)
    plan.omega_rad_s, plan.omega_0_sd

The functions of frequency.h and excitation.h.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import _core
from .errors import DataError, UsageError, asking
from .records import Record

METHODS = ("window", "fsm", "discrete")  # the others are biased by noise (frequency.h)


@dataclass(frozen=True)
class Frequency:
    """Value with its 95 % interval."""

    omega_rad_s: float
    interval: tuple[float, float]

    @property
    def f_Hz(self) -> float:
        return self.omega_rad_s / (2 * math.pi)


def frequencies(record: Record, signal: str, sinusoids: int = 1, *, highest_rad_s: float | None = None, method: str = "window") -> list[Frequency]:
    """Rising. highest_rad_s: the highest one expected, it sets the filters; else where the spectrum has its peaks."""
    if sinusoids not in (1, 2):
        raise UsageError(f"sinusoids is 1 or 2, not {sinusoids}")
    if method not in METHODS:
        raise UsageError(f"method is one of {', '.join(METHODS)}, not {method!r}")
    if signal not in record.columns:
        raise UsageError(f"{record.name} has no column {signal!r}; it has {', '.join(record.columns)}")
    y = np.ascontiguousarray(record[signal], dtype=np.float64)
    steps = np.diff(record.t_ns)
    if len(y) < 20 or not np.isfinite(y).any():
        raise DataError(f"{record.name}: at least 20 samples of {signal} are needed")
    dt_s = float(np.median(steps)) * 1e-9
    highest = highest_rad_s or _peak(y, dt_s, sinusoids)
    if not 0 < highest < math.pi / dt_s:
        raise UsageError(f"the highest frequency must lie between 0 and half of the sampling rate, {math.pi / dt_s:.6g} rad/s")
    y = y - np.nanmean(y)  # a bias is no matter to the method, but to its digits
    with asking(bandwidth_rad_s="highest_rad_s (--highest)"):
        status, found = _core.frequencies(record.t_ns - record.t_ns[0], y, sinusoids, highest, dt_s, method)
    if not found:
        raise DataError(f"{record.name}: {signal} does not show {'a sinusoid' if sinusoids == 1 else 'two sinusoids'} ({_core.status_text(status)}): record longer, or with less noise")
    return [Frequency(w, (lo, hi)) for w, lo, hi in found]


def _peak(y: np.ndarray, dt_s: float, sinusoids: int) -> float:
    """The highest of the strongest peaks of the spectrum, as a starting value."""
    whole = np.where(np.isfinite(y), y, np.nanmean(y))
    at = np.arange(len(whole))
    whole = whole - np.polyval(np.polyfit(at, whole, 1), at)
    power = np.abs(np.fft.rfft(whole * np.hanning(len(whole)))) ** 2
    tops = [k for k in range(1, len(power) - 1) if power[k] >= power[k - 1] and power[k] > power[k + 1]] or [1]
    strongest = sorted(tops, key=lambda k: -power[k])[:sinusoids]
    return 2 * math.pi * max(strongest) / (len(whole) * dt_s)


@dataclass(frozen=True)
class Excitation:
    """The frequency to take; relative standard deviations that no unbiased estimator goes below, there and over the ratio to omega_0."""

    omega_rad_s: float
    ratio: float
    omega_0_sd: float
    zeta_sd: float | None
    ratios: np.ndarray
    omega_0_sds: np.ndarray


def excitation(*, omega_0_rad_s: float, zeta: float, amplitude: float, sigma: float, dt_s: float, span_s: float) -> Excitation:
    """x'' + 2 zeta omega_0 x' + omega_0^2 x = amplitude sin(omega t), x read with white noise of standard deviation sigma for span_s seconds."""
    with asking():
        core = _core.Excitation(omega_0_rad_s=omega_0_rad_s, zeta=zeta, amplitude=amplitude, sigma=sigma, dt_s=dt_s, span_s=span_s)
        ratio, least = core.suggest()
        ratios = np.geomspace(0.25, 4, 25)
        return Excitation(ratio * omega_0_rad_s, ratio, least, core.bound(ratio)[1] if zeta > 0 else None, ratios, np.array([core.bound(r)[0] for r in ratios]))

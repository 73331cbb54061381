# SPDX-License-Identifier: Apache-2.0
"""Transfer functions from records: fit, order and delay search, poles and damping with intervals, s, z and q forms, a controller for them.

    plant = driveid.lti.search(y, u, T_s=1e-3, order_max=4)
    plant.modes().omega_rad_s
    controller = driveid.lti.design(plant, T_s=1e-3, phase_margin_deg=60)
    controller.step(plant, 2000).overshoot_percent

The functions of lti.h and control.h, on numpy arrays. Errors are UsageError with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import _core
from .errors import asking

HOLDS = {"zoh": True, "instant": False}


def _f64(values) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=np.float64)


def _zoh(hold: str) -> bool:
    with asking():
        if hold not in HOLDS:
            raise ValueError(f'hold of u is "zoh" or "instant", not {hold!r}')
    return HOLDS[hold]


@dataclass(frozen=True)
class Modes:
    """Poles and zeros in rad/s by magnitude; natural frequencies and damping ratios with half of their 95 % interval."""

    poles: np.ndarray
    zeros: np.ndarray
    omega_rad_s: np.ndarray
    omega_half: np.ndarray
    zeta: np.ndarray
    zeta_half: np.ndarray
    gain: float
    gain_half: float


class TransferFunction:
    """y^(n) + sum a_i y^(i) = sum b_j u^(j)(t - delay T_s); a_0 and b_0 first, the leading 1 left out."""

    def __init__(self, core: _core.Lti):
        self._core = core
        self.a, self.b, self.cov = core.a, core.b, core.cov
        self.order, self.delay, self.T_s = core.order, core.delay, core.T_s
        self.noise_sd, self.fit_percent, self.bic = core.noise_sd, core.fit_percent, core.bic
        self.iterations, self.converged = core.iterations, core.converged

    @classmethod
    def of(cls, a, b, T_s: float, delay: int = 0) -> TransferFunction:
        with asking():
            return cls(_core.lti_of(_f64(a), _f64(b), T_s, delay))

    @classmethod
    def from_z(cls, az, bz, T_s: float) -> TransferFunction:
        """From the held-input form (z^n + sum az_i z^i) y = (sum bz_i z^i) u."""
        with asking():
            return cls(_core.lti_from_z(_f64(az), _f64(bz), T_s))

    @property
    def half(self) -> np.ndarray:
        """Half of the 95 % intervals of (a, b)."""
        return 1.96 * np.sqrt(np.maximum(0.0, np.diag(self.cov)))

    def modes(self) -> Modes:
        with asking():
            return Modes(**self._core.modes())

    def frequency(self, omega_rad_s) -> np.ndarray:
        """H(j omega), delay included."""
        with asking():
            return self._core.frequency(_f64(omega_rad_s))

    def to_z(self, T_s: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        with asking():
            return self._core.to_z(T_s or self.T_s)

    def to_q(self, T_s: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """A_1 .. A_n and B_0 .. B_n in the Tustin plane, A(0) = 1."""
        with asking():
            return _core.lti_z_to_q(*self.to_z(T_s), T_s or self.T_s)

    def __repr__(self):
        return f"TransferFunction(a={np.array2string(self.a, precision=5)}, b={np.array2string(self.b, precision=5)}, delay={self.delay} x {self.T_s:g} s)"


def fit(y, u, T_s: float, *, order: int, zeros: int | None = None, delay: int = 0, method: str = "srivc", hold: str = "zoh",
        initial_conditions: bool = True, bandwidth_rad_s: float = 0.0) -> TransferFunction:
    """One order by "ls", "tls", "iv", "srivc" or "oe". zeros: degree of the numerator (default order - 1); delay in samples."""
    with asking():
        return TransferFunction(_core.lti_fit(_f64(y), _f64(u), T_s, order, order - 1 if zeros is None else zeros, delay, _zoh(hold), initial_conditions, method, bandwidth_rad_s))


def search(y, u, T_s: float, *, order_max: int = 4, zeros_max: int | None = None, delay_max: int = 0, method: str = "srivc", hold: str = "zoh",
           initial_conditions: bool = True, bandwidth_rad_s: float = 0.0) -> TransferFunction:
    """The smallest order, numerator and delay that the record supports (BIC)."""
    with asking():
        return TransferFunction(_core.lti_search(_f64(y), _f64(u), T_s, order_max, order_max - 1 if zeros_max is None else zeros_max, delay_max, _zoh(hold), initial_conditions, method, bandwidth_rad_s))


@dataclass(frozen=True)
class Margins:
    crossover_rad_s: float
    phase_margin_deg: float
    phase_crossover_rad_s: float
    gain_margin_db: float
    stable: bool


@dataclass(frozen=True)
class Step:
    """Closed-loop output, sample by sample, to a unit step of the reference."""

    y: np.ndarray
    t90_s: float
    overshoot_percent: float
    settling_s: float


class Controller:
    """R(q) = gain (1 + q/zero)/q times notches (omega, damping compensated, damping put in its place), in the Tustin plane of T_s."""

    def __init__(self, T_s: float, gain: float, zero_rad_s: float, notches=()):
        with asking():
            self._core = _core.Controller(T_s, gain, zero_rad_s, [tuple(map(float, n)) for n in notches])
        self.T_s, self.gain, self.zero_rad_s, self.notches = T_s, gain, zero_rad_s, self._core.notches

    def sections(self) -> np.ndarray:
        """[1 + notches, 5]: b0, b1, b2, a1, a2 of each difference equation, the PI term first."""
        with asking():
            return self._core.sections()

    def open_loop(self, plant: TransferFunction, Omega_rad_s) -> np.ndarray:
        with asking():
            return self._core.frequency(plant._core, _f64(Omega_rad_s))

    def margins(self, plant: TransferFunction) -> Margins:
        with asking():
            return Margins(*self._core.margins(plant._core))

    def step(self, plant: TransferFunction, count: int) -> Step:
        with asking():
            return Step(*self._core.step(plant._core, count))

    def __repr__(self):
        return f"Controller(T_s={self.T_s:g}, gain={self.gain:.5g}, zero_rad_s={self.zero_rad_s:.5g}, notches={[tuple(round(v, 5) for v in n) for n in self.notches]})"


def design(plant: TransferFunction, T_s: float, *, phase_margin_deg: float = 60, crossover_rad_s: float = 0, notch_below_zeta: float = 0.3,
           notch_widen: float = 1.5) -> Controller:
    """Notch and PI by loop shaping; crossover_rad_s = 0: the fastest with the phase margin and 6 dB of gain margin."""
    with asking():
        c = _core.loop_design(plant._core, T_s, phase_margin_deg, crossover_rad_s, notch_below_zeta, notch_widen)
    return Controller(c.T_s, c.gain, c.zero_rad_s, c.notches)

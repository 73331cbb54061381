# SPDX-License-Identifier: Apache-2.0
"""Modal functions (El-Shafey 1987): a linear system from its output and the modes of its input, free of initial conditions; and Prony.

The functions of modal.h on numpy arrays; shifts, windows and blocks in samples. What each computes and its equation stand in that header.
"""

from __future__ import annotations

import numpy as np

from . import _core
from .errors import asking


def _f64(values) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=np.float64)


def _experiments(given):
    return [(_f64(A_c), _f64(c_c), _f64(q).ravel()) for A_c, c_c, q in given]


def parameters(y, T_s: float, shift, *, mode=None, windows, basis: str = "samples", functions: int = 0, quadrature: str = "simpson", stride: int = 1,
               instrument: int = 0, derivatives: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """p [derivatives + 1, order], q [derivatives + 1, modes]. mode [rows, modes]; windows [(first, last)]; basis "samples", "fourier" or "walsh"."""
    with asking():
        return _core.modal_parameters(_f64(y), T_s, list(shift), None if mode is None else _f64(mode), list(windows), basis, functions, quadrature, stride, instrument, derivatives)


def parameters_from_a(a, T_s: float, shift, derivatives: int = 0) -> np.ndarray:
    """The true modal parameters of a known characteristic polynomial, a_0 first."""
    with asking():
        return _core.modal_parameters_from_a(_f64(a), T_s, list(shift), derivatives)


def prefilter(A_c, c_c, T_s: float, shift) -> np.ndarray:
    """The filter that annihilates the modes (A_c, c_c) at the shifts."""
    with asking():
        return _core.modal_prefilter(_f64(A_c), _f64(c_c), T_s, list(shift))


def a(p) -> np.ndarray:
    """a from p [order + 1, order] (Theorem 4.1)."""
    with asking():
        return _core.modal_a(_f64(p))


def b(a, zeros: int, experiments) -> np.ndarray:
    """b_0 .. b_zeros from a and experiments [(A_c, c_c, q [order + 1, modes])] (Theorem 4.2)."""
    with asking():
        return _core.modal_b(_f64(a), zeros, _experiments(experiments))


def ab(T_s: float, shift, p_o, experiments) -> tuple[np.ndarray, np.ndarray]:
    """a and b from output modal functions alone: p_o [experiments, order], experiments [(A_c, c_c, q_o [modes])]."""
    with asking():
        return _core.modal_ab(T_s, list(shift), _f64(p_o), _experiments(experiments))


def free_response(y, T_s: float, shift, *, start: int, block: int, hop: int, blocks: int, quadrature: str = "simpson", untustin: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """a and the poles from a free response (Theorem 4.3)."""
    with asking():
        return _core.modal_free_response(_f64(y), T_s, list(shift), start, block, hop, blocks, quadrature, untustin)


def deflate(a_aug, a_c) -> np.ndarray:
    """A known controller divided out of an augmented characteristic polynomial."""
    with asking():
        return _core.modal_deflate(_f64(a_aug), _f64(a_c))


def frequency_response(y, u, T_s: float, shift, window: tuple[int, int], p_o, omega_rad_s) -> np.ndarray:
    """H(j omega) from filtered samples over one period."""
    with asking():
        return _core.modal_frequency_response(_f64(y), _f64(u), T_s, list(shift), tuple(window), _f64(p_o), _f64(omega_rad_s))


def step_response(y, hold: int, u_level, p_o, count: int) -> np.ndarray:
    """Every sample of the step response from an output driven by inputs held over `hold` samples."""
    with asking():
        return _core.modal_step_response(_f64(y), hold, _f64(u_level), _f64(p_o), count)


def impulse_response(order: int, g, T_s: float, *, hold: int, period: int, functions: int, count: int) -> np.ndarray:
    """Impulse response from a step response g."""
    with asking():
        return _core.modal_impulse_response(order, _f64(g), T_s, hold, period, functions, count)


def observer(p, hold: int, g, phase: int = 0) -> np.ndarray:
    """Q [order, order + 1] of the minimum-time observer x = -P y + Q u, P = p [order, order]."""
    with asking():
        return _core.modal_observer(_f64(p), hold, _f64(g), phase)


def state_input(p, hold: int, g) -> np.ndarray:
    """Input vector b~ of the state model from p [order + 1, order] and the step response g."""
    with asking():
        return _core.modal_state_input(_f64(p), hold, _f64(g))


def prony(y, order: int, T_s: float, *, lag: int = 1, equations: int) -> tuple[np.ndarray, float]:
    """Complex exponents of y by linear prediction, and the condition of the prediction matrix."""
    with asking():
        return _core.prony(order, _f64(y), T_s, lag, equations)

# SPDX-License-Identifier: Apache-2.0
"""Frequency shifting in its full form: an n-th order equation from its first fraction of a time constant on, initial conditions and all.

    settings = driveid.shifting.suggest(order=2, zeros=0, dt_s=1e-3, bandwidth_rad_s=14, noise=0.01)
    found = driveid.shifting.identify(t_s, y, u, settings)       # y'' + a1 y' + a0 y = b0 u
    found.a, found.b, found.c                                    # c: the initial conditions' polynomial

The functions of fsm.h. For running on and on take a gateway, or driveid.online: the economical form of the same method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import _core
from .errors import DataError, UsageError, asking

HOLDS = {"straight": 0, "held": 1, "average": 2}  # what lies between two samples


@dataclass(frozen=True)
class Settings:
    """zeros: m of u's highest derivative, None: no input. known_zero: indices i of coefficients a_i that are known to be zero."""

    order: int
    zeros: int | None
    poles_rad_s: tuple[float, ...]
    q_per_s: float
    known_zero: tuple[int, ...] = ()


@dataclass(frozen=True)
class Found:
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    condition: float


def _mask(known_zero: Sequence[int]) -> int:
    return sum(1 << i for i in set(known_zero))


def suggest(*, order: int, zeros: int | None = 0, dt_s: float, bandwidth_rad_s: float, noise: float = 0.0, known_zero: Sequence[int] = ()) -> Settings:
    """Poles and q from the sample time, the band of what is to be identified, and the noise of y over its rms."""
    if not 1 <= order <= 6 or not (zeros is None or 0 <= zeros <= order) or any(not 0 <= i < order for i in known_zero):
        raise UsageError("order is 1 to 6, zeros 0 to order or None, known_zero indices below order")
    with asking():
        poles, q = _core.shifting_suggest(order, -1 if zeros is None else zeros, _mask(known_zero), dt_s, bandwidth_rad_s, noise)
    return Settings(order, zeros, tuple(poles), q, tuple(known_zero))


def identify(t_s, y, u, settings: Settings, *, hold_y: str = "straight", hold_u: str = "held") -> Found:
    """The whole record; u is None where there is no input."""
    for hold in (hold_y, hold_u):
        if hold not in HOLDS:
            raise UsageError(f"a hold is one of {', '.join(HOLDS)}, not {hold!r}")
    if (u is None) != (settings.zeros is None):
        raise UsageError("settings.zeros is None where there is no input u, and only there")
    t_ns = np.ascontiguousarray(np.rint((np.asarray(t_s, dtype=np.float64)) * 1e9), dtype=np.int64)
    y = np.ascontiguousarray(y, dtype=np.float64)
    u = np.zeros_like(y) if u is None else np.ascontiguousarray(u, dtype=np.float64)
    with asking():
        status, a, b, c, condition = _core.shifting_identify(t_ns, y, u, settings.order, -1 if settings.zeros is None else settings.zeros, _mask(settings.known_zero),
                                                             HOLDS[hold_y], HOLDS[hold_u], list(settings.poles_rad_s), settings.q_per_s)
    if status:
        raise DataError(f"the record does not tell the coefficients apart ({_core.status_text(status)}): record longer, or with more motion")
    return Found(np.array(a), np.array(b), np.array(c), condition)

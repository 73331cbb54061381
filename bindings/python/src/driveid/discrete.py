# SPDX-License-Identifier: Apache-2.0
"""Discrete-time algebraic identification (Fliess et al. 2006) in the z or q domain, block by block, free of initial conditions.

    found = driveid.discrete.identify(y, u, T_s, order=5, zeros=4, kept=0)     # q, reduced numerator: the steady choice under noise
    found.a                                                                    # A_1 .. A_5 of 1 + sum A_i q^i

The functions of discrete.h on numpy arrays; order to 8. On line, in a gateway, the same idea is the method "discrete" (or "window").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import _core
from .errors import DataError, UsageError, asking


@dataclass(frozen=True)
class Found:
    """Mean over the blocks and its 95 % interval [2, n], infinite before the third block. z: a_0 .. a_(n-1) with a_n = 1; q: A_1 .. A_n with A_0 = 1. b: the kept numerator."""

    a: np.ndarray
    b: np.ndarray
    a_interval: np.ndarray
    b_interval: np.ndarray
    blocks: int


def identify(y, u, T_s: float, *, order: int, zeros: int | None = None, kept: int | None = None, domain: str = "q", block: int | None = None, skipped: int | None = None, extra: int = 10,
             gamma: float = 1.0) -> Found:
    """zeros: m, order - 1 where None; kept: of them really estimated, all where None; block: samples, the whole record where None; skipped, extra: alpha, beta of the over-determined rows;
    gamma below 1: forgetting sums (z only)."""
    if domain not in ("z", "q"):
        raise UsageError(f'domain is "z" or "q", not {domain!r}')
    y, u = (np.ascontiguousarray(x, dtype=np.float64) for x in (y, u))
    zeros = order - 1 if zeros is None else zeros
    with asking():
        status, blocks, _, mean, lo, hi = _core.discrete_identify(y, u, domain == "q", order, zeros, zeros if kept is None else kept, order + 2 if skipped is None else skipped, extra,
                                                                  len(y) if block is None else block, T_s, gamma)
    if status:
        raise DataError(f"no block of the record tells the coefficients apart ({_core.status_text(status)}): the input must move inside a block, and the record must hold one")
    mean, interval = np.array(mean), np.array([lo, hi])
    return Found(mean[:order], mean[order:], interval[:, :order], interval[:, order:], blocks)

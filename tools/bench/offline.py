# SPDX-License-Identifier: Apache-2.0
"""Off-line methods beside scipy and numpy, and how their cost grows with order and record length. Writes docs/benchmark-offline.md.

    pip install 'driveid[bench]' && python tools/bench/offline.py > docs/benchmark-offline.md

scipy's output error is Gauss-Newton by least_squares over (a, b), the plant discretised exactly and run by lfilter, from the same least-squares start; numpy's Prony is one lstsq and one roots."""

from __future__ import annotations

import time

import numpy as np
from driveid import lti, modal
from scipy import optimize, signal

T = 1e-2
READING = """Read it so: scipy's fit is sparing at low order and long records, where one lfilter over everything is cheap (ours is up to four times slower there); at order 6 it ends in a wrong minimum from the same start, and ours does not. Both grow in proportion to the record. Our plain least squares grows faster than the record and is no starting point for 100,000 rows: take SRIVC, which is also unbiased."""


def plant(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Monic denominator (highest first) of resonances at 3, 7, 13 rad/s, gain one."""
    den = np.array([1.0])
    for w in (3.0, 7.0, 13.0)[: order // 2]:
        den = np.polymul(den, [1, 0.2 * w, w * w])
    return den, den[-1:]


def data(order: int, rows: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(order)
    u = np.repeat(rng.choice([-1.0, 1.0], rows // 20 + 1), 20)[:rows]
    den, num = plant(order)
    b, a, _ = signal.cont2discrete((num, den), T)
    y = signal.lfilter(b.ravel(), a, u)
    return y + 0.02 * y.std() * rng.standard_normal(rows), u


def run(den: np.ndarray, num: float, u: np.ndarray) -> np.ndarray:
    b, a, _ = signal.cont2discrete(([num], den), T)
    return signal.lfilter(b.ravel(), a, u)


def scipy_oe(y, u, order, start):
    scale = np.append(np.abs(start.a), np.abs(start.b[0]))

    def left(p):
        with np.errstate(all="ignore"):
            e = run(np.append(1.0, (p * scale)[:-1][::-1]), (p * scale)[-1], u) - y
        return np.where(np.isfinite(e), np.clip(e, -1e6, 1e6), 1e6)
    p = optimize.least_squares(left, np.append(start.a, start.b[0]) / scale, method="lm").x * scale
    return np.sort(np.abs(np.roots(np.append(1.0, p[:-1][::-1]))))


def numpy_prony(y, order, equations):
    rows = np.lib.stride_tricks.sliding_window_view(y, order + 1)[:equations]
    c = np.linalg.lstsq(rows[:, :order], -rows[:, order], rcond=None)[0]
    return np.log(np.roots(np.append(1.0, c[::-1])).astype(complex)) / T


def seconds(work, least: int = 3) -> tuple[float, object]:
    best, out = np.inf, None
    for _ in range(least):
        start = time.perf_counter()
        out = work()
        best = min(best, time.perf_counter() - start)
    return best, out


def worst(found, order) -> float:
    true = np.sort(np.abs(np.roots(plant(order)[0])))
    return float(np.max(np.abs(np.sort(np.abs(found))[-order:] / true - 1)))


def main() -> None:
    print("# Off-line methods: cost beside scipy and numpy, and its growth\n")
    print(f"Made by `python tools/bench/offline.py > docs/benchmark-offline.md`. {' '.join(__doc__.split(chr(10) * 2)[-1].split())} Best of three (scipy at 100,000 rows: one run), one thread, a busy machine: take the ratios. Error: of the worst natural frequency, 2 % noise.\n")
    print("| order | rows | output error, ms | scipy, ms | ratio | error, ours / scipy | SRIVC, ms | least squares, ms |\n|---|---|---|---|---|---|---|---|")
    for order in (2, 4, 6):
        for rows in (1000, 10000, 100000):
            y, u = data(order, rows)
            t_ls, start = seconds(lambda: lti.fit(y, u, T, order=order, zeros=0, method="ls"))
            t_iv, iv = seconds(lambda: lti.fit(y, u, T, order=order, zeros=0, method="srivc"))
            t_oe, oe = seconds(lambda: lti.fit(y, u, T, order=order, zeros=0, method="oe"))
            t_py, poles = seconds(lambda: scipy_oe(y, u, order, start), 1 if rows > 10000 else 3)
            print(f"| {order} | {rows} | {1e3 * t_oe:.3g} | {1e3 * t_py:.3g} | {t_py / t_oe:.2g} | {100 * worst(oe.modes().omega_rad_s, order):.2g} % / {100 * worst(poles, order):.2g} % | {1e3 * t_iv:.3g} | {1e3 * t_ls:.3g} |", flush=True)
    print(f"\n{READING}")
    print("\nProny, free decay of the same plants without noise:\n\n| order | equations | ours, ms | numpy, ms | ratio |\n|---|---|---|---|---|")
    for order in (2, 4, 6):
        for equations in (100, 1000, 10000):
            poles = np.roots(plant(order)[0])
            y = np.exp(np.outer(np.arange(equations + order + 5) * T % 20, poles)).sum(1).real
            t_ours, _ = seconds(lambda: modal.prony(y, order, T, equations=equations))
            t_np, _ = seconds(lambda: numpy_prony(y, order, equations))
            print(f"| {order} | {equations} | {1e3 * t_ours:.3g} | {1e3 * t_np:.3g} | {t_np / t_ours:.2g} |")


if __name__ == "__main__":
    main()

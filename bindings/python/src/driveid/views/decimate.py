# SPDX-License-Identifier: Apache-2.0
"""Long signals on few pixels: minimum and maximum of each bucket, so that no spike is lost.

A pyramid keeps the extremes of 64, 4096, ... samples, so that any part of an hour at 1 kHz is drawn from at most some
thousands of numbers; the deepest zoom reads the samples themselves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

FACTOR = 64


def _reduce(lo: np.ndarray, hi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Extremes of FACTOR neighbours each, NaN only where all are NaN."""
    edges = np.arange(0, len(lo), FACTOR)
    return np.fmin.reduceat(lo, edges), np.fmax.reduceat(hi, edges)


@dataclass
class Pyramid:
    """Extremes of one signal at several resolutions; level 0 is the signal itself (not copied)."""

    samples: np.ndarray
    levels: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)

    def __post_init__(self) -> None:
        lo = hi = self.samples
        while len(lo) > 4 * FACTOR:
            lo, hi = _reduce(lo, hi)
            self.levels.append((lo, hi))

    def extremes(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Minimum and maximum of samples[edges[k]:edges[k+1]] for each k, to the resolution of the level that suits.

        Buckets are widened to the blocks of that level: an extreme may show one block early, it never gets lost."""
        width = (edges[-1] - edges[0]) / max(len(edges) - 1, 1)
        level, size = 0, 1
        while level < len(self.levels) and size * FACTOR * 2 <= width:
            level, size = level + 1, size * FACTOR
        lo, hi = (self.samples, self.samples) if level == 0 else self.levels[level - 1]
        starts = np.minimum(edges[:-1] // size, len(lo) - 1)
        end = min(-(-int(edges[-1]) // size), len(lo))
        part = slice(int(starts[0]), max(end, int(starts[-1]) + 1))
        return np.fmin.reduceat(lo[part], starts - starts[0]), np.fmax.reduceat(hi[part], starts - starts[0])


def window(t: np.ndarray, begin: float, end: float) -> tuple[int, int]:
    """First index and one past the last of the samples in [begin, end], with one neighbour on each side."""
    first = max(int(np.searchsorted(t, begin, "left")) - 1, 0)
    last = min(int(np.searchsorted(t, end, "right")) + 1, len(t))
    return first, max(last, first + 1)


def trace(t: np.ndarray, pyramids: list[Pyramid], begin: float, end: float, pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """Times and rows of values to draw: the samples themselves where they are few, else two extremes a pixel.

    Returns t[n] and values[len(pyramids), n]; at most 2 * pixels columns (or the samples, if not more than that)."""
    first, last = window(t, begin, end)
    count = last - first
    if count <= 2 * pixels:
        return t[first:last], np.stack([p.samples[first:last] for p in pyramids]) if pyramids else np.empty((0, count))
    edges = np.linspace(first, last, pixels + 1).astype(np.int64)
    middle = t[(edges[:-1] + edges[1:] - 1) // 2]
    rows = np.empty((len(pyramids), 2 * pixels))
    for row, pyramid in zip(rows, pyramids, strict=True):
        row[0::2], row[1::2] = pyramid.extremes(edges)
    return np.repeat(middle, 2), rows


def thin(t: np.ndarray, values: np.ndarray, pixels: int) -> tuple[np.ndarray, np.ndarray]:
    """One signal on so many pixels (for pictures that are drawn once)."""
    if len(t) == 0:
        return t, values
    times, rows = trace(t, [Pyramid(np.asarray(values, dtype=float))], t[0], t[-1], pixels)
    return times, rows[0]

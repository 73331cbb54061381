# SPDX-License-Identifier: Apache-2.0
"""Plots as small SVG: shared by the report, the notebook and the still pictures of the workbench.

Colours come from the style sheet by class (``measured``, ``model0`` ..., ``residual``, ``floor``, ``train``, ``held``), so that one
picture serves light, dark and print."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass, field

import numpy as np

from . import units


def nice_step(span: float, most: int) -> float:
    """Step of 1, 2 or 5 times a power of ten that gives at most so many intervals."""
    if not (span > 0.0 and math.isfinite(span)):
        return 1.0
    raw = span / most
    power = 10.0 ** math.floor(math.log10(raw))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= raw * 0.999999)


def ticks(lo: float, hi: float, most: int) -> list[float]:
    step = nice_step(hi - lo, most)
    first = math.ceil(lo / step - 1e-9)
    last = math.floor(hi / step + 1e-9)
    return [k * step for k in range(first, last + 1)]


def log_ticks(lo: float, hi: float) -> list[float]:
    """1, 2, 5 of every decade, or whole decades where there are many."""
    decades = math.log10(hi / lo)
    factors = (1.0,) if decades > 4 else (1.0, 3.0) if decades > 2 else (1.0, 2.0, 5.0)
    powers = range(math.floor(math.log10(lo)), math.ceil(math.log10(hi)) + 1)
    return [f * 10.0**p for p in powers for f in factors if lo * 0.999 <= f * 10.0**p <= hi * 1.001]


@dataclass
class Axis:
    """Range and words of one axis. Labels carry the unit with a prefix that suits the range."""

    lo: float
    hi: float
    name: str = ""
    unit: str = ""
    log: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.lo) and math.isfinite(self.hi)):
            self.lo, self.hi = 0.0, 1.0
        if self.hi <= self.lo:
            pad = abs(self.lo) * 0.5 or 1.0
            self.lo, self.hi = self.lo - pad, self.hi + pad

    @classmethod
    def around(cls, values: list[np.ndarray], name: str = "", unit: str = "", zero: bool = False, pad: float = 0.06) -> Axis:
        """Axis that holds all values with a little air, and zero where asked."""
        finite = [v[np.isfinite(v)] for v in (np.asarray(v, dtype=float) for v in values)]
        finite = [v for v in finite if v.size]
        lo = min((float(v.min()) for v in finite), default=0.0)
        hi = max((float(v.max()) for v in finite), default=1.0)
        if zero:
            lo, hi = min(lo, 0.0), max(hi, 0.0)
        air = pad * (hi - lo)
        return cls(lo - (0.0 if zero and lo == 0.0 else air), hi + air, name, unit)

    def part(self, value: np.ndarray | float) -> np.ndarray | float:
        """Position 0..1 along the axis."""
        if self.log:
            return (np.log10(np.maximum(value, 1e-300)) - math.log10(self.lo)) / math.log10(self.hi / self.lo)
        return (value - self.lo) / (self.hi - self.lo)

    def marks(self, most: int) -> tuple[list[tuple[float, str]], str]:
        """Tick positions with texts, and the axis title."""
        divisor, unit = units.scale_of(max(abs(self.lo), abs(self.hi)), units.pretty_unit(self.unit))
        at = log_ticks(self.lo, self.hi) if self.log else ticks(self.lo, self.hi, most)
        texts = [(v, f"{v / divisor:.6g}".replace("-", "−")) for v in at]
        title = f"{self.name} / {unit}" if self.name and unit else self.name or unit
        return texts, title


@dataclass
class Figure:
    """One plot. Draw calls append; ``svg()`` gives the text."""

    x: Axis
    y: Axis
    width: int = 720
    height: int = 200
    label: str = ""
    body: list[str] = field(default_factory=list)
    left: int = 62
    right: int = 12
    top: int = 10
    bottom: int = 36
    x_texts: list[tuple[float, str]] | None = None

    def px(self, x: np.ndarray | float) -> np.ndarray | float:
        return self.left + self.x.part(x) * (self.width - self.left - self.right)

    def py(self, y: np.ndarray | float) -> np.ndarray | float:
        return self.height - self.bottom - self.y.part(y) * (self.height - self.top - self.bottom)

    def line(self, x: np.ndarray, y: np.ndarray, cls: str, thin: bool = True) -> None:
        """Polyline with gaps where values are missing; long ones keep two extremes a pixel."""
        from .decimate import thin as reduce

        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        if thin:
            x, y = reduce(x, y, (self.width - self.left - self.right))
        px, py = self.px(x), self.py(y)
        parts, pen = [], "M"
        for a, b in zip(px, py, strict=True):
            if not math.isfinite(b):
                pen = "M"
                continue
            parts.append(f"{pen}{a:.1f} {b:.1f}")
            pen = "L" if pen == "M" else " "
        self.body.append(f'<path class="{cls}" d="{"".join(parts)}"/>')

    def points(self, x: np.ndarray, y: np.ndarray, cls: str, most: int = 1200) -> None:
        """Cloud, thinned evenly; one path of dots (round caps), so that a thousand points stay small."""
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        keep = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
        keep = keep[:: max(1, -(-len(keep) // most))]
        dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(self.px(x[keep]), self.py(y[keep]), strict=True))
        self.body.append(f'<path class="dots {cls}" d="{dots}"/>')

    def rect(self, x0: float, x1: float, y0: float, y1: float, cls: str, tip: str = "") -> None:
        a, b = sorted((float(self.px(x0)), float(self.px(x1))))
        c, d = sorted((float(self.py(y0)), float(self.py(y1))))
        title = f"<title>{html.escape(tip)}</title>" if tip else ""
        self.body.append(f'<rect class="{cls}" x="{a:.1f}" y="{c:.1f}" width="{b - a:.1f}" height="{d - c:.1f}">{title}</rect>')

    def text(self, x: float, y: float, text: str, cls: str = "", anchor: str = "middle", dy: float = 0.0) -> None:
        self.body.append(f'<text class="{cls}" x="{float(self.px(x)):.1f}" y="{float(self.py(y)) + dy:.1f}" '
                         f'text-anchor="{anchor}">{html.escape(text)}</text>')

    def _axes(self) -> str:
        right, base = self.width - self.right, self.height - self.bottom
        out = []
        x_marks, x_title = self.x.marks(max(3, (self.width - self.left) // 90))
        y_marks, y_title = self.y.marks(max(2, (self.height - self.top - self.bottom) // 34))
        for value, text in y_marks:
            y = float(self.py(value))
            out.append(f'<path class="grid" d="M{self.left} {y:.1f}H{right}"/><text x="{self.left - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>')
        for value, text in self.x_texts if self.x_texts is not None else x_marks:
            x = float(self.px(value))
            tick = "" if self.x_texts is not None else f'<path class="grid" d="M{x:.1f} {self.top}V{base}"/>'
            out.append(f'{tick}<text x="{x:.1f}" y="{base + 15}" text-anchor="middle">{html.escape(text)}</text>')
        out.append(f'<path class="frame" d="M{self.left} {self.top}V{base}H{right}"/>')
        middle = (self.top + base) / 2
        out.append(f'<text class="axis" x="{(self.left + right) / 2:.0f}" y="{self.height - 4}" text-anchor="middle">{html.escape(x_title)}</text>')
        out.append(f'<text class="axis" transform="translate(13 {middle:.0f}) rotate(-90)" text-anchor="middle">{html.escape(y_title)}</text>')
        return "".join(out)

    def svg(self) -> str:
        name = html.escape(self.label or f"{self.y.name} against {self.x.name}", quote=True)
        return (f'<svg class="plot" viewBox="0 0 {self.width} {self.height}" role="img" aria-label="{name}">'
                f"{self._axes()}{''.join(self.body)}</svg>")

# SPDX-License-Identifier: Apache-2.0
"""Coordinates against which a residual is looked at: time, speed, direction, acceleration, place in the turn, current, temperature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .series import Series

_SPEED = ("omega_rad_s", "v_m_s")
_ANGLE = ("theta_rad", "x_m")
_CURRENT = ("i_q_A", "i_A", "tau_Nm", "F_N", "u", "v_V")


@dataclass(frozen=True)
class Coordinate:
    key: str
    title: str
    unit: str
    values: np.ndarray


def _first(series: Series, names: tuple[str, ...]) -> tuple[str, np.ndarray] | None:
    for name in names:
        curve = series.get(name)
        if curve is not None and np.isfinite(curve.values).any():
            return name, curve.values
    return None


def smooth_derivative(t: np.ndarray, values: np.ndarray, width_s: float) -> np.ndarray:
    """Slope of the straight line fitted to a sliding window: for pictures only, never for numbers."""
    if len(t) < 5:
        return np.full(len(t), np.nan)
    dt = float(np.median(np.diff(t)))
    half = int(np.clip(round(width_s / max(dt, 1e-12) / 2), 1, max((len(t) - 1) // 2, 1)))
    index = np.arange(len(t))
    lo, hi = np.maximum(index - half, 0), np.minimum(index + half, len(t) - 1)
    filled = np.nan_to_num(values - np.nanmean(values))
    total = np.concatenate([[0.0], np.cumsum(filled)])
    moment = np.concatenate([[0.0], np.cumsum(filled * (t - t[0]))])
    count = hi - lo + 1
    centre = (t[lo] + t[hi]) / 2 - t[0]
    first = total[hi + 1] - total[lo]
    second = moment[hi + 1] - moment[lo]
    spread = count * (count**2 - 1) / 12.0 * dt**2
    return np.where(spread > 0.0, (second - centre * first) / np.maximum(spread, 1e-300), np.nan)


def coordinates(series: Series, width_s: float = 0.02) -> list[Coordinate]:
    """What this record offers, in the order in which people ask."""
    t = series.t_s
    out = [Coordinate("t_s", "time", "s", t)]
    speed = _first(series, _SPEED)
    angle = _first(series, _ANGLE)
    if speed is None and angle is not None:
        speed = ("omega_rad_s" if angle[0] == "theta_rad" else "v_m_s", smooth_derivative(t, angle[1], width_s))
    if speed is not None:
        name, values = speed
        rotary = name == "omega_rad_s"
        out.append(Coordinate("speed", "speed", "rad/s" if rotary else "m/s", values))
        threshold = 0.02 * float(np.nanmax(np.abs(values)) or 0.0)
        out.append(Coordinate("direction", "direction", "", np.where(np.abs(values) < threshold, 0.0, np.sign(values))))
        out.append(Coordinate("acceleration", "acceleration", "rad/s²" if rotary else "m/s²", smooth_derivative(t, values, width_s)))
    if angle is not None:
        if angle[0] == "theta_rad":
            out.append(Coordinate("turn", "place in the turn", "rad", np.mod(angle[1], 2 * np.pi)))
        else:
            out.append(Coordinate("position", "position", "m", angle[1]))
    drive = _first(series, _CURRENT)
    if drive is not None:
        unit = {"tau_Nm": "N·m", "F_N": "N", "u": "", "v_V": "V"}.get(drive[0], "A")
        title = {"tau_Nm": "torque", "F_N": "force", "u": "input", "v_V": "voltage"}.get(drive[0], "current")
        out.append(Coordinate("current", title, unit, drive[1]))
    heat = _first(series, ("T_degC",))
    if heat is not None:
        out.append(Coordinate("temperature", "temperature", "°C", heat[1]))
    return out


def spectrum(t: np.ndarray, values: np.ndarray, lines: int = 600) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude of the residual over frequency (Hann window, root mean square of neighbouring lines where there are many)."""
    filled = np.nan_to_num(values - np.nanmean(values)) if np.isfinite(values).any() else np.zeros(len(values))
    if len(filled) < 32:
        return np.empty(0), np.empty(0)
    filled = filled[: 1 << 20]
    dt = float(np.median(np.diff(t)))
    window = np.hanning(len(filled))
    amplitude = np.abs(np.fft.rfft(filled * window)) * 2.0 / window.sum()
    frequency = np.fft.rfftfreq(len(filled), dt)
    edges = np.unique(np.geomspace(1, len(frequency) - 1, lines).astype(int))
    mean = np.sqrt(np.add.reduceat(amplitude[:-1] ** 2, edges[:-1]) / np.diff(np.append(edges[:-1], len(frequency) - 1)))
    return frequency[edges[:-1]], mean

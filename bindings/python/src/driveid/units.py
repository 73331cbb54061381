# SPDX-License-Identifier: Apache-2.0
"""Units at the border: everything inside is SI. A conversion is value_SI = factor * value + offset."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from .errors import UsageError, close_names

TURN = 2 * math.pi

# dimension -> unit -> (factor, offset); the first unit of each is the SI one
TABLE: dict[str, dict[str, tuple[float, float]]] = {
    "angle": {"rad": (1, 0), "mrad": (1e-3, 0), "urad": (1e-6, 0), "deg": (TURN / 360, 0), "arcmin": (TURN / 21600, 0),
              "arcsec": (TURN / 1296000, 0), "turn": (TURN, 0), "rev": (TURN, 0), "gon": (TURN / 400, 0)},
    "angular speed": {"rad/s": (1, 0), "mrad/s": (1e-3, 0), "deg/s": (TURN / 360, 0), "rpm": (TURN / 60, 0), "krpm": (TURN * 1000 / 60, 0),
                      "rps": (TURN, 0), "turn/s": (TURN, 0), "rev/s": (TURN, 0), "Hz": (TURN, 0)},
    "current": {"A": (1, 0), "mA": (1e-3, 0), "uA": (1e-6, 0), "kA": (1e3, 0), "cA": (1e-2, 0), "dA": (1e-1, 0)},
    "voltage": {"V": (1, 0), "mV": (1e-3, 0), "uV": (1e-6, 0), "kV": (1e3, 0), "dV": (1e-1, 0)},
    "torque": {"Nm": (1, 0), "mNm": (1e-3, 0), "uNm": (1e-6, 0), "cNm": (1e-2, 0), "Ncm": (1e-2, 0), "Nmm": (1e-3, 0), "kNm": (1e3, 0),
               "lbfin": (0.1129848290276167, 0), "lbfft": (1.3558179483314004, 0), "ozfin": (0.00706155181422604, 0)},
    "force": {"N": (1, 0), "mN": (1e-3, 0), "kN": (1e3, 0), "kgf": (9.80665, 0), "lbf": (4.4482216152605, 0)},
    "length": {"m": (1, 0), "dm": (1e-1, 0), "cm": (1e-2, 0), "mm": (1e-3, 0), "um": (1e-6, 0), "nm": (1e-9, 0), "in": (0.0254, 0)},
    "speed": {"m/s": (1, 0), "cm/s": (1e-2, 0), "mm/s": (1e-3, 0), "um/s": (1e-6, 0), "m/min": (1 / 60, 0), "mm/min": (1e-3 / 60, 0), "km/h": (1 / 3.6, 0)},
    "temperature": {"degC": (1, 0), "K": (1, -273.15), "degF": (5 / 9, -160 / 9)},
    "time": {"s": (1, 0), "ms": (1e-3, 0), "us": (1e-6, 0), "ns": (1e-9, 0), "min": (60, 0), "h": (3600, 0)},
}

DIMENSION = {
    "i_A": "current", "i_d_A": "current", "i_q_A": "current", "v_V": "voltage", "v_d_V": "voltage", "v_q_V": "voltage",
    "tau_Nm": "torque", "F_N": "force", "theta_rad": "angle", "omega_rad_s": "angular speed", "theta_l_rad": "angle",
    "omega_l_rad_s": "angular speed", "x_m": "length", "v_m_s": "speed", "T_degC": "temperature", "t_s": "time", "t_ns": "time",
}

ALIASES = {
    "°": "deg", "degree": "deg", "degrees": "deg", "°/s": "deg/s", "deg_s": "deg/s", "dps": "deg/s", "degree/s": "deg/s", "degrees/s": "deg/s",
    "rad_s": "rad/s", "1/s": "rad/s", "s^-1": "rad/s", "1/min": "rpm", "min-1": "rpm", "min^-1": "rpm", "r/min": "rpm", "U/min": "rpm", "RPM": "rpm",
    "rev/min": "rpm", "turns": "turn", "turns/s": "turn/s", "revs": "rev", "amp": "A", "amps": "A", "ampere": "A", "volt": "V", "volts": "V",
    "newton": "N", "m_s": "m/s", "mm_s": "mm/s", "°C": "degC", "C": "degC", "celsius": "degC", "°F": "degF", "sec": "s", "second": "s", "seconds": "s",
    "msec": "ms", "usec": "us", "nsec": "ns", "radians": "rad", "radian": "rad", "rad/sec": "rad/s", "deg/sec": "deg/s", "meter": "m", "metre": "m",
    "lbf-in": "lbfin", "lbf-ft": "lbfft",
}

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_COUNTS = re.compile(rf"(?:counts?|cts?|cnts?|ticks?|incs?|inc|lsb|pulses?)/({_NUMBER})(/s)?$", re.IGNORECASE)
_COUNTS_S = re.compile(rf"(?:counts?|cts?|cnts?|ticks?|incs?|pulses?)/s/({_NUMBER})$", re.IGNORECASE)
_FACTOR = re.compile(rf"({_NUMBER})\s*\*?\s*(.*)$")


@dataclass(frozen=True)
class Conversion:
    factor: float = 1.0
    offset: float = 0.0

    def negated(self) -> Conversion:
        return Conversion(-self.factor, -self.offset)

    def __call__(self, values):
        if self.factor == 1.0 and self.offset == 0.0:
            return values
        return values * self.factor + self.offset


def clean(unit: str) -> str:
    """The spelling that TABLE uses."""
    unit = unit.strip().strip("[]()").replace("µ", "u").replace("μ", "u")
    if unit in ALIASES:
        return ALIASES[unit]
    compact = re.sub(r"[\s·*⋅_.-]+", "", unit) if re.fullmatch(r"[mukc]?N[\s·*⋅_.-]*[mc]?m", unit) else unit.replace(" ", "")
    return ALIASES.get(compact, compact)


def dimension_of(unit: str) -> str | None:
    unit = clean(unit)
    for dimension, table in TABLE.items():
        if unit in table:
            return dimension
    return None


def _per_turn(text: str, unit: str) -> float:
    counts = float(text)
    if not counts > 0:
        raise UsageError(f"unit {unit!r}: counts per turn must be positive")
    return TURN / counts


def conversion(unit: str, target: str) -> Conversion:
    """From `unit` to the SI unit that the name `target` carries. Raises UsageError that lists what is possible."""
    unit = clean(unit)
    dimension = DIMENSION.get(target)
    if match := _COUNTS.match(unit) or _COUNTS_S.match(unit):
        speed = unit.lower().endswith("/s") or bool(_COUNTS_S.match(unit))
        if dimension not in (None, "angular speed" if speed else "angle"):
            raise UsageError(f"unit {unit!r} is {'a speed' if speed else 'an angle'} of a turning encoder; {target} is a {dimension}. "
                             f"For a linear scale give the size of one count, e.g. {target}=COLUMN:0.5um")
        return Conversion(_per_turn(match.group(1), unit))
    tables = [TABLE[dimension]] if dimension else list(TABLE.values())
    for table in tables:
        if unit in table:
            return Conversion(*table[unit])
    if (match := _FACTOR.match(unit)) and float(match.group(1)) != 0:
        if not match.group(2):
            return Conversion(float(match.group(1)))
        inner = conversion(match.group(2), target)
        return Conversion(float(match.group(1)) * inner.factor, inner.offset)
    known = list(tables[0]) if dimension else [u for t in tables for u in t]
    extra = ["counts/N"] if dimension == "angle" else ["counts/N/s"] if dimension == "angular speed" else []
    what = f"{target} ({dimension})" if dimension else target
    raise UsageError(f"unit {unit!r} does not convert to {what}. {close_names(unit, known + extra)}; a bare number is a factor to SI")


# A column called "theta [deg]", "theta_deg" or "iq (mA)" is its signal in another unit.
_SYMBOLS = {
    "i": "i_A", "i_d": "i_d_A", "id": "i_d_A", "i_q": "i_q_A", "iq": "i_q_A", "v": None, "v_d": "v_d_V", "v_q": "v_q_V", "tau": "tau_Nm", "torque": "tau_Nm",
    "F": "F_N", "force": "F_N", "theta": "theta_rad", "omega": "omega_rad_s", "theta_l": "theta_l_rad", "omega_l": "omega_l_rad_s",
    "x": "x_m", "T": "T_degC", "t": "t_s", "time": "t_s", "timestamp": "t_s",
}


def signal_of(symbol: str, unit: str | None) -> str | None:
    """Canonical name for a symbol whose unit is known and fits, else None."""
    if unit is None:
        return None
    dimension = dimension_of(unit)
    if symbol == "v":
        return {"voltage": "v_V", "speed": "v_m_s"}.get(dimension or "")
    name = _SYMBOLS.get(symbol) or _SYMBOLS.get(symbol.lower())
    return name if name and DIMENSION[name] == dimension else None


_HEADER = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<a>[^\]]*)\]|\((?P<b>[^)]*)\))$")
_SUFFIXES = {"deg": "deg", "deg_s": "deg/s", "rpm": "rpm", "mA": "mA", "mV": "mV", "mNm": "mNm", "kN": "kN", "mm": "mm", "um": "um",
             "mm_s": "mm/s", "ms": "ms", "us": "us", "turn": "turn", "rev": "rev", "rps": "rps", "degF": "degF", "K": "K", "s": "s"}


def split_header(text: str) -> tuple[str, str | None]:
    """'y [deg/s]' -> ('y', 'deg/s'); 'theta_deg' -> ('theta', 'deg') where that is unambiguous; else (text, None)."""
    text = text.strip()
    match = _HEADER.match(text)
    if match and match.group("name"):
        unit = (match.group("a") if match.group("a") is not None else match.group("b")).strip()
        return match.group("name").strip(), unit or None
    if text not in DIMENSION:
        for suffix in sorted(_SUFFIXES, key=len, reverse=True):
            if text.endswith("_" + suffix) and signal_of(text[: -len(suffix) - 1], _SUFFIXES[suffix]):
                return text[: -len(suffix) - 1], _SUFFIXES[suffix]
    return text, None

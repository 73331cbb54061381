# SPDX-License-Identifier: Apache-2.0
"""Numbers and names for people: SI prefixes, intervals, and symbols out of names such as ``tau_c_Nm``."""

from __future__ import annotations

import html
import math

_SUFFIX = {
    "Nms_rad": "N·m·s/rad", "As2_rad": "A·s²/rad", "As_rad": "A·s/rad", "Vs_rad": "V·s/rad", "Nm_rad": "N·m/rad",
    "Nm_A": "N·m/A", "rad_s2": "rad/s²", "rad_s": "rad/s", "Ns_m": "N·s/m", "Ns2_m2": "N·s²/m²", "Nms2_rad2": "N·m·s²/rad²",
    "As2_rad2": "A·s²/rad²", "As2_m": "A·s²/m", "As_m": "A·s/m", "N_A": "N/A", "N_m": "N/m", "m_s2": "m/s²", "m_s": "m/s", "kgm2": "kg·m²", "ohm": "Ω",
    "degC": "°C", "Nm": "N·m", "rad": "rad", "kg": "kg", "Vs": "V·s", "ns": "ns", "A": "A", "V": "V", "H": "H", "N": "N", "m": "m", "s": "s",
}
_GREEK = {
    "tau": "τ", "theta": "θ", "omega": "ω", "psi": "ψ", "phi": "φ", "sigma": "σ", "alpha": "α", "beta": "β",
    "mu": "μ", "delta": "δ", "gamma": "γ", "zeta": "ζ", "rho": "ρ",
}
_PREFIX = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_PREFIXED = ("Ω", "A", "V", "H", "Hz", "N", "W", "F", "s", "m")  # first factors that take a prefix both ways
_SMALL_ONLY = ("rad", "s", "m")  # nobody writes kilo-radian or kilo-second
_SUPER = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def split_name(name: str) -> tuple[str, str]:
    """``tau_c_Nm`` -> (``tau_c``, ``N·m``); a name without a known unit keeps itself."""
    parts = name.split("_")
    if len(parts) > 2 and parts[-1].isdigit():  # the second of several: phi_rad_2 is phi_2 in rad
        base, unit = split_name("_".join(parts[:-1]))
        return (f"{base}_{parts[-1]}", unit) if unit else (name, "")
    for cut in range(1, len(parts)):
        tail = "_".join(parts[cut:])
        if tail in _SUFFIX:
            return "_".join(parts[:cut]), _SUFFIX[tail]
    return name, ""


def symbol(name: str) -> str:
    """Symbol as plain text: ``tau_c_Nm`` -> ``τ_c``."""
    parts = split_name(name)[0].split("_")
    return "_".join(_GREEK.get(part, part) for part in parts)


def symbol_html(name: str) -> str:
    """Symbol with real subscripts; the machine's name stays as the tooltip."""
    first, *rest = [html.escape(_GREEK.get(part, part)) for part in split_name(name)[0].split("_")]
    sub = f"<sub>{' '.join(rest)}</sub>" if rest else ""
    return f'<span class="sym" title="{html.escape(name, quote=True)}"><i>{first}</i>{sub}</span>'


def pretty_unit(unit: str | None) -> str:
    """``kg m^2`` -> ``kg·m²``, ``ohm`` -> ``Ω``."""
    if not unit or unit == "1":
        return ""
    text = unit.replace("ohm", "Ω").replace("degC", "°C").replace("*", " ")
    for power in "2345":
        text = text.replace(f"^{power}", power.translate(_SUPER))
    return "·".join(text.split()).replace("·/·", "/").replace("·/", "/").replace("/·", "/")


def _leading(unit: str) -> str:
    for end, char in enumerate(unit):
        if char in "·/²³":
            return unit[:end] if char in "·/" else ""
    return unit


def scale_of(magnitude: float, unit: str) -> tuple[float, str]:
    """Divisor and unit text that bring ``magnitude`` to 1..1000; units without prefixes get a power of ten."""
    if not math.isfinite(magnitude) or magnitude <= 0.0:
        return 1.0, unit
    power = 3 * math.floor(math.log10(magnitude * 1.0000001) / 3)
    lead = _leading(unit)
    if power > 0 and (lead in _SMALL_ONLY or not unit or unit in ("°C", "%")):
        power = 0 if magnitude < 1e5 else power
    if power == 0 or (not unit and -3 <= power < 0 and magnitude >= 1e-2):
        return 1.0, unit
    if lead in _PREFIXED + ("rad",) and power in _PREFIX:
        return 10.0**power, _PREFIX[power] + unit
    text = f"×10{str(power).translate(_SUPER)}"
    return 10.0**power, f"{text} {unit}".rstrip()


def _round(value: float, decimals: int) -> str:
    text = f"{value:.{max(decimals, 0)}f}"
    return text.replace("-", "−")


def number(value: float | None, unit: str = "", digits: int = 4) -> str:
    """``number(0.00012, 'A')`` -> ``120 µA``."""
    if value is None or not math.isfinite(value):
        return "unknown"
    divisor, text = scale_of(abs(value), pretty_unit(unit))
    scaled = value / divisor
    whole = 0 if scaled == 0.0 else max(math.floor(math.log10(abs(scaled))) + 1, 0 if text.startswith("×") else -2)
    shown = _round(scaled, digits - whole)
    if "." in shown:
        shown = shown.rstrip("0").rstrip(".")
    return f"{shown} {text}".strip()


def estimate(value: float | None, lo: float | None, hi: float | None, unit: str = "") -> str:
    """Value with its 95 % interval, both with the digits that the interval deserves."""
    if value is None or not math.isfinite(value):
        return "not known yet"
    if lo is None or hi is None or not (math.isfinite(lo) and math.isfinite(hi)) or hi <= lo:
        return number(value, unit)
    half = (hi - lo) / 2.0
    divisor, text = scale_of(max(abs(value), half), pretty_unit(unit))
    decimals = 1 - math.floor(math.log10(half / divisor * 1.0000001))
    decimals = min(max(decimals, 0), 9)
    if abs((hi + lo) / 2.0 - value) <= 0.1 * half:
        both = f"{_round(value / divisor, decimals)} ± {_round(half / divisor, decimals)}"
        return f"({both}) {text}" if text.startswith("×") else f"{both} {text}".rstrip()
    span = f"{_round(lo / divisor, decimals)} … {_round(hi / divisor, decimals)}"
    return f"{_round(value / divisor, decimals)} [{span}] {text}".rstrip()


def percent(share: float | None) -> str:
    """A share 0..1 as a percentage with sensible digits."""
    if share is None or not math.isfinite(share):
        return "unknown"
    value = 100.0 * share
    digits = 0 if abs(value) >= 10 else 1 if abs(value) >= 0.095 else 2
    text = _round(value, digits)
    return f"{text} %"


def duration(seconds: float | None) -> str:
    """``3725`` -> ``1 h 02 min``."""
    if seconds is None or not math.isfinite(seconds):
        return "unknown"
    if seconds < 120.0:
        return number(seconds, "s", 3)
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"

# SPDX-License-Identifier: Apache-2.0
"""After how many counts an angle of a DBC returns to its start: what its range, its scale and its length say."""

from __future__ import annotations

import math

from .units import TURN

_NEAR = 1e-5  # of a turn: factors in a DBC are rounded


def wrap_counts(signal, scale: float, counter: bool, place: str, notices: list[str]) -> int:
    """Counts after which the angle starts again; 0: it does not. `scale`: radians of one count; `counter`: its unit is counts, which count on."""
    turn, room = TURN / abs(scale), 1 << signal.length
    span = _span(signal)
    if span is not None and span < room * (1 - 1e-4) - 1.5:  # else it is what the bits can hold, and says nothing
        turns = round(span / turn)
        if turns >= 1 and abs(span - turns * turn) <= max(1.5, 0.004 * turn):  # [0|359.9], [0|360] and [0|359] are a turn of 0.1 deg
            return _whole(turns * turn, turns, room, place, notices)
        return 0
    turns = round(room / turn)
    if turns >= 1 and abs(room - turns * turn) <= min(_NEAR * room, 1e-3 * turn):  # all of the bits: a whole number of turns
        return room
    if turn > room * (1 + _NEAR):  # less than a turn: an angle that ends at its stops
        return 0
    if counter or not _fits_closely(turn, signal.length):
        notices.append(f"{place}: read as a counter that starts again at 2^{signal.length}, after {room / turn:.6g} turns; if it starts again each turn, write wrap_counts = {math.ceil(turn * (1 - _NEAR))}")
        return room
    counts = _whole(turn, 1, room, place, notices)
    notices.append(f"{place}: the DBC gives no range, so the angle is read as one that starts again each turn (wrap_counts = {counts}); if it counts on, write wrap_counts = {room}")
    return counts


def _span(signal) -> float | None:
    """Counts from the least to the greatest value, both of them counted; None where the DBC does not say."""
    if signal.minimum is None or signal.maximum is None or signal.maximum <= signal.minimum:
        return None
    return float(signal.maximum - signal.minimum) / abs(float(signal.scale)) + 1


def _fits_closely(turn: float, length: int) -> bool:
    """The field is the smallest of whole bytes, or of bits, that holds a turn."""
    bits = math.ceil(math.log2(turn * (1 - _NEAR)))
    return length <= 8 * math.ceil(bits / 8)


def _whole(counts: float, turns: int, room: int, place: str, notices: list[str]) -> int:
    whole = min(math.ceil(counts * (1 - _NEAR)), room)
    if abs(whole - counts) > _NEAR * counts:
        notices.append(f"{place}: {'a turn' if turns == 1 else f'{turns} turns'} of {counts:.6g} counts, no whole number: read as {whole}, so the angle drifts by {abs(whole / counts - 1) * 100:.2g} % over many turns")
    return whole

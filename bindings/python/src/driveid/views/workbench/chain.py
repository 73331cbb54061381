# SPDX-License-Identifier: Apache-2.0
"""What was added to a model, in order, as it stands in the address: ``coulomb,cogging,cogging,my_drag:tau_Nm:c*omega_rad_s^3``.

An effect of the catalogue is its name; one that repeats (cogging of several orders) stands there as often. An own effect is
name:adds_to:formula, a comma of the formula written as a semicolon."""

from __future__ import annotations

import re
from collections.abc import Iterable

from ...model import Model
from .. import model as view

Chain = tuple[str, ...]
_NUMBERED = re.compile(r"(.+)_(\d+)$")


def parse(text: str) -> Chain:
    return tuple(e for e in text.split(",") if e)


def own(name: str, formula: str, adds_to: str) -> str:
    """An own effect as an element of the address."""
    return f"{name}:{adds_to}:{formula.replace(',', ';')}"


def add(model: Model, element: str) -> Model:
    name, mark, rest = element.partition(":")
    if not mark:
        return model.add(name)
    adds_to, _, formula = rest.partition(":")
    return model.add_own(name, formula.replace(";", ","), adds_to)


def titles(chain: Chain) -> list[str]:
    """Names for people; the second of the same is numbered."""
    out = []
    for k, element in enumerate(chain):
        before = chain[:k].count(element)
        out.append(view.effect_title(element) + (f" ({before + 1})" if before else ""))
    return out


def orders(parameters: Iterable[str]) -> int:
    """How often an effect was found: N, A, phi, N_2, A_2, phi_2 are two orders."""
    names = set(parameters)
    return max([1, *(int(m[2]) for m in map(_NUMBERED.match, names) if m and m[1] in names)])

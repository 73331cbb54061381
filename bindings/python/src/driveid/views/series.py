# SPDX-License-Identifier: Apache-2.0
"""Series for plots: measured signals, what each model predicts, and the residuals, on the time of the record."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from . import units
from .decimate import Pyramid


@dataclass(frozen=True)
class Curve:
    """One row of the data that driveid_series gives."""

    name: str
    unit: str
    what: str
    values: np.ndarray

    @property
    def title(self) -> str:
        return f"{self.name.partition('.')[0].replace('_', ' ')} balance: what is left" if self.what == "residual" else units.symbol(self.name)


_HOW = {"free_run": "free run from the start", "one_step": "one step ahead"}


@dataclass(frozen=True)
class Pair:
    """Measured and predicted of one signal; ``title`` says which prediction it is."""

    name: str
    key: str
    title: str
    unit: str
    measured: np.ndarray
    model: np.ndarray

    @property
    def symbol(self) -> str:
        return units.symbol(self.name)

    @property
    def measured_name(self) -> str:
        return self.name

    @property
    def model_name(self) -> str:
        return self.key

    @property
    def residual(self) -> np.ndarray:
        return self.measured - self.model


@dataclass
class Series:
    """All curves of one record with one model."""

    t_s: np.ndarray
    curves: list[Curve]
    record: str = ""
    _pyramids: dict[str, Pyramid] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, t_s: np.ndarray, header: dict, data: np.ndarray, record: str = "") -> Series:
        """From the header and the values of driveid_series."""
        rows = np.asarray(data, dtype=float).reshape(len(header["series"]), -1)
        curves = [Curve(s["name"], s.get("unit") or units.split_name(s["name"])[1], s.get("what") or "", row)
                  for s, row in zip(header["series"], rows, strict=True)]
        return cls(np.asarray(t_s, dtype=float), curves, record)

    def get(self, name: str) -> Curve | None:
        return next((c for c in self.curves if c.name == name), None)

    @property
    def nbytes(self) -> int:
        return int(self.t_s.nbytes + sum(c.values.nbytes for c in self.curves))

    @property
    def signals(self) -> list[Curve]:
        """What was measured."""
        return [c for c in self.curves if c.what in ("signal", "measured")]

    def pyramid(self, name: str) -> Pyramid:
        if name not in self._pyramids:
            curve = self.get(name)
            if curve is None:
                raise KeyError(name)
            self._pyramids[name] = Pyramid(curve.values)
        return self._pyramids[name]

    def residual_pyramid(self, pair: Pair) -> Pyramid:
        name = f"{pair.key} left"
        if name not in self._pyramids:
            self._pyramids[name] = Pyramid(pair.residual)
        return self._pyramids[name]

    def pairs(self) -> list[Pair]:
        """Measured against predicted, the simulation first: what a person looks at before anything else."""
        out = []
        for curve in self.curves:
            base, _, how = curve.name.partition(".")
            measured = self.get(base)
            if curve.what != "prediction" or measured is None:
                continue
            out.append(Pair(base, curve.name, f"{units.symbol(base)}, {_HOW.get(how, how)}", curve.unit, measured.values, curve.values))
        return sorted(out, key=lambda p: p.title)

    def balances(self) -> list[Curve]:
        """Residuals of the equations: torque, force or voltage that the model cannot account for."""
        return [c for c in self.curves if c.what == "residual" and np.isfinite(c.values).any()]

    def balance(self, name: str = "") -> Curve | None:
        """The residual of that name, else the first."""
        found = self.balances()
        return next((c for c in found if c.name == name), found[0] if found else None)


def as_series(found: object) -> Series:
    """A Series of the analysis (header and data) as one of the views."""
    return found if isinstance(found, Series) else Series.of(found.t_s, found.header, found.data, found.record)

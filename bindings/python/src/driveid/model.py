# SPDX-License-Identifier: Apache-2.0
"""Model: a structure and its effects, as the TOML text that every part of driveid reads."""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass, field

from . import _core
from .errors import FileError, UsageError, close_names
from .files import read_text, write_text


@dataclass(frozen=True)
class Parameter:
    """Value with its 95 % interval; None where nothing is known yet."""

    name: str
    value: float | None
    interval: tuple[float, float] | None
    unit: str
    state: str = "free"

    @classmethod
    def of(cls, data: dict) -> Parameter:
        known = data.get("state") != "unset" and data.get("value") is not None
        interval = data.get("interval")
        return cls(data["name"], data["value"] if known else None, tuple(interval) if known and interval else None,
                   data.get("unit") or "", data.get("state") or "free")


@dataclass(frozen=True)
class Effect:
    name: str
    parameters: dict[str, Parameter] = field(default_factory=dict)
    formula: str = ""
    adds_to: str = ""


class Model:
    """Immutable: add() and fit() give a new one."""

    def __init__(self, toml: str, name: str = "model"):
        status, data, message = _core.model_read(toml)
        if status != 0:
            raise FileError(name, message or _core.status_text(status))
        self.toml, self.name = toml, name
        self.structure: str = data["structure"]
        self.parameters = {p["name"]: Parameter.of(p) for p in data["parameters"]}
        self.effects = [Effect(e["name"], {p["name"]: Parameter.of(p) for p in e["parameters"]}, e["formula"], e["adds_to"])
                        for e in data["effects"]]

    @classmethod
    def new(cls, structure: str, given: dict[str, float] | None = None, **more: float) -> Model:
        """The known physics: Model.new("rigid_axis", K_t_Nm_A=0.05)."""
        if structure not in _core.STRUCTURES:
            raise UsageError(f"no structure {structure!r}. {close_names(structure, _core.STRUCTURES)}")
        values = [f"{k}={float(v)!r}" for k, v in {**(given or {}), **more}.items()]
        status, toml, message = _core.model_new(structure, values)
        if status != 0 or toml is None:
            raise UsageError(message or _core.status_text(status))
        return cls(toml)

    @classmethod
    def load(cls, path: str | os.PathLike) -> Model:
        return cls(read_text(path), str(path))

    def save(self, path: str | os.PathLike) -> None:
        write_text(path, self.toml)

    def add(self, effect: str) -> Model:
        """The same model with one effect more, its parameters still to be fitted."""
        status, toml, message = _core.model_add(self.toml, effect)
        if status != 0 or toml is None:
            raise UsageError(message or _core.status_text(status))
        return Model(toml, self.name)

    def add_own(self, name: str, formula: str, adds_to: str | None = None) -> Model:
        """The same model with an effect of your own: Model.add_own("my_drag", "tau_Nm = c * omega_rad_s * abs(omega_rad_s)")."""
        given = {"name": name, "formula": formula, "adds_to": adds_to}
        keys = "".join(f"{key} = {json.dumps(value)}\n" for key, value in given.items() if value is not None)
        try:
            return Model(f"{self.toml.rstrip()}\n\n[[effect]]\n{keys}", self.name)
        except FileError as e:
            raise UsageError(re.sub(r"^.*?: (line \d+: )?", "", str(e), count=1)) from None

    def __repr__(self) -> str:
        return f"Model({self.structure}{''.join(' + ' + e.name for e in self.effects)})"

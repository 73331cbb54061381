# SPDX-License-Identifier: Apache-2.0
"""Answers about a project: each is asked of the library once and kept.

A chain is the tuple of effects that were added to the project's model, in order; the model of a chain is fitted to the training records."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ... import analysis
from ...errors import DataError, DriveidError
from ...model import Model
from ...records import read_all
from ..series import Series
from . import chain as chains
from .chain import Chain
from .jobs import Jobs, Progress
from .projects import Project


class Trouble(Exception):
    """What went wrong, in words for people."""


class Engine:
    def __init__(self, jobs: Jobs | None = None) -> None:
        self.jobs = jobs or Jobs()
        self._records: dict[tuple, list] = {}
        self._lock = threading.Lock()

    # Records ------------------------------------------------------------------------------------------------------

    def records(self, project: Project) -> list[tuple[str, object]]:
        """(role, record) of every run; read once. Errors of the reader name file, line and mend."""
        key = (project.training, project.held_out, project.maps, project.hold, project.dbc)
        with self._lock:
            if key not in self._records:
                found = []
                for path, role in project.records:
                    found += [(role, r) for r in read_all(path, list(project.maps), hold=project.hold or None, dbc=list(project.dbc) or None)]
                if len(self._records) > 3:
                    self._records.pop(next(iter(self._records)))
                self._records[key] = found
            return self._records[key]

    def _sides(self, project: Project) -> tuple[list, list]:
        both = self.records(project)
        return [r for role, r in both if role == "training"], [r for role, r in both if role == "held_out"]

    # Documents ----------------------------------------------------------------------------------------------------

    def _ask(self, call: Callable, project: Project, model: str, progress: Progress) -> dict:
        """The document, also that of a refusal: its verdict is bad_data and its notices say why."""
        training, held_out = self._sides(project)
        try:
            return call(Model(model), training, held_out=held_out, progress=progress).document
        except DataError as error:
            if error.document is None:
                raise Trouble(str(error)) from error
            return {"message": str(error), **error.document}

    def fitted(self, project: Project, chain: Chain, progress: Progress) -> dict:
        """Fit of the chain's model; the document carries ``model_toml``. A model that came with all its values is shown as it came."""
        def work(tell: Progress) -> dict:
            model = project.model_toml
            if not chain and not self._unset(model):
                return {"model_toml": model}
            if chain:
                model = self.add(self.fitted(project, chain[:-1], tell)["model_toml"], chain[-1])
            tell(0.1, f"fitting {' + '.join(chains.titles(chain)) or 'the model'}")
            document = self._ask(analysis.fit, project, model, tell)
            if "model_toml" not in document:
                raise Trouble(document.get("message") or "the fit gave no model: look at the notices of the record")
            return document

        return self._once((project.id, chain, "fit"), work, progress)

    @staticmethod
    def _unset(model_toml: str) -> bool:
        model = Model(model_toml)
        return any(p.state == "unset" for group in (model.parameters, *(e.parameters for e in model.effects)) for p in group.values())

    def model_toml(self, project: Project, chain: Chain, progress: Progress) -> str:
        return self.fitted(project, chain, progress)["model_toml"]

    def compared(self, project: Project, chain: Chain, progress: Progress) -> dict:
        return self._once((project.id, chain, "compare"), lambda tell: self._ask(analysis.compare, project, self.model_toml(project, chain, tell), tell), progress)

    def explained(self, project: Project, chain: Chain, progress: Progress) -> dict:
        return self._once((project.id, chain, "explain"), lambda tell: self._ask(analysis.explain, project, self.model_toml(project, chain, tell), tell), progress)

    def improved(self, project: Project, chain: Chain, progress: Progress) -> dict:
        return self._once((project.id, chain, "improve"), lambda tell: self._ask(analysis.improve, project, self.model_toml(project, chain, tell), tell), progress)

    def series(self, project: Project, chain: Chain, record: int, progress: Progress) -> Series:
        def work(tell: Progress) -> Series:
            model = self.model_toml(project, chain, tell)
            tell(0.5, "drawing the model over the record")
            return self._series(model, self.records(project)[record][1])

        return self._once((project.id, chain, "series", record), work, progress)

    def other_series(self, project: Project, number: int, record: int, progress: Progress) -> Series:
        """Series of a further model of the project, as it stands in its file."""
        return self._once((project.id, "other", number, record), lambda tell: self._series(project.others[number][1], self.records(project)[record][1]), progress)

    @staticmethod
    def _series(model: str, record) -> Series:
        found = analysis.series(Model(model), record)
        return Series.of(found.t_s, found.header, found.data, found.record)

    def add(self, model_toml: str, effect: str) -> str:
        return chains.add(Model(model_toml), effect).toml

    def new(self, structure: str, given: list[str]) -> str:
        try:
            return Model.new(structure, **{k: float(v) for k, v in (item.split("=", 1) for item in given)}).toml
        except ValueError as error:
            raise DriveidError(f"known values look like K_t_Nm_A=0.05, not {' '.join(given)}") from error

    def _once(self, key: tuple, work: Callable[[Progress], object], progress: Progress):
        return self.jobs.once(key, lambda: work(progress))

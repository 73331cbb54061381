# SPDX-License-Identifier: Apache-2.0
"""What is looked at: a model and its records. A project's id is a digest of its content, so that an address means the same tomorrow."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, field
from importlib import resources
from pathlib import Path


@dataclass(frozen=True)
class Project:
    name: str
    model_toml: str
    training: tuple[str, ...]
    held_out: tuple[str, ...] = ()
    maps: tuple[str, ...] = ()
    hold: str = ""
    dbc: tuple[str, ...] = ()
    others: tuple[tuple[str, str], ...] = field(default=())  # further models to compare with: (name, TOML)

    @property
    def id(self) -> str:
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:10]

    @property
    def records(self) -> list[tuple[str, str]]:
        """Path and role of each record."""
        return [(p, "training") for p in self.training] + [(p, "held_out") for p in self.held_out]


def state_folder() -> Path:
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state"
    return Path(base) / "driveid"


class Projects:
    """Projects by id; kept on disk, so that addresses survive a restart of the workbench."""

    def __init__(self, folder: Path | None = None) -> None:
        self._file = (folder or state_folder()) / "projects.json"
        self._known: dict[str, Project] = {}
        try:
            for data in json.loads(self._file.read_text("utf-8")):
                self._keep(_from(data))
        except (OSError, ValueError, TypeError):
            pass  # no state, or a damaged one: begin anew

    def _keep(self, project: Project) -> None:
        self._known.pop(project.id, None)
        self._known[project.id] = project

    def add(self, project: Project) -> str:
        self._keep(project)
        try:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            aside = self._file.with_suffix(".tmp")
            aside.write_text(json.dumps([asdict(p) for p in list(self._known.values())[-50:]]), "utf-8")
            aside.replace(self._file)
        except OSError:
            pass  # a read-only home only costs the memory of projects
        return project.id

    def get(self, id: str) -> Project | None:
        return self._known.get(id)

    def all(self) -> list[Project]:
        return list(reversed(self._known.values()))


def _from(data: dict) -> Project:
    return Project(data["name"], data["model_toml"], tuple(data["training"]), tuple(data["held_out"]), tuple(data["maps"]), data["hold"],
                   tuple(data.get("dbc", ())), tuple((n, t) for n, t in data.get("others", ())))


def bundled_example() -> Project:
    """A simulated servo axis with friction and cogging that the first model does not know."""
    folder = Path(str(resources.files("driveid.views").joinpath("example")))
    return Project("Example: servo axis", (folder / "model.toml").read_text("utf-8"), (str(folder / "train.csv.gz"),), (str(folder / "held_out.csv.gz"),))

# SPDX-License-Identifier: Apache-2.0
"""--map NAME=COLUMN[:UNIT]: what the user calls a column, in which unit, with which sign."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from .._core import SIGNALS
from ..errors import UsageError, close_names

TIMES = ("t_s", "t_ns")


@dataclass(frozen=True)
class Source:
    """Where a signal comes from. `text` is everything behind the equals sign: which part is the column is known once the columns are."""

    name: str
    text: str

    def resolve(self, columns: Iterable[str]) -> tuple[str, str | None, bool]:
        """(column, unit, negated); UsageError where no such column is there."""
        columns = list(columns)
        for text, negated in ((self.text, False), (self.text[1:].strip(), True)):
            if negated and not self.text.startswith("-"):
                break
            if text in columns:
                return text, None, negated
            column, colon, unit = text.rpartition(":")
            if colon and column.strip() in columns:
                return column.strip(), unit, negated
        column = self.text.lstrip("-").rpartition(":")[0] or self.text.lstrip("-")
        raise UsageError(f"--map {self.name}={self.text}: no column {column!r}. {close_names(column, columns)}")


def parse_maps(maps: Iterable[str] | Mapping[str, str] | None) -> dict[str, Source]:
    """From texts 'NAME=COLUMN[:UNIT]' or a dictionary NAME -> 'COLUMN[:UNIT]'."""
    if maps is None:
        return {}
    pairs = list(maps.items()) if isinstance(maps, Mapping) else [_split(text) for text in maps]
    out: dict[str, Source] = {}
    for name, text in pairs:
        if name not in SIGNALS and name not in TIMES:
            raise UsageError(f"--map {name}={text}: {name!r} is no signal. {close_names(name, (*TIMES, *SIGNALS))}")
        if name in out:
            raise UsageError(f"--map {name} is given twice")
        if not text.strip("- "):
            raise UsageError(f"--map {name}= names no column. Write --map {name}=COLUMN or --map {name}=COLUMN:UNIT")
        out[name] = Source(name, text)
    if "t_s" in out and "t_ns" in out:
        raise UsageError("--map t_s and --map t_ns are both given: a record has one time")
    return out


def _split(text: str) -> tuple[str, str]:
    name, equals, rest = text.partition("=")
    if not equals:
        raise UsageError(f"--map {text}: write NAME=COLUMN or NAME=COLUMN:UNIT, e.g. --map theta_rad=pos:counts/8192")
    return name.strip(), rest.strip()


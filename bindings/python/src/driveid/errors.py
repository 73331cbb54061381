# SPDX-License-Identifier: Apache-2.0
"""What can go wrong, as exceptions whose text names the place and the mend."""

from __future__ import annotations

import contextlib
import difflib
from collections.abc import Iterable


class DriveidError(Exception):
    """Base of all errors of this package."""


class UsageError(DriveidError):
    """The call or the command line contradicts itself or the files it names."""


class FileError(DriveidError):
    """A file cannot be read: place (file, line, column), cause, mend."""

    def __init__(self, path, message: str, *, line: int | None = None, column: str | None = None, mend: str = ""):
        place = str(path)
        if line is not None:
            place += f", line {line}"
        if column is not None:
            place += f", column {column!r}"
        super().__init__(f"{place}: {message}" + (f". {mend}" if mend else ""))
        self.path, self.line, self.column, self.mend = str(path), line, column, mend


class DataError(DriveidError):
    """The data cannot answer the question; `document` is the JSON document with verdict bad_data, where there is one."""

    def __init__(self, message: str, document: dict | None = None):
        super().__init__(message)
        self.document = document


class Cancelled(DriveidError):
    """The progress callback asked to stop."""


def close_names(name: str, there: Iterable[str]) -> str:
    """' Did you mean ...?' or the list of what is there."""
    there = [str(t) for t in there]
    lower = {t.lower(): t for t in there}
    near = [lower[n] for n in difflib.get_close_matches(name.lower(), lower, n=2, cutoff=0.6)]
    text = f"Did you mean {' or '.join(repr(n) for n in near)}? " if near else ""
    shown = ", ".join(there[:24]) + (f", and {len(there) - 24} more" if len(there) > 24 else "")
    return text + (f"There are: {shown}" if there else "There are none")


@contextlib.contextmanager
def asking(**names: str):
    """What the extension refuses (ValueError) as UsageError; names: what the caller calls an option of the library."""
    try:
        yield
    except ValueError as error:
        text = str(error)
        for name, called in names.items():
            text = text.replace(name, called)
        raise UsageError(text) from None

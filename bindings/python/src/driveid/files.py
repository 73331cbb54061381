# SPDX-License-Identifier: Apache-2.0
"""Writing files whole: a crash or a full disk never leaves half a file under the name that was asked for."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import FileError


def write_text(path: str | os.PathLike, text: str) -> None:
    path = Path(path)
    try:
        if path.exists() and not path.is_file():  # /dev/stdout, a pipe
            path.write_text(text, encoding="utf-8")
            return
        handle, name = tempfile.mkstemp(dir=path.parent or ".", prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            mask = os.umask(0)
            os.umask(mask)
            os.chmod(name, 0o666 & ~mask)
            os.replace(name, path)
        except BaseException:
            os.unlink(name)
            raise
    except OSError as e:
        raise FileError(path, f"cannot be written ({e.strerror})") from None


def read_text(path: str | os.PathLike) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise FileError(path, "is not UTF-8 text") from None
    except FileNotFoundError:
        raise FileError(path, "no such file") from None
    except OSError as e:
        raise FileError(path, f"cannot be read ({e.strerror})") from None

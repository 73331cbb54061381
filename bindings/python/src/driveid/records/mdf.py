# SPDX-License-Identifier: Apache-2.0
"""MDF4 through asammdf (an extra): every channel brought to the stamps of the longest channel group; frames of bus logging as other CAN logs."""

from __future__ import annotations

import gc
import sys
import traceback
from pathlib import Path

import numpy as np

from ..errors import FileError
from .dbc import bring
from .table import RawColumn, RawTable, to_ns


def _forget(error: Exception) -> None:
    """asammdf's half-made object complains when it is deleted: let it go now, unheard."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda *_: None
    try:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
    finally:
        sys.unraisablehook = hook


def _ask(path: Path, question):
    """question(file) of the opened file; whatever asammdf raises becomes one sentence."""
    try:
        from asammdf import MDF
    except ImportError:
        raise FileError(path, "needs asammdf", mend="pip install 'driveid[mdf]'") from None
    try:
        with MDF(path) as file:
            return question(file)
    except Exception as e:  # asammdf raises its own and struct's errors on a damaged file
        reason = f"{type(e).__name__}: {e}"
        _forget(e)
        raise FileError(path, f"is not a readable MDF file ({reason})") from None


def holds_frames(path: Path) -> bool:
    """Bus logging: raw CAN frames that a DBC decodes, instead of measured channels."""
    return _ask(path, lambda file: bool(getattr(file, "bus_logging_map", {}).get("CAN")))


def read_mdf(path: Path, digest: str) -> RawTable:
    signals = _ask(path, lambda file: [s for s in file.iter_channels(skip_master=True) if len(s.samples) and s.samples.ndim == 1 and s.samples.dtype.kind in "iufb"])
    if not signals:
        raise FileError(path, "holds no numeric channel")
    stamps = [to_ns(np.asarray(s.timestamps, dtype=np.float64), 1.0) for s in signals]
    t_ns = max(stamps, key=len)

    def loader(values: np.ndarray, own: np.ndarray):
        return lambda: values if np.array_equal(own, t_ns) else bring(own, values, t_ns)

    columns = [RawColumn(s.name, s.unit or None, loader(np.asarray(s.samples, dtype=np.float64), own)) for s, own in zip(signals, stamps)]
    return RawTable(str(path), digest, columns, len(t_ns), t_ns)

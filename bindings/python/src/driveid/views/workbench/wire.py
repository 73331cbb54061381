# SPDX-License-Identifier: Apache-2.0
"""Numbers for the browser: a JSON head and arrays behind it, little-endian, aligned to 8 bytes."""

from __future__ import annotations

import json
import struct

import numpy as np


def pack(head: dict, arrays: dict[str, np.ndarray]) -> bytes:
    """u32 length of the head, the head (padded with spaces), then each array; times as f64, values as f32."""
    parts, layout, offset = [], [], 0
    for name, array in arrays.items():
        kind = "f8" if name == "t" else "f4"
        data = np.ascontiguousarray(array, dtype="<" + kind).tobytes()
        layout.append({"name": name, "type": kind, "offset": offset, "count": int(array.size)})
        data += b"\0" * (-len(data) % 8)
        parts.append(data)
        offset += len(data)
    text = json.dumps({**head, "arrays": layout}, allow_nan=False).encode()
    text += b" " * (-(len(text) + 4) % 8)
    return struct.pack("<I", len(text)) + text + b"".join(parts)

# SPDX-License-Identifier: Apache-2.0
"""Reader of the gateway's record, written from docs/manual/record-format.md alone: it judges what driveidd wrote."""
import json
import struct
import zlib

ENTRY = struct.Struct("<IBBHqII")
SIGNALS = ["i_A", "i_d_A", "i_q_A", "v_V", "v_d_V", "v_q_V", "tau_Nm", "F_N", "theta_rad", "omega_rad_s", "theta_l_rad", "omega_l_rad_s",
           "x_m", "v_m_s", "T_degC", "u", "y"]
FRAME, SAMPLE, ESTIMATE = 1, 3, 6


def entries(path):
    """(kind, source, t_ns, payload) of every whole entry; any damage is an error here."""
    data = path.read_bytes()
    assert data[:8] == b"DRVIDREC" and struct.unpack_from("<I", data, 8) == (1,)
    at = 16 + struct.unpack_from("<I", data, 12)[0]
    while at < len(data):
        length, kind, _, source, t_ns, _, crc = ENTRY.unpack_from(data, at)
        whole = data[at:at + ENTRY.size + length]
        assert zlib.crc32(whole[:20] + b"\0\0\0\0" + whole[24:]) == crc, f"entry at byte {at}"
        yield kind, source, t_ns, whole[ENTRY.size:]
        at += len(whole)


def samples(path):
    """Decoded samples: (t_ns, {signal: value})."""
    for kind, _, t_ns, payload in entries(path):
        if kind == SAMPLE:
            present = struct.unpack_from("<I", payload)[0]
            names = [name for bit, name in enumerate(SIGNALS) if present >> bit & 1]
            yield t_ns, dict(zip(names, struct.unpack_from(f"<{len(names)}d", payload, 4)))


def estimates(path):
    for kind, _, t_ns, payload in entries(path):
        if kind == ESTIMATE:
            yield t_ns, json.loads(payload)

# SPDX-License-Identifier: Apache-2.0
"""Configurations out of an EDS: what the daemon reads with them out of SYNC and PDOs is what the package canopen encoded."""
import math
import os
import struct
import subprocess
import tomllib

import pytest

canopen = pytest.importorskip("canopen", reason="SKIPPED BECAUSE the package canopen is not installed (tools/setup installs it)")

NODE, COUNTS, CYCLE_S = 5, 20000, 0.002
VARIABLES = {0x6064: ("Position actual value", 4), 0x606C: ("Velocity actual value", 4), 0x6077: ("Torque actual value", 3), 0x6078: ("Current actual value", 3)}


def variable(section, name, kind, default=None, extra=""):
    return f"[{section}]\nParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\nPDOMapping=1\n" + (f"DefaultValue={default}\n" if default is not None else "") + extra + "\n"


def record(index, name, subs):
    head = f"[{index:X}]\nParameterName={name}\nObjectType=0x9\nSubNumber={len(subs)}\n\n"
    return head + "".join(variable(f"{index:X}sub{k:X}", f"{name} {k}", kind, default) for k, kind, default in subs)


def eds(maps, transmission=1, more=""):
    """maps: [{index: bits}] of the transmit PDOs 1, 2, ..."""
    text = "[FileInfo]\nFileName=drive.eds\nEDSVersion=4.0\n\n[DeviceInfo]\nVendorName=none\nProductName=drive\n\n"
    text += variable("1005", "COB-ID SYNC", 7, "0x40000080") + variable("1006", "Communication cycle period", 7, round(CYCLE_S * 1e6))
    for k, mapping in enumerate(maps):
        text += record(0x1800 + k, "TPDO communication", [(0, 5, 5), (1, 7, f"$NODEID+0x{0x180 + 0x100 * k:X}"), (2, 5, transmission), (5, 6, 4)])
        text += record(0x1A00 + k, "TPDO mapping", [(0, 5, len(mapping)), *((n + 1, 7, f"0x{index:04X}00{bits:02X}") for n, (index, bits) in enumerate(mapping.items()))])
    return text + "".join(variable(f"{i:X}", name, kind) for i, (name, kind) in VARIABLES.items()) + more


RATED = variable("6075", "Motor rated current", 7, 8000) + variable("6076", "Motor rated torque", 7, 2400) + record(0x608F, "Position encoder resolution", [(0, 5, 2), (1, 7, COUNTS), (2, 7, 1)])
TWO = [{0x6078: 16, 0x6077: 16}, {0x606C: 32, 0x6064: 32}]


def imported(driveid, text, *options):
    (driveid.folder / "drive.eds").write_text(text)
    code, _, err = driveid("config", "import-eds", "drive.eds", "--node", str(NODE), *options, "-o", "gw.toml")
    assert code == 0, err
    return tomllib.loads((driveid.folder / "gw.toml").read_text())["drive"][0], err


def samples(path):
    """[(t_ns, values)] of docs/manual/record-format.md."""
    data = path.read_bytes()
    at, out = 16 + struct.unpack_from("<II", data, 8)[1], []
    while at + 24 <= len(data):
        size, kind, _, _, t_ns = struct.unpack_from("<IBBHq", data, at)
        if kind == 3:
            out.append((t_ns, struct.unpack_from(f"<{(size - 4) // 8}d", data, at + 28)))
        at += 24 + size
    return out


def test_the_daemon_reads_what_canopen_encodes_at_the_instant_of_the_sync(driveid, daemon):
    drive, _ = imported(driveid, eds(TWO, more=RATED))
    assert drive["instant_can_id"] == 0x80 and drive["dt_s"] == CYCLE_S
    assert [s["name"] for s in drive["signal"]] == ["theta_rad", "i_q_A"]
    node = canopen.Network().add_node(NODE, str(driveid.folder / "drive.eds"))
    node.tpdo.read(from_od=True)
    lines, wanted = [], []
    for k in range(40):
        t = 1_700_000_000_000_000_000 + k * 2_000_000
        current, position = 37 * k - 400, 900 * k - 15000
        node.tpdo[1]["Current actual value"].raw, node.tpdo[1]["Torque actual value"].raw = current, 5 * k
        node.tpdo[2]["Position actual value"].raw, node.tpdo[2]["Velocity actual value"].raw = position, -k
        lines.append((t, 0x80, b""))
        lines += [(t + 300_000 + 200_000 * n, node.tpdo[n + 1].cob_id, bytes(node.tpdo[n + 1].data)) for n in range(2)]
        wanted.append((t, 2 * math.pi * position / COUNTS, current * 8.0 / 1000))
    (driveid.folder / "a.log").write_text("".join(f"({t // 10**9}.{t % 10**9 // 1000:06d}) can0 {i:03X}#{d.hex().upper()}\n" for t, i, d in lines))
    text = (driveid.folder / "gw.toml").read_text().replace('kind = "socketcan"\ninterface = "can0"', 'kind = "replay"\nfile = "a.log"\nspeed = 0.0')
    text = text.replace("/var/lib/driveid/records", str(driveid.folder)).replace("/run/driveid/control.sock", str(driveid.folder / "c.sock")).replace("[record]\n", '[record]\nfile = "out.drec"\n')
    (driveid.folder / "gw.toml").write_text(text)
    done = subprocess.run([daemon, "gw.toml", "--exit-at-end"], cwd=driveid.folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    got = samples(driveid.folder / "out.drec")
    assert len(got) == 40
    for (t, values), (t_sync, theta, current) in zip(got, wanted):
        assert t - got[0][0] == t_sync - wanted[0][0], "the instant is the SYNC's"
        assert sorted(values) == pytest.approx(sorted((theta, current)), abs=1e-12)


def test_event_driven_torque_and_speed(driveid, daemon):
    drive, err = imported(driveid, eds([{0x606C: 32, 0x6077: 16}], transmission=255), "--rated-torque", "3", "--velocity-unit", "rpm")
    assert "instant_can_id" not in drive and "by event" in err and drive["dt_s"] == 0.004
    speed, torque = drive["signal"]
    assert (speed["name"], speed["can_id"], speed["start_bit"], speed["scale"]) == ("omega_rad_s", 0x185, 0, pytest.approx(2 * math.pi / 60))
    assert (torque["name"], torque["start_bit"], torque["length"], torque["scale"]) == ("tau_Nm", 32, 16, pytest.approx(0.003))
    code, out, err = driveid("config", "check", "gw.toml", env=os.environ | {"DRIVEIDD": daemon})
    assert code == 0, out + err


@pytest.mark.parametrize("text, options, words", [
    (eds([{0x6078: 16}], more=RATED), [], "0x6064"),
    (eds([{0x6064: 32}], more=RATED), [], "0x6077"),
    (eds(TWO), [], "--counts-per-turn"),
    (eds(TWO), ["--counts-per-turn", "4096"], "--rated-current"),
    (eds(TWO, more=RATED), ["--structure", "linear_axis"], "--m-per-count"),
    ("no EDS at all", [], "not a readable EDS"),
])
def test_what_the_eds_does_not_tell_is_asked_for(driveid, text, options, words):
    (driveid.folder / "drive.eds").write_text(text)
    code, _, err = driveid("config", "import-eds", "drive.eds", "--node", str(NODE), *options)
    assert code == 2 and words in err and "Traceback" not in err


def test_a_file_that_is_not_there(driveid):
    code, _, err = driveid("config", "import-eds", "none.eds", "--node", "5")
    assert code == 2 and "none.eds" in err


def test_feed_constant_and_gear_make_the_units_of_a_turn(driveid):
    """CiA 402: 7200 units a turn of the shaft behind a gear of 10 are 720 a turn of the motor; a gear alone does not tell the units."""
    gear, feed = record(0x6091, "Gear ratio", [(0, 5, 2), (1, 7, 10), (2, 7, 1)]), record(0x6092, "Feed constant", [(0, 5, 2), (1, 7, 7200), (2, 7, 1)])
    drive, _ = imported(driveid, eds(TWO, more=RATED + gear + feed))
    assert next(s for s in drive["signal"] if s["name"] == "theta_rad")["counts_per_turn"] == 720
    (driveid.folder / "drive.eds").write_text(eds(TWO, more=RATED + gear))
    code, _, err = driveid("config", "import-eds", "drive.eds", "--node", str(NODE), "-o", "gw.toml")
    assert code == 2 and "--counts-per-turn" in err


def test_a_linear_axis_takes_the_current(driveid):
    drive, _ = imported(driveid, eds(TWO, more=RATED), "--structure", "linear_axis", "--m-per-count", "1e-6")
    assert {"i_q_A", "x_m"} <= {s["name"] for s in drive["signal"]}

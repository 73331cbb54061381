# SPDX-License-Identifier: Apache-2.0
"""Configurations for the gateway: templates and signals out of a DBC; driveidd itself is asked where it is built."""

import os
import tomllib

import pytest

DBC = """VERSION ""
BU_: d
BO_ 385 axis: 8 d
 SG_ Iq : 7|16@0- (0.5,0) [0|0] "mA" d
 SG_ pos : 16|20@1+ (1,0) [0|0] "" d
BO_ 2566844926 more: 8 d
 SG_ temp : 0|8@1+ (1,-40) [0|0] "degC" d
 SG_ omega : 32|32@1- (1,0) [0|0] "rpm" d
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 385 2;
SIG_VALTYPE_ 2566844926 omega : 1;
"""


@pytest.mark.parametrize("kind", ["can", "modbus", "replay"])
@pytest.mark.parametrize("structure", ["rigid_axis", "linear_axis"])
def test_templates_pass_the_daemons_check(driveid, kind, structure, request):
    code, out, _ = driveid("config", "new", "--bus", kind, "--structure", structure, "-o", "gw.toml")
    text = (driveid.folder / "gw.toml").read_text()
    assert code == 0 and tomllib.loads(text)["drive"][0]["structure"] == structure
    env = os.environ | {"DRIVEIDD": request.getfixturevalue("daemon")}
    (driveid.folder / "run.drec").write_bytes(b"")
    code, out, err = driveid("config", "check", "gw.toml", env=env)
    assert code == 0, out + err


def test_check_gives_the_daemons_words(driveid, daemon):
    (driveid.folder / "bad.toml").write_text('format = 1\n[contrl]\nsocket = "x"\n')
    code, out, err = driveid("config", "check", "bad.toml", env=os.environ | {"DRIVEIDD": daemon})
    assert code == 2 and "bad.toml" in out + err and "contrl" in out + err


def test_import_dbc(driveid, request):
    (driveid.folder / "d.dbc").write_text(DBC)
    code, out, err = driveid("config", "import-dbc", "d.dbc", "--map", "i_q_A=Iq", "--map", "theta_rad=pos:counts/4096", "--map", "T_degC=temp", "-o", "gw.toml")
    assert code == 0, err
    config = tomllib.loads((driveid.folder / "gw.toml").read_text())
    drive = config["drive"][0]
    assert drive["dt_s"] == 0.002
    signals = {s["name"]: s for s in drive["signal"]}
    assert signals["i_q_A"] | {"source": "can0", "can_id": 385, "start_bit": 7, "length": 16, "byte_order": "big", "signed": True, "scale": 0.0005} == signals["i_q_A"]
    assert signals["theta_rad"]["wrap_counts"] == 1 << 20 and signals["theta_rad"]["scale"] == pytest.approx(2 * 3.141592653589793 / 4096, rel=1e-15)
    assert signals["T_degC"]["offset"] == -40 and signals["T_degC"]["extended"] is True and signals["T_degC"]["can_id"] == 2566844926 & 0x1FFFFFFF
    assert signals["omega_rad_s"]["encoding"] == "f32" and signals["omega_rad_s"]["scale"] == pytest.approx(0.10471975511965977)
    code, out, err = driveid("config", "check", "gw.toml", env=os.environ | {"DRIVEIDD": request.getfixturevalue("daemon")})
    assert code == 0, out + err


def test_import_dbc_errors(driveid):
    (driveid.folder / "d.dbc").write_text(DBC.replace('"mA"', '""').replace('"rpm"', '""').replace('"degC"', '""'))
    code, _, err = driveid("config", "import-dbc", "d.dbc")
    assert code == 2 and "--map i_q_A=SIGNAL" in err and "Iq" in err
    code, _, err = driveid("config", "import-dbc", "none.dbc")
    assert code == 2 and "none.dbc" in err

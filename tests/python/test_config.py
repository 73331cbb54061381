# SPDX-License-Identifier: Apache-2.0
"""Configurations for the gateway: templates and signals out of a DBC; driveidd itself is asked where it is built."""

import os
import subprocess
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


PAGES = """VERSION ""
BU_: d
BO_ 512 mux: 8 d
 SG_ sel M : 7|8@0+ (1,0) [0|0] "" d
 SG_ i_q_A m3 : 8|16@1- (0.01,0) [0|0] "A" d
 SG_ T_degC m4 : 8|8@1+ (1,-40) [0|0] "degC" d
BO_ 2565866750 EEC: 8 d
 SG_ omega_rad_s : 24|16@1+ (0.125,0) [0|0] "rpm" d
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "ProtocolType" "";
BA_ "ProtocolType" "J1939";
BA_ "VFrameFormat" BO_ 2565866750 3;
"""


def test_import_dbc_with_pages_and_j1939_reads_what_cantools_encodes(driveid, daemon):
    """The imported configuration, run by the daemon over a log, gives the encoded values: the selector is Motorola, the signals are Intel."""
    import cantools

    (driveid.folder / "d.dbc").write_text(PAGES.replace("2565866750", str(0x80000000 | 0x0CF004FE)))
    pages, eec = cantools.database.load_file(driveid.folder / "d.dbc").messages
    code, _, err = driveid("config", "import-dbc", "d.dbc", "--structure", "rigid_axis", "--dt", "0.01", "-o", "gw.toml")
    assert code == 0, err
    text = (driveid.folder / "gw.toml").read_text()
    signals = {s["name"]: s for s in tomllib.loads(text)["drive"][0]["signal"]}
    assert signals["i_q_A"]["mux"] == {"start_bit": 0, "length": 8, "value": 3} and signals["T_degC"]["mux"]["value"] == 4
    assert signals["omega_rad_s"]["pgn"] == 0xF004 and "can_id" not in signals["omega_rad_s"]
    lines = []
    for k in range(50):
        t = 1_700_000_000 + 0.01 * k
        for offset, page in ((0, {"sel": 3, "i_q_A": 0.01 * k}), (1e-4, {"sel": 4, "T_degC": 20 + k})):
            lines.append(f"({t + offset:.6f}) can0 200#{pages.encode(page).hex()}")
        data = bytearray(eec.encode({"omega_rad_s": 10.0 * k}))
        if k == 30:
            data[3:5] = b"\xff\xff"  # not available
        lines.append(f"({t + 2e-4:.6f}) can0 18F004{k:02X}#{data.hex()}")
    (driveid.folder / "a.log").write_text("\n".join(lines) + "\n")
    text = text.replace('kind = "socketcan"\ninterface = "can0"', 'kind = "replay"\nfile = "a.log"\nspeed = 0.0').replace("/var/lib/driveid/records", str(driveid.folder))
    text = text.replace("/run/driveid/control.sock", str(driveid.folder / "c.sock")).replace("[record]\n", '[record]\nfile = "out.drec"\n')
    (driveid.folder / "gw.toml").write_text(text)
    done = subprocess.run([daemon, "gw.toml", "--exit-at-end"], cwd=driveid.folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    import driveid as package
    record = package.read(driveid.folder / "out.drec")
    speed = record["omega_rad_s"] * 30 / 3.141592653589793
    k = [j for j in range(50) if j != 30]
    assert record.rows == 49 and record["i_q_A"] == pytest.approx([0.01 * j for j in k]) and speed == pytest.approx([10.0 * j for j in k])
    assert record["T_degC"] == pytest.approx([20 + j for j in k])


@pytest.mark.parametrize("words", ['a "b', "back\\slash", "tab\tnew\nline", "del\x7f", "µ 🚗"])
def test_import_dbc_quotes_what_it_is_told(driveid, words):
    (driveid.folder / "d.dbc").write_text(DBC.replace('"degC"', '"a\nb"'))
    code, _, err = driveid("config", "import-dbc", "d.dbc", "--map", "i_q_A=Iq", "--map", "T_degC=temp:degC", "--drive", words, "--interface", words, "-o", "gw.toml")
    assert code == 0, err
    config = tomllib.loads((driveid.folder / "gw.toml").read_text())
    assert config["drive"][0]["name"] == words and config["source"][0]["interface"] == words


@pytest.mark.parametrize("dt", ["nan", "0", "inf", "-1", "1000"])
def test_import_refuses_a_sample_time_that_is_none(driveid, dt):
    (driveid.folder / "d.dbc").write_text(DBC)
    for arguments in (["import-dbc", "d.dbc", "--map", "i_q_A=Iq"], ["import-eds", "d.eds", "--node", "1"]):
        code, out, err = driveid("config", *arguments, "--dt", dt)
        assert code == 2 and out == "" and "--dt" in err, err


def test_import_keeps_the_sample_time_to_the_last_digit(driveid):
    (driveid.folder / "d.dbc").write_text(DBC)
    code, out, err = driveid("config", "import-dbc", "d.dbc", "--map", "i_q_A=Iq", "--dt", "0.00012345678")
    assert code == 0 and tomllib.loads(out)["drive"][0]["dt_s"] == 0.00012345678
    code, _, err = driveid("config", "import-dbc", "d.dbc", "--map", "i_q_A=Iq", "--structure", "rigid_axs")
    assert code == 2 and "Did you mean 'rigid_axis'" in err


def test_check_finds_the_daemon_that_the_clone_has_built(tmp_path, monkeypatch):
    """tools/setup makes .venv and build/ side by side: no $DRIVEIDD, nothing on the PATH."""
    from driveid.cli import settings
    monkeypatch.delenv("DRIVEIDD", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(settings.sys, "prefix", str(tmp_path / ".venv"))
    assert settings.find_daemon() is None
    program = tmp_path / "build/daemon/driveidd"
    program.parent.mkdir(parents=True)
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert settings.find_daemon() == str(program)

# SPDX-License-Identifier: Apache-2.0
"""CAN logs written by python-can, payloads encoded by cantools: the reader shares no code with either."""

import can
import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import driveid
from driveid.errors import FileError, UsageError
from driveid.records.canlog import parse_frame, stamp_ns
from driveid.records.frames import bit_positions, extract, unwrap

DBC = """VERSION ""
BU_: drive
BO_ 385 axis: 8 drive
 SG_ i_q : 7|16@0- (0.001,0) [0|0] "A" x
 SG_ pos : 16|16@1+ (1,0) [0|0] "counts" x
 SG_ mode m0 : 32|8@1+ (1,0) [0|0] "" x
BO_ 2566844926 volts: 8 drive
 SG_ v_d_V : 0|32@1- (1,0) [0|0] "V" x
 SG_ v_q_V : 32|12@1- (0.01,0) [0|0] "V" x
BO_ 512 mux: 8 drive
 SG_ sel M : 0|8@1+ (1,0) [0|0] "" x
 SG_ T m1 : 8|8@1+ (1,-40) [0|0] "degC" x
 SG_ other m2 : 8|16@1+ (1,0) [0|0] "" x
SIG_VALTYPE_ 2566844926 v_d_V : 1;
"""
DBC = DBC.replace(" SG_ mode m0 :", " SG_ mode :")
START = 1_700_000_000.0


@pytest.fixture(scope="module")
def dbc(tmp_path_factory):
    path = tmp_path_factory.mktemp("dbc") / "drive.dbc"
    path.write_text(DBC)
    return path


def messages(n=200):
    """Two messages at 1 kHz and 500 Hz; the position wraps at 16 bits; every tenth frame belongs to a multiplexer."""
    database = cantools.database.load_string(DBC, "dbc")
    k = np.arange(n)
    truth = {"t_s": START + k * 1e-3, "i_q_A": np.round(3 * np.sin(k / 20), 3), "counts": 60000 + 150 * k}
    out = []
    for j in range(n):
        t = round(START + j * 1e-3, 6)
        data = database.encode_message("axis", {"i_q": truth["i_q_A"][j], "pos": int(truth["counts"][j] % 65536), "mode": 3})
        out.append(can.Message(timestamp=t, arbitration_id=385, is_extended_id=False, data=data, channel="can0"))
        if j % 2 == 0:
            data = database.encode_message("volts", {"v_d_V": 0.5 * j, "v_q_V": round(0.01 * j, 2)})
            out.append(can.Message(timestamp=t + 2e-4, arbitration_id=2566844926 & 0x1FFFFFFF, is_extended_id=True, data=data, channel="can0"))
        if j % 10 == 0:
            values = {"sel": 1, "T": 20 + j // 10} if j % 20 == 0 else {"sel": 2, "other": 9}
            out.append(can.Message(timestamp=t + 4e-4, arbitration_id=512, is_extended_id=False, data=database.encode_message("mux", values), channel="can0"))
    return out, truth


def write(path, frames):
    with can.Logger(str(path)) as log:
        for m in frames:
            log.on_message_received(m)
    return path


@pytest.mark.parametrize("kind, stamp_ns_error", [("log", 0), ("asc", 1000), ("blf", 1000), ("mf4", 1000), ("trc", 1_000_000)])
def test_each_format_gives_the_same_table(tmp_path, dbc, kind, stamp_ns_error):
    frames, truth = messages()
    r = driveid.read(write(tmp_path / f"run.{kind}", frames), ["theta_rad=pos:counts/65536", "i_q_A=i_q", "T_degC=T"], dbc=dbc)
    n = len(truth["i_q_A"])
    assert r.rows == n
    expected = np.arange(n) * 1_000_000
    assert np.abs((r.t_ns - r.t_ns[0]) - expected).max() <= stamp_ns_error
    np.testing.assert_allclose(r["i_q_A"], truth["i_q_A"], atol=1e-12)
    np.testing.assert_allclose(r["theta_rad"], truth["counts"] * 2 * np.pi / 65536, rtol=1e-12)  # unwrapped, no jump
    inside = ~np.isnan(r["v_d_V"])
    assert inside.sum() >= n - 2 and any("interpolated" in x for x in r.notices)
    if kind != "trc":  # TRC keeps 0.1 ms: interpolation then moves a value by as much
        np.testing.assert_allclose(r["v_d_V"][inside], (0.5 * np.arange(n) - 0.1)[inside], atol=2e-3)
    T = r["T_degC"]
    assert np.nanmin(T) >= 20 and np.nanmax(T) <= 40  # the multiplexer's other page never shines through
    if kind == "log":
        assert r.t_ns[0] == 1_700_000_000 * 10**9


def test_fd_frames(tmp_path):
    text = 'BO_ 291 big: 64 x\n SG_ theta_rad : 400|64@1- (1,0) [0|0] "rad" x\nSIG_VALTYPE_ 291 theta_rad : 2;\n'
    dbc = tmp_path / "fd.dbc"
    dbc.write_text('VERSION ""\nBU_: x\n' + text)
    message = cantools.database.load_file(dbc).messages[0]
    frames = [can.Message(timestamp=k * 0.01, arbitration_id=291, is_extended_id=False, is_fd=True, data=message.encode({"theta_rad": k / 7})) for k in range(10)]
    r = driveid.read(write(tmp_path / "fd.log", frames), dbc=dbc)
    assert r["theta_rad"].tolist() == [k / 7 for k in range(10)]


def test_lines_of_candump(tmp_path, dbc):
    good = "(1700000000.000001) can0 181#0001000200000000"
    text = "\n".join([good, "garbage", "(x) can0 181#00", "(1700000000.000002) can0 20000004#0000000000000000", "(1700000000.000003) can0 181#R",
                      "(1700000000.000004) can0 181#000", " (1700000000.000005)  can0  181   [8]  00 02 00 02 00 00 00 00", "(1700000000.000006) can0 181##0000300020000"])
    (tmp_path / "a.log").write_text(text)
    r = driveid.read(tmp_path / "a.log", ["i_q_A=i_q"], dbc=dbc)
    assert (r.t_ns - 1_700_000_000 * 10**9).tolist() == [1000, 5000, 6000]
    np.testing.assert_allclose(r["i_q_A"], [1e-3, 2e-3, 3e-3])
    assert any("3 lines that are no frames" in n for n in r.notices) and any("1 error frames" in n for n in r.notices)


def test_parsing_of_stamps_and_frames():
    assert stamp_ns("1436509052.249713") == 1_436_509_052_249_713_000
    assert stamp_ns("0.5") == 500_000_000
    assert parse_frame("123#DEADBEEF") == (0x123, bytes.fromhex("deadbeef"))
    assert parse_frame("18FEF100#") == (0x98FEF100, b"")
    for bad in ("12#00", "123", "123#0", "123#001122334455667788", "xyz#00"):
        with pytest.raises(ValueError):
            parse_frame(bad)


@settings(max_examples=200, deadline=None)
@given(st.binary(min_size=8, max_size=8), st.integers(0, 63), st.integers(1, 64), st.booleans(), st.booleans())
def test_bit_fields_against_cantools(data, start, length, little, signed):
    try:
        signal = cantools.database.can.Signal("s", start, length, "little_endian" if little else "big_endian", is_signed=signed)
        message = cantools.database.can.Message(1, "m", 8, [signal], strict=True)
    except cantools.database.Error:
        return  # the field does not fit
    raw, ok = extract(np.frombuffer(data, dtype=np.uint8).reshape(1, 8), np.array([8]), start, length, little, signed)
    expected = message.decode(data)["s"]
    assert ok[0] and (int(raw[0]) if signed or length < 64 else int(raw.view(np.uint64)[0])) == expected


def test_short_payload_is_no_value():
    raw, ok = extract(np.zeros((2, 8), dtype=np.uint8), np.array([8, 3]), 24, 16, True, False)
    assert ok.tolist() == [True, False]
    assert bit_positions(7, 16, False)[-1] == 7


@given(st.lists(st.integers(-100, 100), min_size=1, max_size=50), st.integers(0, 255))
def test_unwrap_follows_a_counter(steps, first):
    true = first + np.concatenate(([0], np.cumsum(steps)))
    assert np.array_equal(unwrap(true % 256, 256) - first, true - first)


def test_errors(tmp_path, dbc):
    frames, _ = messages(3)
    path = write(tmp_path / "run.log", frames)
    with pytest.raises(UsageError, match="--dbc FILE.dbc.*181"):
        driveid.read(path)
    other = tmp_path / "other.dbc"
    other.write_text('VERSION ""\nBU_: x\nBO_ 99 m: 8 x\n SG_ s : 0|8@1+ (1,0) [0|0] "" x\n')
    with pytest.raises(FileError, match="no identifier of the log is in the database"):
        driveid.read(path, dbc=other)
    other.write_text("BO_ nonsense")
    with pytest.raises(FileError, match="other.dbc.*not a readable database"):
        driveid.read(path, dbc=other)
    (tmp_path / "empty.log").write_text("nothing here\n")
    with pytest.raises(FileError, match="holds no CAN data frame"):
        driveid.read(tmp_path / "empty.log", dbc=dbc)
    (tmp_path / "bad.blf").write_bytes(b"LOGG" + bytes(200))
    with pytest.raises(FileError, match="BLF"):
        driveid.read(tmp_path / "bad.blf", dbc=dbc)
    with pytest.raises(UsageError, match="no column 'iq'. Did you mean 'i_q'"):
        driveid.read(path, ["i_q_A=iq"], dbc=dbc)


J1939 = """VERSION ""
BU_: x
BO_ 2565867774 EEC: 8 x
 SG_ omega_rad_s : 24|16@1+ (0.125,0) [0|0] "rpm" x
 SG_ T_degC : 0|8@1+ (1,-40) [0|0] "degC" x
BO_ 2564849406 told : 8 x
 SG_ i_A : 0|16@1+ (0.05,-1600) [0|0] "A" x
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_ "ProtocolType" STRING ;
BA_DEF_DEF_ "VFrameFormat" "J1939PG";
BA_DEF_DEF_ "ProtocolType" "";
BA_ "ProtocolType" "J1939";
BA_ "VFrameFormat" BO_ 2565867774 3;
BA_ "VFrameFormat" BO_ 2564849406 3;
"""


def test_j1939_groups_of_any_priority_sender_and_destination(tmp_path):
    """PGN 0xF004 is broadcast; 0xEF00 is addressed, so that its low byte is the destination. 0xFE.. and 0xFF.. are error and 'not available'."""
    text = J1939.replace("2565867774", str(0x80000000 | 0x0CF004FE)).replace("2564849406", str(0x80000000 | 0x18EF00FE)).replace("told :", "told:")
    (tmp_path / "j.dbc").write_text(text)
    eec, told = cantools.database.load_file(tmp_path / "j.dbc").messages
    assert {eec.protocol, told.protocol} == {"j1939"}
    frames = []
    for k in range(40):
        t = round(START + 0.01 * k, 6)
        frames.append(can.Message(timestamp=t, arbitration_id=(0x18F00411, 0x0CF00422)[k % 2], is_extended_id=True, data=eec.encode({"omega_rad_s": 100.0 + k, "T_degC": 20 + k})))
        frames.append(can.Message(timestamp=t + 1e-4, arbitration_id=0x1CEF0000 | k << 8 | 0x33, is_extended_id=True, data=told.encode({"i_A": 0.05 * k})))
    frames[20].data[3:5] = b"\xff\xff"
    frames[22].data[0] = 0xFE
    frames.append(can.Message(timestamp=START + 9, arbitration_id=0x18F00511, is_extended_id=True, data=bytes(8)))  # another group
    r = driveid.read(write(tmp_path / "j.log", frames), dbc=tmp_path / "j.dbc")
    assert r.rows == 40 and any("PGN 61444) comes from 2 identifiers" in n for n in r.notices)
    speed = r["omega_rad_s"] * 60 / (2 * np.pi)
    np.testing.assert_allclose(speed[:-1], 100.01 + np.arange(39), rtol=1e-6)  # at the instants of i_A, 0.1 ms later; not 8191.875 where it is not available
    assert np.nanmax(r["T_degC"]) < 60
    np.testing.assert_allclose(r["i_A"], 0.05 * np.arange(40), atol=1e-9)


def test_a_page_of_a_page(tmp_path):
    (tmp_path / "m.dbc").write_text("""VERSION ""
BU_: x
BO_ 512 mux: 8 x
 SG_ outer M : 0|4@1+ (1,0) [0|0] "" x
 SG_ inner m1M : 4|4@1+ (1,0) [0|0] "" x
 SG_ i_q_A m2 : 8|16@1- (0.01,0) [0|0] "A" x
 SG_ T_degC m2 : 8|16@1- (0.01,0) [0|0] "degC" x
SG_MUL_VAL_ 512 inner outer 1-1;
SG_MUL_VAL_ 512 i_q_A inner 2-3, 5-5;
SG_MUL_VAL_ 512 T_degC outer 2-2;
""")
    message = cantools.database.load_file(tmp_path / "m.dbc").messages[0]
    pages = [{"outer": 1, "inner": 2}, {"outer": 1, "inner": 5}, {"outer": 2}]
    frames = []
    for k in range(30):
        page = pages[k % 3]
        name = "i_q_A" if page["outer"] == 1 else "T_degC"
        frames.append(can.Message(timestamp=round(START + 0.001 * k, 6), arbitration_id=512, is_extended_id=False, data=message.encode({**page, name: 0.01 * k})))
    frames.append(can.Message(timestamp=START + 0.03, arbitration_id=512, is_extended_id=False, data=bytes([0x22, 0, 127])))  # inner 2, but on another page of outer
    r = driveid.read(write(tmp_path / "m.log", frames), dbc=tmp_path / "m.dbc")
    np.testing.assert_allclose(r["i_q_A"], [0.01 * k for k in range(30) if k % 3 != 2])


def test_mdf_of_frames_needs_a_database_and_is_replayed(tmp_path, dbc):
    from driveid import bus

    frames, _ = messages(20)
    path = write(tmp_path / "run.mf4", frames)
    with pytest.raises(UsageError, match="--dbc FILE.dbc.*181"):
        driveid.read(path)
    assert sorted(data for _, _, _, data in bus.load_frames(path)) == sorted(bytes(m.data) for m in frames)
    (tmp_path / "cut.mf4").write_bytes(path.read_bytes()[:700])
    with pytest.raises(FileError, match="cut.mf4"):
        driveid.read(tmp_path / "cut.mf4", dbc=dbc)

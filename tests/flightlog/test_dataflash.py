"""ArduPilot's logs, binary and text, against pymavlink's reader and against what was written."""

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flightlog.errors import UserError
from flightlog.readers import read_log
from flightlog.readers.dataflash import parse
from flightlog.readers.row_clock import RowClock
from tests.flightlog.log_writers import dataflash

FUZZ = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80)

NEW = {
    "IMU": ("QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
    "BARO": ("QBffc", "TimeUS,I,Alt,Press,Temp"),
    "GPS": ("QBBIHBcLLeffff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw"),
    "RFND": ("QBCBB", "TimeUS,Instance,Dist,Stat,Orient"),
    "MAG": ("QBhhh", "TimeUS,I,MagX,MagY,MagZ"),
    "ATT": ("QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "BAT": ("QBff", "TimeUS,Inst,Volt,Curr"),
    "CTUN": ("Qff", "TimeUS,ThI,ThO"),
    "RCOU": ("QHHHHH", "TimeUS,C1,C2,C3,C4,C5"),
    "ESC": ("QBf", "TimeUS,Instance,RPM"),
    "PARM": ("QNf", "TimeUS,Name,Value"),
    "MSG": ("QZ", "TimeUS,Message"),
}


def rows(steps=60):
    """A second and a bit of a quadrotor's log, raw values as the firmware packs them."""
    parameters = {"SERVO1_FUNCTION": 34, "SERVO2_FUNCTION": 33, "MOT_PWM_MIN": 1000, "MOT_PWM_MAX": 2000,
                  "COMPASS_DEC": 0.1}  # fmt: skip
    out = [("PARM", (1, name, value)) for name, value in parameters.items()]
    out.append(("MSG", (5, "ArduCopter V4.5.7")))
    for k in range(steps):
        t, sway = 1_000_000 + 20_000 * k, 0.01 * np.sin(k)
        for device in (0, 1):
            out.append(("IMU", (t, device, 0.1 + sway, 0.2, 0.3 + sway, sway, 1.0 + sway, -9.8 + sway)))
            out.append(("BARO", (t, device, 0.1 * k + device, 1e5 - k, 2500 + k)))
            out.append(("ESC", (t + device, device, 6000.0 + 600.0 * device + k)))
        out.append(("ATT", (t, 0, 100 + k, 0, -200, 0, 35_900)))
        out.append(("RFND", (t, 0, 150 + k, 4 if k % 3 else 2, 25)))
        out.append(("MAG", (t, 0, 200 + k % 2, 30, 420)))
        out.append(("RCOU", (t, 1200 + k, 1300, 0, 0, 0)))
        out.append(("CTUN", (t, 0.4, 0.5)))
        out.append(("BAT", (t, 0, 15.0 - 0.01 * k, 20.0)))
        if k % 10 == 0:
            place = (round((47.0 + 1e-5 * k) * 1e7), round((8.0 - 1e-5 * k) * 1e7), 45_000 + 10 * k)
            out.append(("GPS", (t, 0, 3 if k else 1, 7, 2000, 12, 90, *place, 5.0, 90.0, -1.5, 0.0)))
    return out


@pytest.fixture
def new(tmp_path):
    path = tmp_path / "0001.BIN"
    path.write_bytes(dataflash(NEW, rows()))
    return path


def test_messages_are_those_that_pymavlink_reads(new):
    DFReader = pytest.importorskip("pymavlink.DFReader")
    messages, notes = parse(new)
    assert notes == []
    reader, theirs = DFReader.DFReader_binary(str(new), zero_time_base=False), defaultdict(list)
    while (message := reader.recv_msg()) is not None:
        theirs[message.get_type()].append(message.to_dict())
    assert theirs.keys() - {"FMT"} == messages.keys()
    for name, found in messages.items():
        for column, values in found.columns.items():
            right = [row[column] for row in theirs[name]]
            assert values.tolist() == pytest.approx(right) if values.dtype.kind == "f" else values.tolist() == right


def test_topics_in_our_axes_and_units(new):
    log = read_log(new)
    tables = log.tables
    assert log.kind == "dataflash" and log.timed == tables.keys()
    assert sorted(tables) == [
        "actuators", "baro", "baro_2", "battery", "controls", "estimate", "gps", "imu", "imu_2", "mag", "rotor", "sonar"
    ]  # fmt: skip
    k = np.arange(60)
    imu = tables["imu"]
    np.testing.assert_allclose(imu["t"], 1.0 + 0.02 * k)
    np.testing.assert_allclose(imu["fz"], 9.8 - 0.01 * np.sin(k), atol=1e-5)
    np.testing.assert_allclose(imu["fy"], -1.0 - 0.01 * np.sin(k), atol=1e-5)
    np.testing.assert_allclose(imu["wx"], 0.1 + 0.01 * np.sin(k), atol=1e-6)
    np.testing.assert_allclose(imu["wy"], -0.2, atol=1e-6)
    np.testing.assert_allclose(tables["baro_2"]["altitude"], 0.1 * k + 1.0, atol=1e-5)
    np.testing.assert_allclose(tables["baro"]["temperature"], 298.15 + 0.01 * k)
    gps = tables["gps"]
    assert gps["valid"].tolist() == [False, *[True] * 5]
    np.testing.assert_allclose(gps["u"], 0.1 * np.arange(0, 60, 10) - 3.0, atol=1e-6)
    np.testing.assert_allclose(gps["ve"], 5.0)
    np.testing.assert_allclose(gps["vn"], 0.0, atol=1e-6)
    np.testing.assert_allclose(gps["vu"], 1.5)
    np.testing.assert_allclose(np.diff(gps["n"]), 1e-4 * np.pi / 180 * 6.368e6, rtol=2e-3)
    assert np.all(np.diff(gps["e"]) < 0.0)
    np.testing.assert_allclose(tables["sonar"]["range"], 1.5 + 0.01 * k)
    assert tables["sonar"]["valid"].tolist() == (k % 3 > 0).tolist()
    np.testing.assert_allclose(tables["mag"]["mz"], -42.0)
    estimate = tables["estimate"]
    np.testing.assert_allclose(estimate["roll"], np.radians(1.0 + 0.01 * k))
    np.testing.assert_allclose(estimate["pitch"], np.radians(-2.0))
    np.testing.assert_allclose(estimate["heading"], np.radians(359.0))
    # the outputs' functions: the first drives motor 2, the second motor 1
    np.testing.assert_allclose(tables["actuators"]["m2"], 0.2 + 1e-3 * k)
    np.testing.assert_allclose(tables["actuators"]["m1"], 0.3)
    np.testing.assert_allclose(tables["controls"]["throttle"], 0.5)
    np.testing.assert_allclose(tables["rotor"]["speed2"], (6600.0 + k) * 2 * np.pi / 60, rtol=1e-4)
    assert log.document["parameters"]["COMPASS_DEC"] == pytest.approx(0.1)


@given(st.data())
@FUZZ
def test_cut_anywhere_it_gives_its_whole_messages(new, data):
    whole = new.read_bytes()
    kept = data.draw(st.integers(0, len(whole)))
    path = new.with_name("cut.BIN")
    path.write_bytes(whole[:kept])
    try:
        messages, notes = parse(path)
    except UserError:
        assert kept < 2200  # its formats alone
        return
    complete, _ = parse(new)
    for name, found in messages.items():
        for column, values in found.columns.items():
            np.testing.assert_array_equal(values, complete[name][column][: len(found)])
    lost = sum(map(len, complete.values())) - sum(map(len, messages.values()))
    assert (lost > 0) == (kept < len(whole))
    assert len(notes) <= 1


def test_a_message_whose_type_is_broken_into_that_of_a_format_costs_itself_alone(new):
    whole, complete = new.read_bytes(), parse(new)[0]
    starts = sorted(int(place) for found in complete.values() for place in found.place)
    path = new.with_name("broken.BIN")
    for start in starts[10:-10:7]:
        broken = bytearray(whole)
        broken[start + 2] = 0x80
        path.write_bytes(broken)
        lost = sum(map(len, complete.values())) - sum(map(len, parse(path)[0].values()))
        assert lost == 1


@given(st.data())
@FUZZ
def test_broken_bytes_cost_no_more_than_their_messages(new, data):
    whole = bytearray(new.read_bytes())
    first = whole.index(b"ArduCopter")
    start = data.draw(st.integers(first, len(whole) - 1))
    noise = data.draw(st.binary(min_size=1, max_size=40))
    whole[start : start + len(noise)] = noise
    path = new.with_name("broken.BIN")
    path.write_bytes(whole)
    messages, _ = parse(path)
    complete, _ = parse(new)
    assert sum(map(len, messages.values())) >= sum(map(len, complete.values())) - 4
    try:
        read_log(path)
    except UserError as error:
        assert "\n" not in str(error)


@given(st.binary(max_size=400), st.booleans())
@FUZZ
def test_any_bytes_behind_the_mark_are_a_log_or_one_clear_line(tmp_path, noise, binary):
    path = tmp_path / "noise.BIN"
    path.write_bytes((b"\xa3\x95" if binary else b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n") + noise)
    with pytest.raises(UserError) as caught:
        read_log(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


# --- text -------------------------------------------------------------------------------------------------------------

OLD = """
ArduCopter V3.0.1
FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format
FMT, 130, 35, GPS, BIBcLLeeEe, Status,Time,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs
FMT, 4, 25, CTUN, hcefhhhhh, ThrIn,SonAlt,BarAlt,WPAlt,NavThr,AngBst,CRate,ThrOut,DCRate
FMT, 1, 17, ATT, cccccCC, RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw
FMT, 9, 19, CURR, hIhhhf, Thr,ThrInt,Volt,Curr,Vcc,CurrTot
FMT, 129, 23, PARM, Nf, Name,Value
PARM, {parameter}, 1000.000000
"""


def old(parameter="HS1_MIN", fixes=30, pause=None):
    """A helicopter's text log whose CTUN, ATT and CURR rows carry no time: five rows between fixes 0.2 s apart."""
    lines = [OLD.format(parameter=parameter).strip()]
    for k in range(fixes):
        time = 1000.0 + 0.2 * k + (40.0 if pause is not None and k >= pause else 0.0)
        lines.append(f"GPS, 3, {time * 1000:.0f}, 10, 1.49, 24.2398205, 54.5793101, 0.19, {9.0 + k:.2f}, 0.01, 347.24")
        for j in range(2):
            lines.append(f"CTUN, 336, {0.5 + 0.1 * j:.2f}, {k + 0.5 * j:.2f}, 0.0, 0, 0, 0, {400 + k}, 0")
            lines.append("ATT, 0.00, 1.50, 0.00, -2.50, 0.00, 215.88, 215.88")
    lines.append("CURR, 337, 2021, 1232, 150, 4772, 0.000000")
    return "\n".join(lines) + "\n"


def write(tmp_path, text):
    path = tmp_path / "old.log"
    path.write_text(text)
    return path


def test_rows_without_a_time_are_placed_by_their_order_and_marked(tmp_path):
    log = read_log(write(tmp_path, old()))
    assert log.timed == {"gps"}
    assert any("CTUN: rows carry no time" in note for note in log.notes)
    baro, sonar, gps = log.tables["baro"], log.tables["sonar"], log.tables["gps"]
    k = np.repeat(np.arange(30), 2) + np.tile([0.2, 0.6], 30)
    np.testing.assert_allclose(baro["t"], 1000.0 + 0.2 * k, atol=1e-9)
    np.testing.assert_allclose(baro["altitude"], np.repeat(np.arange(30), 2) + np.tile([0.0, 0.5], 30))
    np.testing.assert_allclose(sonar["range"], np.tile([0.5, 0.6], 30))
    np.testing.assert_allclose(gps["u"], np.arange(30) - 7.5, atol=1e-9)  # 3 s of fixes are the ground
    np.testing.assert_allclose(log.tables["estimate"]["heading"], np.radians(215.88))
    assert log.tables["battery"]["voltage"][0] == pytest.approx(12.32)


@pytest.mark.parametrize(("parameter", "column"), [("HS1_MIN", "collective"), ("TUNE", "throttle")])
def test_a_helicopter_s_lift_is_its_collective(tmp_path, parameter, column):
    controls = read_log(write(tmp_path, old(parameter))).tables["controls"]
    np.testing.assert_allclose(controls[column], np.repeat(0.4 + 1e-3 * np.arange(30), 2))
    assert controls.unit(column) == "1"


def test_rows_in_a_pause_follow_what_was_before(tmp_path):
    log = read_log(write(tmp_path, old(pause=10)))
    t = log.tables["baro"]["t"]
    assert np.diff(t).max() == pytest.approx(40.0, abs=0.3)
    assert t[19] == pytest.approx(1000.0 + 0.2 * 9.6)  # the last before the pause stands as ever
    assert any("in a pause of the log" in note for note in log.notes)


def test_broken_lines_cost_only_themselves(tmp_path):
    lines = old().splitlines()
    tuning = [number for number, line in enumerate(lines) if line.startswith("CTUN")]
    lines[tuning[8]] = "CTUN, 336, 0.5"
    lines[tuning[20]] = lines[tuning[20]].replace("CTUN, 336,", "CTUN, x,")
    log = read_log(write(tmp_path, "\n".join(lines)))
    assert len(log.tables["baro"]) == 59
    assert any("1 line(s) left out" in note for note in log.notes)
    assert any("the last line has no end" in note for note in log.notes)


def test_a_format_declared_anew_begins_anew(tmp_path):
    lines = old().splitlines()
    wide = "FMT, 1, 19, ATT, cccccCCh, RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw,Err"
    again = [line + ", 7" if line.startswith("ATT") else line for line in lines[-50:]]
    log = read_log(write(tmp_path, "\n".join([*lines, wide, *again])))
    assert len(log.tables["estimate"]) == 60  # the longer part; rows of two shapes are not mixed
    path = tmp_path / "again.BIN"
    path.write_bytes(dataflash({"A": ("Qf", "TimeUS,X")}, [("A", (k, 1.0)) for k in range(9)])
                     + dataflash({"A": ("Qd", "TimeUS,Y")}, [("A", (k, 2.0)) for k in range(5)]))  # fmt: skip
    messages, _ = parse(path)
    assert messages["A"]["X"].tolist() == [1.0] * 9


@given(st.data())
@FUZZ
def test_text_with_anything_in_it_is_a_log_or_one_clear_line(tmp_path, data):
    text = old(fixes=6)
    start = data.draw(st.integers(0, len(text)))
    stop = data.draw(st.integers(start, min(len(text), start + 60)))
    path = tmp_path / "old.log"
    changed = text[:start] + data.draw(st.text(max_size=20)) + text[stop:]
    path.write_text(changed, "utf-8", "surrogatepass")
    try:
        read_log(path)
    except UserError as error:
        assert "\n" not in str(error)


@given(st.lists(st.floats(0.05, 0.4), min_size=3, max_size=30), st.data())
def test_the_row_clock_never_runs_backward(steps, data):
    place = np.cumsum(data.draw(st.lists(st.integers(1, 9), min_size=len(steps), max_size=len(steps))))
    clock = RowClock(place, np.cumsum(steps))
    t, _ = clock.at(np.arange(-5, place[-1] + 9))
    assert np.all(np.diff(t) >= -1e-9)
    np.testing.assert_allclose(clock.at(place)[0], np.cumsum(steps))

import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from flightlog.errors import UserError
from flightlog.readers import read_log
from flightlog.rotations import from_angles

FUZZ = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=80)


def hover(rows=40, rate=50.0):
    t = np.arange(rows) / rate
    wave = 0.01 * np.sin(7.0 * t)
    return {"t": t, "fx": wave, "fy": -wave, "fz": 9.8 + wave, "wx": wave, "wy": wave, "wz": -wave}


def text(columns):
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    cells = (["" if v != v else str(v) for v in row] for row in rows)
    return "\n".join([",".join(columns), *(",".join(row) for row in cells)]) + "\n"


@pytest.fixture
def write(tmp_path):
    def write(name, content):
        path = tmp_path / name
        data = content if isinstance(content, bytes) else content.encode()
        path.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
        return path

    return write


# --- shapes -----------------------------------------------------------------------------------------------------------


def test_a_folder_of_topics(write, tmp_path):
    write("imu.csv", text(hover()))
    write("baro.csv.gz", text({"t": [0.0, 0.1], "altitude": [1.0, 2.0], "humidity": [40.0, 41.0]}))
    write("baro_2.csv", text({"t": [0.0, 0.1], "altitude": [1.5, 2.5]}))
    write("gps.csv", text({"t": [0.0, 0.2], "u": [3.0, 4.0], "valid": ["true", "false"]}))
    write("compass.csv", text({"t": [0.0], "mx": [1.0]}))
    log = read_log(tmp_path)
    assert log.kind == "csv"
    assert sorted(log.tables) == ["baro", "baro_2", "gps", "imu"]
    np.testing.assert_array_equal(log.tables["imu"]["fz"], hover()["fz"])
    assert log.tables["baro"]["humidity"].tolist() == [40.0, 41.0]
    assert log.tables["gps"]["valid"].tolist() == [True, False]
    assert log.timed == log.tables.keys()
    assert any("compass.csv: left out" in note for note in log.notes)


def test_one_topic_alone(write):
    log = read_log(write("imu.csv", text(hover())))
    assert list(log.tables) == ["imu"] and len(log.tables["imu"]) == 40


def test_narrow(write):
    lines = ["t,topic,column,value"]
    columns = hover(20)
    for k, t in enumerate(columns["t"]):
        lines += [f"{t},imu,{name},{columns[name][k]}" for name in columns if name != "t"]
        lines += [f"{t},baro,altitude,{k}"]
    log = read_log(write("log.csv", "\n".join(lines)))
    assert {name: len(table) for name, table in log.tables.items()} == {"imu": 20, "baro": 20}
    for name, values in columns.items():
        np.testing.assert_array_equal(log.tables["imu"][name], values)


def test_wide_by_our_names_with_topics_at_rates_of_their_own(write):
    columns = {("t" if name == "t" else f"imu.{name}"): values for name, values in hover().items()}
    columns["baro.altitude"] = np.where(np.arange(40) % 10 == 0, 5.0, np.nan)
    log = read_log(write("log.csv", text(columns)))
    assert len(log.tables["imu"]) == 40
    assert log.tables["baro"]["t"].tolist() == hover()["t"][::10].tolist()


MAPPING = """
time = {column = "ms", unit = "ms"}
[columns]
"x" = {to = "estimate.n"}
"z" = {to = "estimate.u"}
"roll" = {to = "estimate.roll", unit = "deg"}
"yaw" = {to = "estimate.yaw", unit = "deg"}
"ax" = {to = "imu.fx", unit = "g"}
"ay" = {to = "imu.fy", unit = "g"}
"az" = {to = "imu.fz", unit = "g"}
"batt" = {to = "battery.voltage", unit = "mV"}
"pwm" = {to = "controls.m1", scale = 1e-3, offset = -1.0}
"volts" = {to = "controls.pump", unit = "mV"}
"""


def mapped(rows=20):
    k = np.arange(rows)
    return {
        "ms": 20.0 * k, "x": 0.1 * k, "z": -0.2 * k, "roll": k - 5.0, "yaw": 10.0 + k, "ax": 0.01 * k, "ay": 0.02 * k,
        "az": -1.0 - 0.001 * k, "batt": 3700.0 - k, "pwm": 1500.0 + k, "volts": 1000.0 * k, "more": k,
    }  # fmt: skip


@pytest.mark.parametrize("body", ["FLU", "FRD"])
@pytest.mark.parametrize("world", ["ENU", "NED"])
def test_wide_by_a_mapping(write, world, body):
    write("log.csv.mapping.toml", MAPPING + f'[frames]\nworld = "{world}"\nbody = "{body}"\n')
    columns = mapped()
    if body == "FLU":
        columns["az"] = -columns["az"]
    tables = read_log(write("log.csv", text(columns))).tables
    k = np.arange(20)
    estimate, imu, controls = tables["estimate"], tables["imu"], tables["controls"]
    np.testing.assert_allclose(estimate["t"], 0.02 * k)
    np.testing.assert_allclose(estimate["n"], 0.1 * k)
    np.testing.assert_allclose(estimate["u"], (0.2 if world == "NED" else -0.2) * k)
    np.testing.assert_allclose(estimate["roll"], np.radians(k - 5.0))
    heading = 10.0 + k if world == "NED" else 80.0 - k
    np.testing.assert_allclose(estimate["heading"], np.radians(heading))
    np.testing.assert_allclose(imu["fx"], 0.01 * k * 9.80665)
    np.testing.assert_allclose(imu["fy"], (-0.02 if body == "FRD" else 0.02) * k * 9.80665)
    assert np.all(imu["fz"] > 9.0)
    np.testing.assert_allclose(tables["battery"]["voltage"], 3.7 - 1e-3 * k)
    np.testing.assert_allclose(controls["m1"], 0.5 + 1e-3 * k)
    assert controls.unit("pump") == "mV"  # a column of one's own keeps its unit


def test_a_quaternion_of_other_axes_is_turned_to_ours(write):
    roll, pitch, heading = np.full(20, 0.2), np.full(20, -0.1), np.linspace(0.5, 2.0, 20)
    ours = from_angles(roll, pitch, heading)
    # north, east, down and forward, right, down: yaw about down, then pitch about right, roll about forward
    theirs = Rotation.from_euler("ZYX", np.column_stack([heading, pitch, roll])).as_quat()
    columns = {"t": np.arange(20) / 50, **{f"q{i}": theirs[:, j] for i, j in enumerate((3, 0, 1, 2))}}
    rows = "\n".join(f'"q{i}" = {{to = "reference.q{c}"}}' for i, c in enumerate("wxyz"))
    frames = '[frames]\nworld = "NED"\nbody = "FRD"'
    mapping = write("m.toml", f'time = {{column = "t"}}\n[columns]\n{rows}\n{frames}\n')
    table = read_log(write("log.csv", text(columns)), mapping).tables["reference"]
    found = Rotation.from_quat(table.stack("qx", "qy", "qz", "qw"))
    assert (found * ours.inv()).magnitude().max() < 1e-12


def test_rows_by_a_step_and_a_mark_of_byte_order(write):
    mapping = write("m.toml", 'time = {step = 0.01}\n[columns]\n"Pitch [rad]" = {to = "joints.pitch"}\n')
    rows = "\r\n".join(f"{0.01 * k},{0.01 if k == 0 else ''}" for k in range(30))
    path = write("data.csv", b"\xef\xbb\xbf" + f"Pitch [rad],Sample time\r\n{rows}\r\n".encode())
    table = read_log(path, mapping).tables["joints"]
    np.testing.assert_allclose(table["t"], 0.01 * np.arange(30))
    np.testing.assert_allclose(table["pitch"], 0.01 * np.arange(30))
    assert table.unit("pitch") == "rad"


# --- what is broken ---------------------------------------------------------------------------------------------------


def test_cells_and_rows_that_are_broken_are_told_and_nothing_else_is_lost(write):
    lines = text(hover(100)).splitlines()
    lines[8] = lines[8].replace("9.8", "9.8x")
    lines[20] = "1,2,3"
    log = read_log(write("imu.csv", "\n".join(lines)))
    assert len(log.tables["imu"]) == 99
    assert np.isnan(log.tables["imu"]["fz"]).sum() == 1
    assert any("1 row(s) left out that do not have 7 values" in note for note in log.notes)
    assert any("1 cell(s) of fz hold no number" in note for note in log.notes)


def test_whole_numbers_first_and_fractions_much_later(write):
    values = ["1"] * 200_000 + ["0.5"]
    rows = "\n".join(f"{k / 100},{v}" for k, v in enumerate(values))
    table = read_log(write("battery.csv", f"t,voltage\n{rows}\n")).tables["battery"]
    assert table["voltage"][-1] == 0.5 and len(table) == 200_001


def test_zeros_behind_the_last_row_as_after_a_power_cut_are_left_out(write):
    log = read_log(write("imu.csv", text(hover()).encode() + bytes(1000)))
    assert len(log.tables["imu"]) == 40
    assert any("1000 zero byte(s)" in note for note in log.notes)


@given(st.integers(30, 400))
@FUZZ
def test_a_packed_file_cut_anywhere_gives_what_can_be_unpacked(tmp_path, kept):
    whole = gzip.compress(text(hover(100)).encode(), 1)
    path = tmp_path / "imu.csv.gz"
    path.write_bytes(whole[: min(kept, len(whole) - 1)])
    try:
        log = read_log(path)
    except UserError as error:
        assert str(path) in str(error)
    else:
        assert any("breaks off" in note for note in log.notes)


@given(st.binary(max_size=300))
@FUZZ
def test_any_bytes_are_a_log_or_one_clear_line(tmp_path, data):
    for name in ("imu.csv", "log.bin"):
        path = tmp_path / name
        path.write_bytes(data)
        try:
            read_log(path)
        except UserError as error:
            assert str(path) in str(error) and "\n" not in str(error)


words = st.sampled_from(["", "NaN", "1e400", '"', ",", "true"])
cells = st.one_of(st.floats(), st.integers(), st.text(max_size=5), words)
ours = ["t", "imu.fx", "fx", "fz", "baro.altitude", "topic", "column", "value", "estimate.roll"]
headers = st.sampled_from([*ours, "", "x"])


@given(st.lists(headers, min_size=1, max_size=6), st.lists(st.lists(cells, max_size=6), max_size=12))
@FUZZ
def test_any_table_is_a_log_or_one_clear_line(tmp_path, header, rows):
    path = tmp_path / "imu.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in [header, *rows]), "utf-8", "surrogatepass")
    try:
        log = read_log(path)
    except UserError as error:
        assert "\n" not in str(error)
    else:
        for table in log.tables.values():
            assert np.isfinite(table["t"]).all()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "empty"),
        ("\n\n", "empty"),
        ("t,fx\n", "a header without rows"),
        ("t,t\n1,2\n", "two columns are named 't'"),
        ("when,what\n1,2\n", "what its columns are is not known: when, what"),
        ("t,fx\nnoon,1\nmidnight,2\n", "a number would be right"),
        (b"t,fx\n1,\0\0\n2,3", "no log that is known here"),
    ],
)
def test_what_is_no_log_is_told(write, content, says):
    path = write("imu.csv" if "when" not in str(content) else "data.csv", content)
    with pytest.raises(UserError, match=says) as caught:
        read_log(path)
    assert str(path) in str(caught.value)


# --- mappings ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('column = "ms"', 'colum = "ms"', r"m\.toml:\d+: time\.colum: unknown key; did you mean 'column'"),
        ('{column = "ms", unit = "ms"}', "{}", "give either column"),
        ('unit = "ms"}', 'unit = "m"}', "unit 'm' does not fit; expected one of s"),
        ('"estimate.n"', '"estimat.n"', "no topic 'estimat'; did you mean 'estimate'"),
        ('"estimate.n"', '"estimate.north"', "estimate has no column 'north'"),
        ('"estimate.n"', '"estimate.u"', "already the target of"),
        ('"estimate.n"', '"estimate.t"', "the time is given by the key time"),
        ('unit = "deg"', 'unit = "grad"', "unit 'grad' does not fit; expected one of rad, deg"),
        ("scale = 1e-3", 'scale = "big"', "must be a number"),
        ('column = "ms"', 'column = "milliseconds"', "has no column 'milliseconds'"),
    ],
)
def test_a_faulty_mapping_is_named_with_what_would_be_right(write, old, new, says):
    assert old in MAPPING
    columns = mapped()
    columns["az"] = -columns["az"]
    with pytest.raises(UserError, match=says) as caught:
        read_log(write("log.csv", text(columns)), write("m.toml", MAPPING.replace(old, new, 1)))
    assert "m.toml" in str(caught.value)


def test_columns_that_a_log_lacks_are_told_and_the_others_read(write):
    columns = mapped()
    columns["az"] = -columns["az"]
    del columns["batt"]
    log = read_log(write("log.csv", text(columns)), write("m.toml", MAPPING))
    assert "battery" not in log.tables and "imu" in log.tables
    assert any("no column 'batt'" in note for note in log.notes)


def test_a_mapping_of_another_log_fits_nothing(write):
    with pytest.raises(UserError, match="no column 'ms'"):
        read_log(write("log.csv", "a,b\n1,2\n"), write("m.toml", MAPPING))


@given(st.text(max_size=200))
@FUZZ
def test_any_text_as_a_mapping_is_one_clear_line(tmp_path, words):
    (tmp_path / "log.csv").write_text("a,b\n1,2\n")
    (tmp_path / "m.toml").write_text(words, "utf-8", "surrogatepass")
    with pytest.raises(UserError):
        read_log(tmp_path / "log.csv", tmp_path / "m.toml")


def test_a_mapping_belongs_to_a_single_csv(write, tmp_path):
    mapping = write("m.toml", MAPPING)
    with pytest.raises(UserError, match="is a folder"):
        read_log(tmp_path, mapping)
    with pytest.raises(UserError, match="no such log"):
        read_log(tmp_path / "nowhere.csv", mapping)


TARGETS = st.sampled_from(["imu.fx", "imu.wx", "baro.altitude", "gps.e", "joints.a", "controls.m1", "estimate.yaw",
                           "reference.qw", "sonar.valid", "nothing.x", "imu.t", "pad.source", "gps", ""])  # fmt: skip
UNITS = st.sampled_from(["", "m", "cm", "deg", "rad", "deg/s", "g", "m/s^2", "cm/s^2", "K", "degC", "%", "parsec"])
NUMBERS = st.one_of(st.integers(-(10**9), 10**9), st.floats(), st.just("big"))
SOURCES = st.sampled_from(["a", "b", "c", "d d", "none"])


@given(
    st.dictionaries(SOURCES, st.tuples(TARGETS, UNITS, NUMBERS, NUMBERS), min_size=1, max_size=4),
    st.sampled_from(['column = "a"', 'column = "c", unit = "ms"', "step = 0.01", "step = -1", "step = 1e300"]),
    st.lists(st.lists(cells, min_size=4, max_size=4), max_size=15),
)
@FUZZ
def test_any_mapping_of_any_table_is_a_log_or_one_clear_line(tmp_path, columns, clock, table):
    lines = [f"time = {{{clock}}}", "[columns]"]
    for source, (target, unit, scale, offset) in columns.items():
        said = f', unit = "{unit}"' if unit else ""
        numbers = ", ".join(f"{k} = {v!r}" for k, v in (("scale", scale), ("offset", offset)))
        lines.append(f'"{source}" = {{to = "{target}"{said}, {numbers}}}')
    (tmp_path / "m.toml").write_text("\n".join(lines).replace("'", '"'), "utf-8")
    rows = [["a", "b", "c", "d d"], *table]
    (tmp_path / "log.csv").write_text("\n".join(",".join(map(str, row)) for row in rows), "utf-8", "surrogatepass")
    try:
        read_log(tmp_path / "log.csv", tmp_path / "m.toml")
    except UserError as error:
        assert "\n" not in str(error)

"""Whatever is wrong with a log or does not fit its vehicle: one line, or a limitation that is stated, never a cause."""

import copy
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from flightlog.errors import UserError
from flightlog.tables import Table
from helideck.cli import main
from identification import mistaken
from identification.diagnosis import diagnose
from identification.intake import LONGEST, sound
from identification.logs import read
from sim.kinds import load
from sim.multirotor import load_multirotor
from sim.multirotor.simulate import fly
from sim.vehicle import load as load_helicopter
from tests.identification.short_flight import Columns, copied, made_table, written

Fault = Callable[[Columns], None]

FORCE, RATES, STICKS = ("fx", "fy", "fz"), ("wx", "wy", "wz"), ("collective", "lateral", "longitudinal", "tail")


def scaled(topic: str, names: tuple[str, ...], factor: float, offset: float = 0.0) -> Fault:
    def edit(columns: Columns) -> None:
        columns[topic] |= {name: columns[topic][name] * factor + offset for name in names}

    return edit


def without(topic: str, column: str | None = None) -> Fault:
    def edit(columns: Columns) -> None:
        del (columns if column is None else columns[topic])[topic if column is None else column]

    return edit


def swapped(topic: str, one: str, other: str) -> Fault:
    def edit(columns: Columns) -> None:
        table = columns[topic]
        table[one], table[other] = table[other], table[one]

    return edit


def later(topic: str, seconds: float) -> Fault:
    return scaled(topic, ("t",), 1.0, seconds)


def restarted(*topics: str) -> Fault:
    """The clock of these topics, or of all, begins again in the middle."""

    def edit(columns: Columns) -> None:
        for topic in topics or tuple(columns):
            for name in ("t", "t_arrival"):
                if name in columns[topic]:
                    t = columns[topic][name].copy()
                    half = len(t) // 2
                    t[half:] -= t[half]
                    columns[topic][name] = t

    return edit


def held(topic: str, value: float | None, first: float, last: float, *names: str) -> Fault:
    """A share of a topic's rows that say one thing: `value`, or what the first of them says."""

    def edit(columns: Columns) -> None:
        for name in names or [n for n in columns[topic] if n not in ("t", "t_arrival")]:
            column = columns[topic][name]
            if column.dtype.kind == "f":
                rows = slice(int(first * len(column)), int(last * len(column)))
                columns[topic][name] = column.copy()
                columns[topic][name][rows] = column[rows.start] if value is None else value

    return edit


def rows(topic: str, chosen: Callable[[int], np.ndarray]) -> Fault:
    """Only these rows of a topic, or of all for topic ""."""

    def edit(columns: Columns) -> None:
        for name in [topic] if topic else list(columns):
            index = chosen(len(columns[name]["t"]))
            columns[name] = {column: values[index] for column, values in columns[name].items()}

    return edit


def in_milliseconds(columns: Columns) -> None:
    for table in columns.values():
        table |= {name: 1e3 * table[name] for name in ("t", "t_arrival") if name in table}


REFUSED: dict[str, tuple[Fault, str]] = {
    # missing
    "no imu": (without("imu"), "no topic imu: a helicopter needs imu, controls, rotor"),
    "no controls": (without("controls"), "no topic controls"),
    "no rotor": (without("rotor"), "no topic rotor"),
    "no wz": (without("imu", "wz"), "imu lacks wz"),
    "no tail": (without("controls", "tail"), "controls lacks tail"),
    "rotor NaN": (held("rotor", np.nan, 0.0, 1.0), "rotor lacks speed"),
    # units
    "f in cm": (scaled("imu", FORCE, 100.0), "cm/s^2"),
    "f in g": (scaled("imu", FORCE, 1.0 / 9.81), "likely in g"),
    "f in ft": (scaled("imu", FORCE, 3.281), "ft/s^2"),
    "rates in deg": (scaled("imu", RATES, 57.3), "deg/s"),
    "baro in cm": (scaled("baro", ("altitude",), 100.0), "likely in cm"),
    "baro in ft": (scaled("baro", ("altitude",), 3.281), "likely in ft"),
    "pressure in hPa": (scaled("baro", ("pressure",), 0.01), "hPa"),
    "temperature in degC": (scaled("baro", ("temperature",), 1.0, -273.15), "degC"),
    "sonar in cm": (scaled("sonar", ("range",), 100.0), "likely in cm"),
    "gps in cm": (scaled("gps", ("e", "n", "u"), 100.0), "likely in cm"),
    "velocity in km/h": (scaled("gps", ("ve", "vn", "vu"), 3.6), "likely in km/h"),
    "field in gauss": (scaled("mag", ("mx", "my", "mz"), 0.01), "likely in G"),
    "mark in cm": (scaled("pad", ("x", "y", "z", "std_x", "std_y", "std_z"), 100.0), "likely in cm"),
    "angle in deg": (scaled("pad", ("angle", "std_angle"), 57.3), "likely in deg"),
    "sticks in deg": (scaled("controls", STICKS, 57.3), "likely in deg"),
    "sticks in travel": (scaled("controls", STICKS, 5.0), "share of full travel"),
    "throttle in percent": (scaled("controls", ("throttle",), 100.0), "likely percent"),
    "rotor in rpm": (scaled("rotor", ("speed",), 9.549), "likely in rpm"),
    "time in ms": (in_milliseconds, "likely in ms"),
    "gps time in ms": (scaled("gps", ("t",), 1e3), "gps is likely in ms"),
    # axes
    "depth": (scaled("gps", ("u", "vu"), -1.0), "NED"),
    "front right down": (scaled("imu", ("fy", "fz", "wy", "wz"), -1.0), 'frames.body = "FRD"'),
    "forces swapped": (swapped("imu", "fy", "fz"), "axes are likely swapped"),
    "rates swapped": (swapped("imu", "wx", "wy"), "1 would be right"),
    # clocks
    "controls of another epoch": (later("controls", 1.7e9), "one clock would be right"),
    "gps 5 s late": (later("gps", 5.0), "their clocks differ"),
    "imu clock reset alone": (restarted("imu"), "the clock of imu was reset"),
    "one time": (lambda columns: [t.update(t=0.0 * t["t"]) for t in columns.values()] and None, "0.00 s long"),
    "a moment": (rows("", lambda n: np.arange(n // 10)), "at least 2 s would be right"),
    # dead
    "controls that stand still": (held("controls", None, 0.0, 1.0), "stands still"),
    "a dead gyro": (held("imu", None, 0.0, 1.0, "wx"), "stands still"),
    "forces of zero": (held("imu", 0.0, 0.0, 1.0), "stands still"),
    "an imu now and then": (rows("imu", lambda n: np.arange(0, n, 100)), "a row every"),
}

LEFT_OUT: dict[str, tuple[Fault, str, str]] = {
    "field front right down": (scaled("mag", ("my", "mz"), -1.0), "mag", "other axes"),
    "gps of another epoch": (later("gps", 1.7e9), "gps", "another clock"),
    "gps clock reset alone": (restarted("gps"), "gps", "the clock of gps was reset"),
    "baro NaN": (held("baro", np.nan, 0.0, 1.0), "baro", "nothing in it"),
    "no altitude": (without("baro", "altitude"), "baro", "baro lacks altitude"),
    "a dead barometer": (held("baro", None, 0.0, 1.0), "baro", "stands still"),
    "a dead receiver": (held("gps", None, 0.0, 1.0), "gps", "stands still"),
    "a dead magnetometer": (held("mag", None, 0.0, 1.0, "mx"), "mag", "stands still"),
    "a mark that stands still": (held("pad", None, 0.0, 1.0, "z"), "pad", "stands still"),
    "a mark without weights": (without("pad", "std_x"), "pad", "pad lacks std_x"),
}

CUT = {
    "imu silent": (held("imu", np.nan, 0.3, 0.5), 7.0, 14.0),
    "rows lost": (rows("imu", lambda n: np.r_[0 : int(0.3 * n), int(0.5 * n) : n]), 7.0, 14.0),
    "controls late": (held("controls", np.nan, 0.0, 0.1), 1.4, 14.0),
    "rotor that stands still": (held("rotor", None, 0.5, 1.0), 0.0, 7.0),
}


@pytest.fixture(scope="module")
def raptor():
    return load_helicopter("raptor90")


def spoilt(flown: Columns, fault: Fault, folder: Path) -> Path:
    columns = copied(flown)
    fault(columns)
    return written(columns, folder / "flight")


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_used_is_one_line_and_exit_code_2(flown, tmp_path, capsys, name) -> None:
    fault, says = REFUSED[name]
    log = spoilt(flown, fault, tmp_path)
    assert main(["diagnose", str(log), "--vehicle", "raptor90", "-o", str(tmp_path / "out")]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.strip().splitlines()
    assert "flight" in line and says in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", LEFT_OUT)
def test_what_is_not_needed_and_cannot_be_used_is_left_out_and_told(flown, tmp_path, raptor, name) -> None:
    fault, topic, says = LEFT_OUT[name]
    flights = sound(read([spoilt(flown, fault, tmp_path)]), raptor)
    assert topic not in flights.tables["flight"]
    assert any(says in note for note in flights.notes)


@pytest.mark.parametrize("name", CUT)
def test_of_a_flight_with_a_gap_the_longest_stretch_is_used_and_told(flown, tmp_path, raptor, name) -> None:
    fault, first, last = CUT[name]
    flights = sound(read([spoilt(flown, fault, tmp_path)]), raptor)
    t = flights.tables["flight"]["imu"]["t"]
    assert (t[0], t[-1]) == pytest.approx((first, last), abs=0.3)
    assert any("longest stretch" in note for note in flights.notes)


def test_a_sound_flight_is_left_as_it_is(flown, tmp_path, raptor) -> None:
    flights = read([written(flown, tmp_path / "flight")])
    made = sound(flights, raptor)
    assert made.notes == flights.notes == ()
    for topic, table in flights.tables["flight"].items():
        assert made.tables["flight"][topic] is table


def test_three_hours_are_cut_to_what_can_be_judged(flown, tmp_path, raptor) -> None:
    long = {topic: {n: np.tile(v, 800) for n, v in rows_of.items()} for topic, rows_of in flown.items()
            if topic in ("gps", "rotor")}  # fmt: skip
    for topic, table in long.items():
        table["t"] = np.concatenate([flown[topic]["t"] + 14.0 * i for i in range(800)])
    spread = np.arange(0.0, 800 * 14.0, 0.02)
    for topic in ("imu", "controls"):
        table = flown[topic]
        long[topic] = {n: np.interp(spread % 14.0, table["t"], v) for n, v in table.items()} | {"t": spread}
    flights = sound(read([written(long, tmp_path / "flight")]), raptor)
    assert any("187 min long" in note for note in flights.notes)
    assert all(table["t"][-1] <= 121.0 for table in flights.tables["flight"].values())
    assert flights.logs["flight"].tables.keys() == flights.tables["flight"].keys()


# --- what only the whole diagnosis notices ----------------------------------------------------------------------------


def repeated(columns: Columns) -> None:
    rows("", lambda n: np.repeat(np.arange(n), 2))(columns)


def shuffled(columns: Columns) -> None:
    rng = np.random.default_rng(0)
    rows("", lambda n: np.argsort(np.arange(n) + 5.0 * rng.normal(size=n) * (rng.random(n) < 0.1)))(columns)


@pytest.mark.parametrize(("fault", "says"), [
    (swapped("controls", "lateral", "longitudinal"), "controls and rates about"),
    (later("pad", 5.0), "pad.z contradicts all else"),
])  # fmt: skip
def test_where_log_and_model_do_not_belong_together_nothing_is_named(flown, tmp_path, raptor, fault, says) -> None:
    verdict = diagnose(sound(read([spoilt(flown, fault, tmp_path)]), raptor).tables, raptor)
    assert not verdict.baseline.certified
    assert says in str(verdict.baseline.reason)
    assert verdict.causes == []


def tables_of(columns: Columns) -> dict[str, Table]:
    return {topic: made_table(topic, found) for topic, found in columns.items()}


def turned(topic: str, *names: str) -> Fault:
    return scaled(topic, names, -1.0)


def exchanged(columns: Columns) -> None:
    for one, other in (("e", "n"), ("ve", "vn")):
        swapped("gps", one, other)(columns)


@pytest.mark.parametrize(("fault", "says"), [
    (exchanged, "gps.e and gps.n are likely swapped"),
    (turned("gps", "n", "vn"), "gps.n has likely the wrong sign"),
    (swapped("pad", "x", "y"), "pad.x and pad.y are likely swapped"),
    (turned("pad", "x"), "pad.x has likely the wrong sign"),
])  # fmt: skip
def test_columns_that_the_sensors_would_rather_have_turned_are_told(flown, raptor, fault, says) -> None:
    columns = copied(flown)
    fault(columns)
    with pytest.raises(UserError, match=f"{says}.* as they are, drift would be found"):
        mistaken.check({"flight": tables_of(columns)}, raptor, "drift", 10.0)


def test_a_diagnosis_names_no_cause_where_columns_are_exchanged(flown, raptor) -> None:
    columns = copied(flown)
    exchanged(columns)
    with pytest.raises(UserError, match="e and gps"):
        diagnose({"flight": tables_of(columns)}, raptor)


def test_columns_that_are_right_are_left_so_also_with_a_fault(flown, raptor) -> None:
    mistaken.check({"flight": tables_of(flown)}, raptor, "drift", 0.0)
    columns = copied(flown)
    for fault in (scaled("gps", ("e", "n"), 1.0, 5.0), scaled("pad", ("x", "y", "z"), 1.05), later("pad", 0.06)):
        fault(columns)
    mistaken.check({"flight": tables_of(columns)}, raptor, "several", 30.0)


@pytest.mark.parametrize("fault", [repeated, shuffled, held("gps", None, 0.5, 1.0), held("baro", np.nan, 0.3, 0.5)])
def test_of_what_is_left_out_no_cause_is_named(flown, tmp_path, raptor, fault) -> None:
    flights = sound(read([spoilt(flown, fault, tmp_path)]), raptor)
    assert flights.notes
    assert diagnose(flights.tables, raptor).causes == []


# --- vehicles that do not fit -----------------------------------------------------------------------------------------


def quadrotor(folder: Path) -> Path:
    found = fly(load_multirotor("crazyflie"), np.random.default_rng(0), 10.0)
    return written({topic: dict(columns) for topic, columns in found.items()}, folder / "quadrotor")


@pytest.mark.parametrize(("vehicle", "says"), [
    ("crazyflie", "controls.m1..m4"),
    ("lab_helicopter", "joints"),
])  # fmt: skip
def test_a_helicopter_s_log_fits_no_other_kind(flown, tmp_path, capsys, vehicle, says) -> None:
    log = written(flown, tmp_path / "flight")
    assert main(["diagnose", str(log), "--vehicle", vehicle, "-o", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert says in line


def test_a_quadrotor_s_log_fits_no_helicopter_even_beside_one_of_its_own(flown, tmp_path, capsys) -> None:
    own, other = written(flown, tmp_path / "flight"), quadrotor(tmp_path)
    for logs in ([other], [own, other]):
        assert main(["diagnose", *map(str, logs), "--vehicle", "raptor90", "-o", str(tmp_path / "out")]) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert line.startswith("quadrotor: ") or "quadrotor: " in line


def test_another_helicopter_s_log_is_told_by_its_rotor(flown, tmp_path, raptor) -> None:
    other = copy.copy(raptor)
    geometry = raptor.geometry.copy()
    geometry["nominal_speed"] *= 1.6
    object.__setattr__(other, "geometry", geometry)
    with pytest.raises(UserError, match="another vehicle's log, or another unit"):
        sound(read([written(flown, tmp_path / "flight")]), other)


def test_errors_of_a_diagnosis_are_json_too(flown, tmp_path, capsys) -> None:
    log = spoilt(flown, scaled("imu", FORCE, 100.0), tmp_path)
    assert main(["diagnose", str(log), "--vehicle", "raptor90", "--json"]) == 2
    assert "cm/s^2" in json.loads(capsys.readouterr().out)["error"]


def test_every_kind_of_vehicle_is_known_here() -> None:
    assert {str(load(name).document["kind"]) for name in ("raptor90", "crazyflie", "lab_helicopter")} == set(LONGEST)

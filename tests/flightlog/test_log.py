"""What every reader does with what it has read: segments, doubts, units that cannot be."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.errors import UserError
from flightlog.readers.log import Draft, finish
from flightlog.tables import table

RNG = np.random.default_rng(5)


def hover(seconds=20.0, rate=50.0, start=0.0):
    """Topics of a vehicle that sways, climbs and turns about a hover; every sensor in SI."""
    t = start + np.arange(0.0, seconds, 1.0 / rate)
    slow, noise = 2.0 * np.pi * 0.3, RNG.normal(0.0, 0.01, (8, len(t)))
    e, n, u = np.sin(slow * t), 2.0 * np.cos(slow * t), 5.0 + 3.0 * np.sin(0.4 * slow * t)
    ve, vn, vu = (np.gradient(x, t) for x in (e, n, u))
    roll, pitch, heading = 0.2 * np.sin(slow * t), 0.15 * np.cos(slow * t), (1.0 + 0.5 * t) % (2.0 * np.pi)
    rates = {"wx": np.gradient(roll, t), "wy": -np.gradient(pitch, t), "wz": noise[0] - 0.5}
    return {
        "imu": {"t": t, "fx": noise[0], "fy": noise[1], "fz": 9.8 + noise[2], **rates},
        "mag": {"t": t, "mx": 22.0 + noise[3], "my": noise[4], "mz": -42.0 + noise[5]},
        "baro": {"t": t, "pressure": 1e5 - 11.8 * u, "temperature": 290.0 + noise[6], "altitude": u + noise[7]},
        "gps": {"t": t, "e": e, "n": n, "u": u, "ve": ve, "vn": vn, "vu": vu, "valid": np.ones(len(t), bool)},
        "sonar": {"t": t, "range": u, "valid": np.ones(len(t), bool)},
        "estimate": {"t": t, "e": e, "n": n, "u": u, "ve": ve, "vn": vn, "vu": vu, "roll": roll, "pitch": pitch,
                     "heading": heading},
        "reference": {"t": t, "e": e, "n": n, "u": u, "roll": roll, "pitch": pitch, "heading": heading},
        "battery": {"t": t, "voltage": 15.0 - 0.01 * t},
        "controls": {"t": t, "m1": 0.5 + 0.1 * np.sin(t), "m2": 0.5 + 0.1 * np.sin(t)},
        "rotor": {"t": t, "speed": 500.0 + noise[0]},
        "joints": {"t": t, "yaw": 2.0 * roll},
    }  # fmt: skip


def draft(topics, path="log.csv"):
    found = Draft(path, "csv")
    for name, columns in topics.items():
        found.add(name, columns)
    return found


def test_a_hover_in_si_has_nothing_to_complain_of():
    log = draft(hover()).finish()
    assert log.notes == ()
    assert log.segments == ((0.0, pytest.approx(19.98)),)
    assert log.duration == pytest.approx(19.98)


@given(st.integers(1, 4), st.floats(2.0, 1e5))
def test_a_reset_clock_splits_the_log_and_no_row_is_lost(resets, back):
    parts = [np.arange(0.0, 6.0, 0.1) + 7.0 * back * (resets - k) for k in range(resets + 1)]
    t = np.concatenate(parts)
    found = Draft("log.csv", "csv")
    found.add("baro", {"t": t, "altitude": np.arange(len(t)) % 7.0})
    # a slow topic that was not there before the last reset
    found.add("battery", {"t": parts[-1][::10], "voltage": 15.0 + np.arange(6.0)})
    log = found.finish()
    assert len(log.segments) == resets + 1
    assert sum(len(log.segment(k)["baro"]) for k in range(resets + 1)) == len(t)
    assert ["battery" in log.segment(k) for k in range(resets + 1)] == [False] * resets + [True]
    for k, part in enumerate(parts):
        np.testing.assert_array_equal(log.segment(k)["baro"]["t"], part)
        assert log.segments[k] == (part[0], part[-1])


def test_a_table_s_segments_fall_to_those_of_the_log_where_they_overlap():
    found = Draft("log.csv", "csv")
    parts = [np.arange(100.0, 110.0, 0.1), np.arange(50.0, 60.0, 0.1), np.arange(0.0, 10.0, 0.1)]
    found.add("baro", {"t": np.concatenate(parts), "altitude": np.concatenate(parts) % 7})
    gps = np.concatenate([parts[0], parts[2]])
    found.add("gps", {"t": gps, "u": gps % 7})
    log = found.finish()
    assert [sorted(log.segment(k)) for k in range(3)] == [["baro", "gps"], ["baro"], ["baro", "gps"]]


def test_what_is_doubtful_is_told():
    topics = hover()
    topics["imu"]["wz"] = np.full(1000, 0.25)
    topics["baro"]["altitude"] = np.where(np.arange(1000) // 100 == 3, np.nan, topics["baro"]["altitude"])
    keep = (np.arange(1000) < 400) | (np.arange(1000) > 700)
    topics["gps"] = {name: values[keep] for name, values in topics["gps"].items()}
    topics["mag"]["t"] = np.repeat(topics["mag"]["t"][::2], 2)
    notes = "\n".join(draft(topics).finish().notes)
    assert "imu.wz: 0.25 throughout" in notes
    assert "baro.altitude: NaN in 100 of 1000 rows, the longest run 2.0 s from t = 6.000 s" in notes
    assert "gps: 1 gap(s), the longest 6.0 s from t = 7.980 s" in notes
    assert "mag: 500 repeated time(s)" in notes


def test_nothing_in_it_is_an_error():
    with pytest.raises(UserError, match=r"log\.csv: nothing measured in it"):
        Draft("log.csv", "csv").finish()
    with pytest.raises(UserError, match="nothing measured"):
        finish("x", "csv", {"imu": table("measured", "imu", [])}, [], [])


# --- units that cannot be ---------------------------------------------------------------------------------------------

DEGREES = 180.0 / math.pi
WRONG = [
    (["imu.fx", "imu.fy", "imu.fz"], 100.0, "median |f| is 98", "cm/s^2"),
    (["imu.fx", "imu.fy", "imu.fz"], 1000.0, "median |f| is 98", "mm/s^2"),
    (["imu.fx", "imu.fy", "imu.fz"], 1.0 / 9.80665, "median |f| is 0.99", "g"),
    (["imu.wx", "imu.wy", "imu.wz"], DEGREES, "imu.wx, wy, wz: their integral is 57 times", "deg/s"),
    (["estimate.roll", "estimate.pitch", "estimate.heading"], DEGREES, "estimate.roll: reaches 11.", "deg"),
    (["reference.heading"], DEGREES, "reference.heading: reaches 3", "deg"),
    (["joints.yaw"], DEGREES, "joints.yaw: reaches 2", "deg"),
    (["baro.altitude"], 100.0, "baro.altitude: moves 100 times as far as gps.u", "cm"),
    (["gps.u"], 1000.0, "gps.u: moves 1000 times as far", "mm"),
    (["sonar.range"], 100.0, "sonar.range: moves 100 times as far", "cm"),
    (["gps.ve", "gps.vn", "gps.vu"], 100.0, "gps.ve: their integral is 100 times the change of e", "cm/s"),
    (["estimate.e"], 100.0, "estimate.e: changes by 100 times the integral of ve", "cm"),
    (["baro.pressure"], 0.01, "baro.pressure: median is 999", "hPa"),
    (["mag.mx", "mag.my", "mag.mz"], 10.0, "median of the field is 474", "mG"),
    (["mag.mx", "mag.my", "mag.mz"], 0.01, "median of the field is 0.474", "G"),
    (["battery.voltage"], 1000.0, "battery.voltage: reaches 1", "mV"),
    (["rotor.speed"], 30.0, "rotor.speed: reaches 1.5e+04", "rpm"),
    (["*.t"], 1000.0, "has a row every 20 s", "ms"),
    (["*.t"], 1e6, "has a row every 20000 s", "us"),
]  # fmt: skip


@pytest.mark.parametrize(("columns", "factor", "says", "unit"), WRONG)
def test_a_wrong_unit_is_named_with_the_likely_right_one(columns, factor, says, unit):
    topics = hover()
    for name in columns:
        topic, _, column = name.partition(".")
        for own in topics if topic == "*" else [topic]:
            topics[own][column] = topics[own][column] * factor
    with pytest.raises(UserError) as caught:
        draft(topics).finish()
    message = str(caught.value)
    assert says in message and f"likely in {unit}:" in message and "\n" not in message, message


def test_degrees_celsius_and_other_commands_are_seen():
    topics = hover()
    topics["baro"]["temperature"] = topics["baro"]["temperature"] - 273.15
    with pytest.raises(UserError, match=r"baro\.temperature: median is 16\.8.*degC"):
        draft(topics).finish()
    for most, scale in ((65_535.0, "16 bits"), (1000.0, "1/1000"), (100.0, "percent"), (2000.0, "offset")):
        topics = hover()
        topics["controls"]["m2"] = most * topics["controls"]["m2"] / topics["controls"]["m2"].max()
        says = rf"controls\.m2: reaches {most:g}; motor commands lie in 0 \.\. 1.*{scale}"
        with pytest.raises(UserError, match=says):
            draft(topics).finish()


@given(st.sampled_from(sorted(hover())), st.integers(0, 2**32 - 1))
def test_dead_and_noisy_sensors_are_no_wrong_units(topic, seed):
    """A sensor that fell silent, sticks or is rubbed in noise is a note or a cause, not a refusal."""
    rng = np.random.default_rng(seed)
    topics = hover()
    for column, values in topics[topic].items():
        if column != "t" and values.dtype.kind == "f":
            kind = rng.integers(4)
            stuck = np.full(len(values), values[len(values) // 2])
            noisy = values + rng.normal(0.0, 0.1, len(values))
            holes = np.where(rng.random(len(values)) < 0.5, np.nan, values)
            topics[topic][column] = (values, stuck, noisy, holes)[kind]
    draft(topics).finish()

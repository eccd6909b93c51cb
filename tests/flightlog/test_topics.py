import numpy as np
import pytest

from flightlog import signals
from flightlog.topics import MEASURED, TRUTH, Column, columns_of, estimate_row, topic_of

# what other tools rely on, as the flight log's definition names it
PUBLISHED = {
    "imu": "t fx fy fz wx wy wz",
    "mag": "t mx my mz",
    "baro": "t pressure temperature altitude",
    "gps": "t t_arrival e n u ve vn vu satellites hdop valid",
    "sonar": "t range valid",
    "pad": "t t_arrival x y z angle std_x std_y std_z std_angle quality source",
    "horizon": "t t_arrival roll pitch std_roll std_pitch valid",
    "flow": "t t_arrival dt u v quality",
    "controls": "t collective lateral longitudinal tail throttle",
    "actuators": "t collective lateral longitudinal tail throttle",
    "rotor": "t speed",
    "battery": "t voltage current",
    "joints": "t",
    "frames": "t t_arrival camera file",
}

SAMPLES = {
    "imu": signals.ImuSample,
    "mag": signals.MagSample,
    "baro": signals.BaroSample,
    "gps": signals.GpsSample,
    "sonar": signals.SonarSample,
    "rotor": signals.RotorSample,
    "pad": signals.PadSample,
    "horizon": signals.HorizonSample,
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_columns_are_those_published(name):
    assert " ".join(MEASURED[name].names) == PUBLISHED[name]


def test_truth_has_its_topics():
    assert set(TRUTH) == {"state", "wind", "rotor", "contact", "errors"}
    assert " ".join(TRUTH["state"].names) == "t e n u ve vn vu roll pitch heading wx wy wz"


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_is_a_row(name):
    assert MEASURED[name].names == SAMPLES[name]._fields
    kinds = {float: "float", int: "int", bool: "bool", str: "text"}
    assert [c.kind for c in MEASURED[name].columns] == [kinds[t] for t in SAMPLES[name].__annotations__.values()]


def test_controls_are_a_row_behind_their_time():
    assert MEASURED["controls"].names == ("t", *signals.Controls._fields)


def test_every_number_has_a_unit_and_time_comes_first():
    units = {"s", "m", "m/s", "m/s^2", "rad", "rad/s", "uT", "Pa", "K", "V", "A", "N", "1"}
    for topic in (*MEASURED.values(), *TRUTH.values()):
        assert topic.columns[0] == Column("t", "s")
        for column in topic.known:
            assert column.unit in (units if column.kind != "text" else {""}), f"{topic.name}.{column.name}"


def test_an_estimate_is_a_row_in_the_order_of_the_columns():
    estimate = signals.StateEstimate(
        t=1.0,
        position=np.array([2.0, 3.0, 4.0]),
        velocity=np.array([5.0, 6.0, 7.0]),
        acceleration=np.array([11.0, 12.0, 13.0]),
        quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        roll=8.0,
        pitch=9.0,
        heading=10.0,
        rates=np.zeros(3),
        rotor_speed=0.0,
        std_position=np.array([14.0, 15.0, 16.0]),
        std_velocity=np.array([17.0, 18.0, 19.0]),
        std_attitude=np.array([20.0, 21.0, 22.0]),
        pad_age=0.0,
        height_age=0.0,
    )
    row = dict(zip(MEASURED["estimate"].names, estimate_row(estimate), strict=True))
    assert list(row.values()) == [float(i) for i in range(1, 23)]
    assert (row["vn"], row["pitch"], row["au"], row["std_heading"]) == (6.0, 9.0, 13.0, 22.0)


def test_a_second_device_is_of_the_first_ones_kind():
    assert topic_of("measured", "gps_2") is MEASURED["gps"]
    assert topic_of("measured", "nonsense_2") is None
    assert topic_of("measured", "state") is None


def test_numbered_columns_are_known():
    assert MEASURED["controls"].column("m4") == Column("m4", "1")
    assert MEASURED["rotor"].column("speed2") == Column("speed2", "rad/s")
    assert MEASURED["controls"].column("m0") is None
    assert MEASURED["controls"].column("elevator") is None


def test_columns_may_be_chosen_and_added():
    assert [c.name for c in columns_of("measured", "controls", ["t", "m1", "m2"])] == ["t", "m1", "m2"]
    drift = Column("baro_drift", "m")
    assert columns_of("truth", "errors", ["t", drift])[1] is drift
    with pytest.raises(ValueError, match="no column 'm_1'"):
        columns_of("measured", "controls", ["t", "m_1"])
    with pytest.raises(ValueError, match="first column is t"):
        columns_of("measured", "controls", ["m1", "t"])
    with pytest.raises(ValueError, match="is no topic"):
        columns_of("measured", "wingspan")

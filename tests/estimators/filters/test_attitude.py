"""The complementary filter alone: alignment, integration, plumb line, azimuth, history; and the notches."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import freqz
from scipy.spatial.transform import Rotation

from estimators import notch
from estimators.attitude import AttitudeFilter, coast, propagate
from estimators.attitude_memory import attitude_at
from estimators.heading import correct_axis, correct_azimuth
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment, SensorSpec
from flightlog.rotations import angles, from_angles, matrix, quaternion, wrap

DT = 0.004
UP = np.array([0.0, 0.0, GRAVITY])


def feed(filter_: AttitudeFilter, t: float, force, rates, tilt=(0.0, 0.0), variance: float = 1e-5, aid: float = 0.0):
    propagate(filter_.memory, t, *force, *rates, *tilt, variance, aid)


def align(filter_: AttitudeFilter, q: np.ndarray, field: np.ndarray, shake=lambda t: 0.0) -> float:
    """0.2 s of trimmed flight; the time of the last sample."""
    r = matrix(q)
    t = 0.0
    for k in range(51):
        t = k * DT
        feed(filter_, t, r.T @ UP + shake(t), np.zeros(3))
        if k % 5 == 0:
            correct_azimuth(filter_.memory, t, *(r.T @ field))
    assert filter_.memory["aligned"][0]
    return t


def errors_deg(filter_: AttitudeFilter, q: np.ndarray) -> np.ndarray:
    roll, pitch, heading = np.subtract(angles(filter_.quaternion), angles(q))
    return np.degrees([roll, pitch, wrap(heading)])


@pytest.mark.parametrize("heading_deg", [0.0, 80.0, 200.0, 359.0])
def test_alignment_finds_any_trim_and_heading(equipment: Equipment, heading_deg: float) -> None:
    q = quaternion(math.radians(3.0), math.radians(-2.0), math.radians(heading_deg))
    filter_ = AttitudeFilter(equipment)
    align(filter_, q, equipment.magnetic_field)
    np.testing.assert_allclose(errors_deg(filter_, q), 0.0, atol=1e-6)


def test_vibration_averages_out_of_the_alignment(equipment: Equipment) -> None:
    q = quaternion(math.radians(3.0), 0.0, 1.0)
    filter_ = AttitudeFilter(equipment)
    align(filter_, q, equipment.magnetic_field, lambda t: 3.0 * np.sin(157.08 * t + np.array([0.0, 1.0, 2.0])))
    assert np.abs(errors_deg(filter_, q)[:2]).max() < 0.5


def test_the_alignment_is_carried_back_to_the_first_pictures(equipment: Equipment) -> None:
    q = quaternion(math.radians(3.0), 0.0, 1.0)
    filter_ = AttitudeFilter(equipment)
    align(filter_, q, equipment.magnetic_field, lambda t: 3.0 * np.sin(157.08 * t + np.array([0.0, 1.0, 2.0])))
    first, _ = attitude_at(filter_.memory, 0.004)
    # the rates were zero, so it has always been the attitude of the end
    np.testing.assert_allclose(first, filter_.quaternion, atol=1e-12)


def test_rates_are_integrated_as_a_rotation(equipment: Equipment) -> None:
    """A coning motion, whose mean drift a filter that adds angles gets wrong, against its closed form."""
    q = quaternion(0.0, 0.0, 1.0)
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, q, equipment.magnetic_field)
    start = Rotation.from_quat(filter_.quaternion, scalar_first=True)
    cone, omega = 0.2, 2 * math.pi

    def at(s: float) -> Rotation:
        tilt = cone * min(1.0, s) ** 2 * (3 - 2 * min(1.0, s))  # swells in a second
        return Rotation.from_rotvec([tilt * math.cos(omega * s), tilt * math.sin(omega * s), 0.0])

    origin = at(0.0)
    for k in range(1, 1251):
        s = k * DT
        rates = (at(s - 1e-5).inv() * at(s + 1e-5)).as_rotvec() / 2e-5
        # a force as long as no plumb line is
        feed(filter_, t + s, np.array([0.0, 0.0, 15.0]), rates)
    expected = start * origin.inv() * at(5.0)
    got = Rotation.from_quat(filter_.quaternion, scalar_first=True)
    assert np.degrees((expected.inv() * got).magnitude()) < 0.02


def test_the_plumb_line_levels_what_has_no_aid_and_learns_the_bias(equipment: Equipment) -> None:
    q = quaternion(math.radians(3.0), 0.0, 1.0)
    r = matrix(q)
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, q, equipment.magnetic_field)
    bias = np.radians([0.05, -0.04, 0.03])
    for k in range(1, 60_000):
        feed(filter_, t + k * DT, r.T @ UP, bias)
        if k % 5 == 0:
            correct_azimuth(filter_.memory, t + k * DT, *(r.T @ equipment.magnetic_field))
    np.testing.assert_allclose(errors_deg(filter_, q), 0.0, atol=0.05)
    np.testing.assert_allclose(np.degrees(filter_.memory["bias"][0]), np.degrees(bias), atol=0.01)


def test_a_manoeuvre_does_not_tilt_it(equipment: Equipment) -> None:
    q = quaternion(math.radians(3.0), 0.0, 1.0)
    r = matrix(q)
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, q, equipment.magnetic_field)
    for k in range(1, 1000):
        feed(filter_, t + k * DT, r.T @ (UP + [2.5, 0.0, 0.0]), np.zeros(3))
    assert np.abs(errors_deg(filter_, q)).max() < 0.6, errors_deg(filter_, q)  # the plumb line alone says 14 deg


def test_the_aid_turns_the_tilt_back_and_says_so(equipment: Equipment) -> None:
    """d' = c must hold for the tilt error d that the position filter keeps."""
    q = quaternion(0.0, 0.0, 0.7)
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, q, equipment.magnetic_field)
    tilt = np.array([0.01, -0.004])  # R f is off by g d
    r = matrix(filter_.quaternion)
    turned = 0.0
    for k in range(1, 500):
        feed(filter_, t + k * DT, r.T @ UP, np.zeros(3), tilt, aid=1.0)
        turned += filter_.memory["inputs"][0, 3:5] * DT
        tilt_now = np.array([0.01, -0.004]) + turned
        tilt = tilt_now  # as a filter that knows its input would
    # how the truly vertical force of the start would now be taken into the world
    off = (matrix(filter_.quaternion) @ r.T @ UP)[:2] / GRAVITY
    np.testing.assert_allclose(off, turned, rtol=0.1)
    assert np.hypot(*tilt_now) < 0.5 * np.hypot(0.01, 0.004)
    assert np.dot(turned, [0.01, -0.004]) < 0


def test_the_mark_shows_the_deviation_of_the_magnetometer(equipment: Equipment) -> None:
    heading = 2.0
    q = quaternion(0.0, 0.0, heading)
    r = matrix(q)
    wrong = Rotation.from_rotvec([0, 0, math.radians(2.0)]).apply(equipment.magnetic_field)
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, q, wrong)
    assert abs(errors_deg(filter_, q)[2]) == pytest.approx(2.0, abs=0.1)
    for k in range(1, 5000):
        feed(filter_, t + k * DT, r.T @ UP, np.zeros(3), aid=1.0)
        if k % 5 == 0:
            correct_azimuth(filter_.memory, t + k * DT, *(r.T @ wrong))
        if k % 10 == 0 and k < 2500:
            axis = math.pi / 2 - (math.pi / 2 + heading) % math.pi
            correct_axis(filter_.memory, t + k * DT - 0.06, axis, 0.002)
    # also long after the mark was lost
    assert abs(errors_deg(filter_, q)[2]) < 0.2


def test_heading_error_of_the_field_uses_its_horizontal_part_alone(equipment: Equipment) -> None:
    """The dip must not tilt the estimate."""
    q = quaternion(math.radians(5.0), math.radians(-3.0), 1.0)
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, q, equipment.magnetic_field)
    r = matrix(q)
    wrong = Rotation.from_rotvec([0, 0, 0.02]).apply(equipment.magnetic_field)
    for k in range(1, 5000):
        feed(filter_, t + k * DT, r.T @ UP, np.zeros(3), aid=1.0)
        correct_azimuth(filter_.memory, t + k * DT, *(r.T @ wrong))
    roll, pitch, heading = errors_deg(filter_, q)
    assert max(abs(roll), abs(pitch)) < 1e-3
    assert abs(heading) == pytest.approx(math.degrees(0.02), abs=0.1)


def test_the_lever_arm_of_the_sensor_is_taken_out(equipment: Equipment) -> None:
    """In a pirouette a mount 0.5 m ahead feels the centripetal acceleration; the body origin does not."""
    imu = equipment.sensors["imu"]
    ahead = replace(
        equipment,
        sensors={**equipment.sensors, "imu": SensorSpec(imu.rate, 0.0, np.array([0.5, 0.0, 0.0]), imu.numbers)},
    )
    filter_ = AttitudeFilter(ahead)
    q = quaternion(0.0, 0.0, 1.0)
    t = align(filter_, q, equipment.magnetic_field)
    for k in range(1, 500):
        rate, slope = (1.5 * k * DT, 1.5) if k < 250 else (1.5, 0.0)
        feed(filter_, t + k * DT, [-(rate**2) * 0.5, slope * 0.5, GRAVITY], [0.0, 0.0, rate])
    np.testing.assert_allclose(filter_.memory["inputs"][0, :3], 0.0, atol=0.02)


def test_rolling_in_one_place_is_no_acceleration(equipment: Equipment) -> None:
    """Force and attitude must be of the same time: 2 ms between them are 0.02 m/s^2 here."""
    imu = equipment.sensors["imu"]
    at_origin = replace(
        equipment, sensors={**equipment.sensors, "imu": SensorSpec(imu.rate, 0.0, np.zeros(3), imu.numbers)}
    )
    filter_ = AttitudeFilter(at_origin)
    t = align(filter_, quaternion(0.0, 0.0, 1.0), equipment.magnetic_field)
    largest = 0.0
    for k in range(1, 1000):
        s = k * DT
        amplitude, omega = 0.15, 2 * math.pi
        roll = amplitude * (1 - math.cos(omega * (s - DT / 2)))  # at the middle of the interval, as the force's mean is
        force = [0.0, GRAVITY * math.sin(roll), GRAVITY * math.cos(roll)]
        feed(filter_, t + s, force, [amplitude * omega * math.sin(omega * s), 0.0, 0.0], aid=1.0)
        if s > 2.0:
            largest = max(largest, float(np.abs(filter_.memory["inputs"][0, :2]).max()))
    assert largest < 0.01


def test_history_interpolates(equipment: Equipment) -> None:
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, quaternion(0.0, 0.0, 1.0), equipment.magnetic_field)
    then = Rotation.from_quat(filter_.quaternion, scalar_first=True)
    for k in range(1, 250):
        feed(filter_, t + k * DT, [0.0, 0.0, 15.0], [0.0, 0.0, 1.0])
    for late in (0.0, 0.0613, 0.5, 0.9):
        now = t + 249 * DT - late
        q, rates = attitude_at(filter_.memory, now)
        expected = then * Rotation.from_rotvec([0, 0, now - t - DT / 2])  # the first interval's mean rate is a half
        got = Rotation.from_quat(q, scalar_first=True)
        assert (expected.inv() * got).magnitude() < 1e-4
        np.testing.assert_allclose(rates, [0, 0, 1.0], atol=1e-3 if late < 0.8 else 0.03)


def test_without_samples_it_grows_unsure(equipment: Equipment) -> None:
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, quaternion(0.0, 0.0, 1.0), equipment.magnetic_field)
    before = math.sqrt(filter_.memory["variance_level"][0])
    for k in range(1, 250):
        coast(filter_.memory, t + k * DT)
    assert math.sqrt(filter_.memory["variance_level"][0]) - before == pytest.approx(0.1, rel=0.05)


def test_quaternions_stay_of_length_one(equipment: Equipment) -> None:
    filter_ = AttitudeFilter(equipment)
    t = align(filter_, quaternion(0.0, 0.0, 1.0), equipment.magnetic_field)
    rng = np.random.default_rng(0)
    for k in range(1, 20_000):
        feed(filter_, t + k * DT, UP + rng.normal(0, 3, 3), rng.normal(0, 3, 3))
    assert np.linalg.norm(filter_.quaternion) == pytest.approx(1.0, abs=1e-12)
    assert from_angles(*angles(filter_.quaternion)).magnitude() < 4


def response(frequency: float) -> np.ndarray:
    coefficients = np.zeros(5)
    notch.design(coefficients, 2 * math.pi * 25.0, DT)
    b, a = coefficients[:3], np.array([1.0, *coefficients[3:]])
    return freqz(b, a, worN=[frequency], fs=1 / DT)[1]


def test_the_notch_takes_its_frequency_and_leaves_the_slow_ones() -> None:
    assert abs(response(25.0)[0]) < 1e-9
    assert abs(response(2.0)[0]) == pytest.approx(1.0, abs=0.01)
    # delay far below: 1/(Q w0)
    delay = -np.angle(response(1.0)[0]) / (2 * math.pi)
    assert delay == pytest.approx(1 / (notch.QUALITY * 2 * math.pi * 25.0), rel=0.05)


def test_the_notch_steps_as_its_coefficients_say_and_starts_settled() -> None:
    coefficients, memory = np.zeros(5), np.zeros(2)
    notch.design(coefficients, 2 * math.pi * 25.0, DT)
    notch.settle(coefficients, memory, 9.8)
    assert notch.step(coefficients, memory, 9.8) == pytest.approx(9.8, abs=1e-9)
    t = DT * np.arange(500)
    out = [notch.step(coefficients, memory, 9.8 + math.sin(2 * math.pi * 25.0 * s)) for s in t]
    assert np.std(out[250:]) < 1e-3


def test_a_notch_beyond_the_sampling_lets_everything_through() -> None:
    coefficients, memory = np.zeros(5), np.zeros(2)
    notch.design(coefficients, 2 * math.pi * 124.0, DT)
    assert [notch.step(coefficients, memory, v) for v in (1.0, -2.0, 3.0)] == [1.0, -2.0, 3.0]


def _heading_error_deg(equipment: Equipment, std: float, until: float) -> float:
    """What is left of 2 deg at first, the gyroscope wrong by 0.1 deg/s, a mark's axis seen 25 times a second."""
    q = quaternion(0.0, 0.0, math.radians(40.0))
    filter_ = AttitudeFilter(equipment)
    c, s = math.cos(math.radians(2.0)), math.sin(math.radians(2.0))
    field = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ equipment.magnetic_field  # the magnetometer's own
    start = align(filter_, q, field)
    r, rng = matrix(q), np.random.default_rng(0)
    for k in range(1, round(until / DT)):
        t = start + k * DT
        feed(filter_, t, r.T @ UP, np.array([0.0, 0.0, math.radians(0.1)]), aid=1.0)
        if k % 5 == 0:
            correct_azimuth(filter_.memory, t, *(r.T @ field))
        if k % 10 == 0:
            correct_axis(filter_.memory, t - 0.06, -math.radians(40.0) + rng.normal(0.0, std), std)
    return float(abs(errors_deg(filter_, q)[2]))


def test_a_clear_axis_is_followed_by_itself(equipment: Equipment) -> None:
    assert _heading_error_deg(equipment, math.radians(0.02), 4.0) < 0.1
    assert _heading_error_deg(equipment, math.radians(0.02), 15.0) < 0.02


def test_an_axis_no_better_than_the_field_is_not_followed_by_itself(equipment: Equipment) -> None:
    filter_ = AttitudeFilter(equipment)
    q = quaternion(0.0, 0.0, math.radians(40.0))
    t = align(filter_, q, equipment.magnetic_field)
    correct_axis(filter_.memory, t, -math.radians(43.0), math.radians(1.0))
    assert filter_.memory["axis_time"][0] == -math.inf
    correct_axis(filter_.memory, t, -math.radians(43.0), math.radians(0.05))
    assert filter_.memory["axis_time"][0] == t
    assert math.degrees(filter_.memory["axis_error"][0]) == pytest.approx(3.0)

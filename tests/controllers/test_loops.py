"""Each loop by itself: signs, limits, anti-windup."""

import math

import numpy as np
import pytest

from controllers.altitude import REFERENCE_ACCELERATION, AltitudeLoop, HeightReference, collective_law
from controllers.attitude import AttitudeLoop
from controllers.gains import Gains
from controllers.governor import Governor
from controllers.heading import HeadingLoop
from controllers.plant import SAMPLE_TIME
from controllers.position import PositionLoop, split
from controllers.velocity import VelocityLoop
from flightlog.constants import GRAVITY
from sim.linearisation import Trim
from sim.pipeline import Pipeline
from sim.vehicle import Vehicle
from sim.wind.mean import mean_speed

WIDE = math.radians(20.0)


def tilt(gains: Gains, heading: float, wanted_e: float, wanted_n: float) -> tuple[float, float]:
    """(roll, pitch) from trim, asked for at rest."""
    loop = VelocityLoop(gains.velocity)
    roll, pitch = loop.update(wanted_e, wanted_n, 0.0, 0.0, heading, 10.0, WIDE, level=1.0, hold=False)
    return roll - gains.velocity.trim_roll, pitch - gains.velocity.trim_pitch


@pytest.mark.parametrize(
    ("heading_deg", "wanted", "roll_sign", "pitch_sign"),
    [
        (0, (0, 1), 0, -1),  # north, nose to the north: nose down
        (0, (1, 0), 1, 0),  # east: right side down
        (90, (1, 0), 0, -1),  # nose to the east
        (90, (0, 1), -1, 0),  # north is to the left
        (180, (0, 1), 0, 1),
        (270, (0, 1), 1, 0),
    ],
)
def test_it_leans_to_where_it_wants_to_go(gains, heading_deg, wanted, roll_sign, pitch_sign) -> None:
    roll, pitch = tilt(gains, math.radians(heading_deg), *wanted)
    assert (round(roll, 6), round(pitch, 6)) == (
        pytest.approx(roll_sign * abs(roll), abs=1e-6),
        pytest.approx(pitch_sign * abs(pitch), abs=1e-6),
    )
    assert math.hypot(roll, pitch) == pytest.approx(
        math.atan((gains.velocity.proportional + gains.velocity.integral * SAMPLE_TIME) / GRAVITY)
    )


def test_the_tilt_limit_keeps_the_direction(gains: Gains) -> None:
    loop = VelocityLoop(gains.velocity)
    roll, pitch = loop.update(3.0, 4.0, 0.0, 0.0, 0.0, 10.0, 0.05, level=1.0, hold=True)
    right, forward = math.tan(roll - gains.velocity.trim_roll), -math.tan(pitch - gains.velocity.trim_pitch)
    assert math.hypot(right, forward) == pytest.approx(math.tan(0.05))
    assert right / forward == pytest.approx(3.0 / 4.0)


def test_a_wind_beyond_the_tilt_limit_is_met_by_the_integral(gains: Gains) -> None:
    loop = VelocityLoop(gains.velocity)
    pitch = 0.0
    for _ in range(int(30 / SAMPLE_TIME)):  # blown back at a steady speed: the limited tilt does not do
        _, pitch = loop.update(0.0, 2.0, 0.0, 0.0, 0.0, 10.0, 0.05, level=1.0, hold=False)
    assert pitch < -2 * 0.05


def test_the_integral_rests_while_it_speeds_up_at_the_tilt_limit(gains: Gains) -> None:
    loop = VelocityLoop(gains.velocity)
    speed, pushed = 0.0, GRAVITY * math.tan(0.05)
    for _ in range(int(3 / SAMPLE_TIME)):
        loop.update(0.0, 5.0, 0.0, speed, 0.0, 10.0, 0.05, level=1.0, hold=False)
        speed += pushed * SAMPLE_TIME
    _, pitch = loop.update(0.0, speed, 0.0, speed, 0.0, 10.0, 0.05, level=1.0, hold=False)
    assert abs(pitch - gains.velocity.trim_pitch) < 0.2 * 0.05


def test_what_the_wind_asks_for_is_carried_down_the_profile(gains: Gains) -> None:
    loop = VelocityLoop(gains.velocity)
    loop.take_over(0.0, 0.0, gains.velocity.trim_roll, gains.velocity.trim_pitch - 0.05, 0.0, 10.0)

    def lean(height: float) -> float:
        _, pitch = loop.update(0.0, 0.0, 0.0, 0.0, 0.0, height, WIDE, level=1.0, hold=True)
        return math.tan(gains.velocity.trim_pitch - pitch)

    full = lean(10.0)
    assert full == pytest.approx(math.tan(0.05))
    assert lean(1.0) / full == pytest.approx(mean_speed(1.0, 1.5) / mean_speed(10.0, 1.5), rel=1e-6)
    assert lean(-1.0) / full == pytest.approx(mean_speed(0.3, 1.5) / mean_speed(10.0, 1.5), rel=1e-6)
    assert lean(10.0) == pytest.approx(full)


def test_without_the_tail_rotors_push_it_flies_level(gains: Gains) -> None:
    roll, _ = VelocityLoop(gains.velocity).update(0, 0, 0, 0, 0.0, 10.0, WIDE, level=0.0, hold=True)
    assert roll == 0.0
    assert gains.velocity.trim_roll > math.radians(2)


def test_speed_demand_is_limited_in_all_directions(gains: Gains) -> None:
    assert PositionLoop(gains.position).update(30.0, -40.0, 1.5) == pytest.approx((0.9, -1.2))
    small = PositionLoop(gains.position).update(0.1, 0.0, 1.5)
    assert small == pytest.approx((0.1 * gains.position.proportional, 0.0))


def test_split_gives_the_polynomial_back() -> None:
    derivative, faster, slower = split(1.0, 4.0, 2.0)
    assert derivative * np.poly([-faster, -slower]) == pytest.approx([2.0, 4.0, 1.0])
    with pytest.raises(ValueError, match="complex"):
        split(3.0, 4.0, 2.0)


def test_cyclic_answers_a_tilted_attitude_against_it(gains: Gains) -> None:
    """lateral > 0 rolls right, longitudinal > 0 lowers the nose."""
    trim = gains.trim
    lateral, longitudinal = AttitudeLoop(gains.attitude).update(0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert lateral < trim.lateral - 0.01
    assert abs(longitudinal - trim.longitudinal) < 0.2 * abs(lateral - trim.lateral)
    lateral, longitudinal = AttitudeLoop(gains.attitude).update(0.0, 0.1, 0.0, 0.0, 0.0, 0.0)
    assert longitudinal > trim.longitudinal + 0.01
    # rates: wx > 0 rolls right, wy > 0 is nose down
    assert AttitudeLoop(gains.attitude).update(0.0, 0.0, 1.0, 0.0, 0.0, 0.0)[0] < trim.lateral
    assert AttitudeLoop(gains.attitude).update(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)[1] < trim.longitudinal


def test_cyclic_stays_within_its_stops_and_does_not_wind_up(gains: Gains) -> None:
    loop = AttitudeLoop(gains.attitude)
    for _ in range(1000):
        lateral, _ = loop.update(1.5, 0.0, 0.0, 0.0, 0.0, 0.0)
        assert abs(lateral) <= gains.attitude.limit
    for _ in range(200):  # servo and flapping of the model run out
        lateral, _ = loop.update(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert lateral == pytest.approx(gains.trim.lateral, abs=2e-3)


@pytest.mark.parametrize("load", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("ratio", [1.0, 0.85, 0.7])  # below, 1.2 of the weight stalls the blades
@pytest.mark.parametrize("height", [10.0, 0.5, 0.25])
def test_the_law_gives_the_thrust_that_it_promises(
    gains: Gains, vehicle: Vehicle, hover_trim: Trim, load: float, ratio: float, height: float
) -> None:
    speed = ratio * gains.altitude.rotor_speed
    pipeline = Pipeline(vehicle.terms, vehicle.parameters, vehicle.geometry)
    pipeline.state[:] = hover_trim.state
    s = hover_trim.signals.copy()
    s["height"] = height
    for name, value in hover_trim.controls._asdict().items():
        s[name] = value
    s["collective"] = collective_law(gains.altitude, load, speed, height, ground_effect=True)
    pipeline.settle(s, 0.002, 1500, speed)
    assert float(s["thrust"]) == pytest.approx(load * float(hover_trim.signals["thrust"]), rel=0.02)


def test_collective_rises_below_the_reference_and_rests_at_its_stop(gains: Gains) -> None:
    loop, speed = AltitudeLoop(gains.altitude), gains.altitude.rotor_speed
    at_rest = loop.update(HeightReference(10.0), 10.0, 0.0, 1.0, speed, False, hold=False)
    assert loop.update(HeightReference(10.0), 9.8, 0.0, 1.0, speed, False, hold=False) > at_rest + 0.005
    assert loop.update(HeightReference(10.0), 10.0, -0.2, 1.0, speed, False, hold=False) > at_rest + 0.005
    for _ in range(int(20 / SAMPLE_TIME)):  # held down: load factor at its limit, the integral must not grow
        loop.update(HeightReference(10.0), 8.0, 0.0, 1.0, speed, False, hold=False)
    assert loop.saturated == 1
    again = loop.update(HeightReference(10.0), 10.0, 0.0, 1.0, speed, False, hold=False)
    assert again == pytest.approx(at_rest, abs=0.003)


def test_collective_makes_up_for_tilt(gains: Gains) -> None:
    speed = gains.altitude.rotor_speed
    level = AltitudeLoop(gains.altitude).update(HeightReference(5.0), 5.0, 0.0, 1.0, speed, False, hold=False)
    tilted = AltitudeLoop(gains.altitude).update(
        HeightReference(5.0), 5.0, 0.0, math.cos(0.3), speed, False, hold=False
    )
    assert tilted == pytest.approx(collective_law(gains.altitude, 1.0 / math.cos(0.3), speed, 5.0, False))
    assert tilted > level


def test_the_height_reference_keeps_rate_acceleration_and_lead() -> None:
    reference = HeightReference(10.0)
    climbs = []
    for _ in range(int(20 / SAMPLE_TIME)):
        reference.update(2.0, 0.8, reference.height)
        climbs.append(reference.climb)
    assert min(climbs) == pytest.approx(-0.8)
    assert np.abs(np.diff(climbs)).max() <= REFERENCE_ACCELERATION * SAMPLE_TIME + 1e-12
    assert reference.height == pytest.approx(2.0, abs=0.01)
    for _ in range(int(5 / SAMPLE_TIME)):
        reference.update(-math.inf, 0.5, 2.0)  # the machine stays behind
    assert reference.height == pytest.approx(1.4)
    for _ in range(int(2 / SAMPLE_TIME)):
        reference.update(-math.inf, 0.0, 2.0)
    assert reference.climb == 0.0


def test_tail_turns_the_short_way_and_against_the_rate(gains: Gains) -> None:
    """tail > 0 turns the nose right; wz > 0 turns left."""
    trim = gains.trim

    def tail(heading: float, wz: float, wanted: float) -> float:
        return HeadingLoop(gains.heading).update(heading, wz, wanted, trim.throttle, hold=False)

    assert tail(0.0, 0.0, 0.2) > trim.tail
    assert tail(0.1, 0.0, 2.0 * math.pi - 0.1) < trim.tail
    assert tail(2.0 * math.pi - 0.1, 0.0, 0.1) > trim.tail
    assert tail(0.0, 0.5, 0.0) > trim.tail


def test_tail_follows_the_engines_torque(gains: Gains, plant) -> None:
    loop = HeadingLoop(gains.heading)
    for _ in range(int(2 / SAMPLE_TIME)):
        tail = loop.update(0.0, 0.0, 0.0, gains.trim.throttle + 0.05, hold=False)
    wz = plant.state_names.index("wz")
    from_engine = plant.A[wz, plant.state_names.index("engine.throttle")] * 0.05
    from_tail = plant.A[wz, plant.state_names.index("servo.tail")] * (tail - gains.trim.tail)
    assert from_engine + from_tail == pytest.approx(0.0, abs=0.02 * abs(from_engine))


def test_governor_gives_more_to_a_slow_rotor_and_to_more_collective(gains: Gains) -> None:
    speed, trim = gains.governor.rotor_speed, gains.trim
    assert Governor(gains.governor).update(speed, trim.collective) == pytest.approx(trim.throttle)
    assert Governor(gains.governor).update(speed - 2.0, trim.collective) > trim.throttle + 0.01
    assert Governor(gains.governor).update(speed, trim.collective + 0.02) > trim.throttle + 0.02
    governor = Governor(gains.governor)
    for _ in range(int(30 / SAMPLE_TIME)):
        assert governor.update(0.2 * speed, trim.collective) == 1.0
    assert governor.update(speed + 5.0, trim.collective) < trim.throttle + 0.1

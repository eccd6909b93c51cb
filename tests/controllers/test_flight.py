"""The loop closed on the model's terms: steps, gusts, hover and landing."""

import math
import time

import numpy as np
import pytest

from controllers.gains import Gains
from controllers.landing import Landing
from controllers.pilot import Pilot
from controllers.sequence import Hover, Phase
from flightlog.rotations import quaternion
from sim.linearisation import trim
from sim.wind import Gust


class Steps(Hover):
    """A hover whose target moves after a second."""

    def __init__(self, east: float = 0.0, north: float = 0.0, up: float = 0.0) -> None:
        super().__init__()
        self._step = (east, north, up)

    def update(self, state):
        if state.t > 1.0:
            self.set_target(*self._step[:2])
            self._height = 10.0 + self._step[2]
        return super().update(state)


def settled(values: np.ndarray, target: float, band: float) -> int:
    """Index from which the values stay within the band."""
    outside = np.nonzero(np.abs(values - target) > band)[0]
    return int(outside[-1]) + 1 if len(outside) else 0


@pytest.mark.parametrize("heading_deg", [0.0, 130.0])
def test_a_step_sideways_arrives_without_much_overshoot(fly, gains: Gains, heading_deg: float) -> None:
    flight = fly()
    heading = math.radians(heading_deg)
    flight.qpos[3:7] = quaternion(flight.at.roll, flight.at.pitch, heading)
    pilot = Pilot(gains, Steps(east=2.0, north=-1.0))
    flight.fly(pilot, 25.0)
    t, e, n = (flight.column(name) for name in ("t", "e", "n"))
    along = (2.0 * e - n) / math.sqrt(5.0)
    across = (e + 2.0 * n) / math.sqrt(5.0)
    distance = math.sqrt(5.0)
    assert along.max() < 1.12 * distance
    assert np.abs(across).max() < 0.06 * distance
    assert t[settled(along, distance, 0.12 * distance)] < 9.0
    assert np.degrees(np.abs(flight.column("roll") - flight.at.roll).max()) < 8.0
    assert np.abs(flight.column("u") - 10.0).max() < 0.10
    off = np.angle(np.exp(1j * (flight.column("heading") - heading)))
    assert np.degrees(np.abs(off).max()) < 2.0


@pytest.mark.parametrize("up", [2.0, -3.0])
def test_a_step_in_height_keeps_the_place_and_the_rotor_speed(fly, gains: Gains, up: float) -> None:
    flight = fly()
    flight.fly(Pilot(gains, Steps(up=up)), 15.0)
    height = flight.column("u") - 10.0
    assert (height * np.sign(up)).max() < 1.08 * abs(up)
    assert abs(height[-1] - up) < 0.05
    assert np.abs(flight.column("vu")).max() < 1.15
    assert np.hypot(flight.column("e"), flight.column("n")).max() < 0.15
    assert np.abs(flight.column("rotor") / gains.governor.rotor_speed - 1.0).max() < 0.02


def test_a_steady_hover_stands_still(fly, gains: Gains) -> None:
    flight = fly()
    flight.fly(Pilot(gains, Hover()), 5.0)
    assert np.abs(flight.column("u") - 10.0).max() < 0.005
    assert np.hypot(flight.column("e"), flight.column("n")).max() < 0.005


@pytest.mark.parametrize("gust_from_deg", [0.0, 90.0, 180.0, 270.0])
def test_a_gust_is_ridden_out(fly, gains: Gains, gust_from_deg: float) -> None:
    flight = fly(gust=Gust(start=2.0, duration=4.0, speed=4.0, wind_from=math.radians(gust_from_deg)))
    flight.fly(Pilot(gains, Hover()), 30.0)
    off = np.hypot(flight.column("e"), flight.column("n"))
    assert 0.05 < off.max() < 1.5
    assert off[-250:].max() < 0.15
    assert np.abs(flight.column("u") - 10.0).max() < 0.4


def test_a_strong_side_wind_does_not_carry_it_off(fly, gains: Gains) -> None:
    """Coming up at once, 7 m/s from the side asks for more tilt than the landing allows for manoeuvres."""
    flight = fly(wind=7.0)
    flight.fly(Pilot(gains, Hover(tilt_limit=math.radians(3.2))), 60.0)
    off = np.hypot(flight.column("e"), flight.column("n"))
    assert off.max() < 15.0
    assert off[-250 * 20 :].max() < 3.0


def test_a_flight_that_begins_trimmed_in_wind_is_taken_over_without_a_jolt(fly, gains: Gains, vehicle) -> None:
    flight = fly(wind=7.0)
    flight.wind.scale = 0.0  # no turbulence
    at = trim(flight.pipeline, vehicle.inertia, wind=flight.wind.mean(10.0))
    flight.at, flight.signals, flight.air = at, at.signals.copy(), at.wind.copy()
    flight.pipeline.state[:] = at.state
    flight.qpos[3:7] = quaternion(at.roll, at.pitch, 0.0)
    flight.fly(Pilot(gains, Hover()), 15.0)
    assert abs(at.roll - gains.velocity.trim_roll) > math.radians(2)
    assert np.hypot(flight.column("e"), flight.column("n")).max() < 0.7


def touchdown(flight) -> dict[str, float]:
    first = int(np.argmax(flight.column("contacts") > 0))
    assert flight.column("contacts")[first] > 0
    row = {name: float(flight.column(name)[first - 1]) for name in flight.COLUMNS}
    return row | {
        "offset": math.hypot(row["e"], row["n"]),
        "drift": math.hypot(row["ve"], row["vn"]),
        "sink": -row["vu"],
        "first": first,
    }


@pytest.mark.parametrize("seed", range(6))
def test_it_lands_on_the_pad_gently_in_the_wind_of_the_default_landing(fly, gains: Gains, seed: int) -> None:
    from_conftest = type(fly().noise)
    noise = from_conftest(position=0.01, velocity=0.04, attitude=0.002, rates=0.03, wander=0.03)
    flight = fly(wind=1.5, noise=noise, seed=seed)
    heading = 1.0 * seed
    flight.qpos[:3] = 1.5, -1.0, 11.0
    flight.qpos[3:7] = quaternion(flight.at.roll, flight.at.pitch, heading)
    pilot = Pilot(gains, Landing(0.23))
    flight.fly(pilot, 90.0)
    assert pilot.finished
    at = touchdown(flight)
    assert at["offset"] < 0.20
    assert 0.1 < at["sink"] < 0.40
    assert at["drift"] < 0.15
    left = next(t for t, text in pilot.events if text == "descend")
    down = slice(int(left / 0.004), at["first"])
    assert np.degrees(np.abs(flight.column("roll")[down]).max()) < 6.0
    assert np.degrees(np.abs(flight.column("pitch")[down]).max()) < 3.0
    assert flight.column("throttle")[at["first"]] == 0.0
    # at rest, upright, rotor running down
    assert abs(flight.column("roll")[-1]) < 0.02
    assert abs(flight.column("vu")[-1]) < 0.01
    assert flight.column("rotor")[-1] < 0.6 * gains.governor.rotor_speed
    assert flight.column("contacts")[-1] == 4


def test_collective_goes_on_holding_the_sink_rate_on_the_slowing_rotor(fly, gains: Gains) -> None:
    flight = fly()
    pilot = Pilot(gains, Landing(0.23))
    flight.fly(pilot, 60.0)
    held = touchdown(flight)
    assert held["rotor"] < 0.95 * gains.governor.rotor_speed
    assert held["collective"] > 0.076

    class Frozen(Pilot):
        """Leaves the collective where it stood when the throttle shut."""

        def update(self, state):
            controls = super().update(state)
            if self.phase is Phase.CUTOFF and controls.throttle == 0.0:
                self.frozen = getattr(self, "frozen", controls.collective)
                return controls._replace(collective=self.frozen)
            return controls

    flight = fly()
    flight.fly(Frozen(gains, Landing(0.23)), 60.0)
    assert touchdown(flight)["sink"] > held["sink"] + 0.1
    assert held["sink"] < 0.33


def test_a_gust_near_the_ground_makes_it_wait_or_go_around(fly, gains: Gains) -> None:
    calm = fly()
    calm.fly(Pilot(gains, Landing(0.23)), 60.0)
    over = touchdown(calm)["t"]
    flight = fly(gust=Gust(start=over - 4.0, duration=5.0, speed=6.0, wind_from=math.pi / 2))
    pilot = Pilot(gains, Landing(0.23))
    flight.fly(pilot, 120.0)
    at = touchdown(flight)
    assert at["t"] > over + 2.0
    assert at["offset"] < 0.25
    assert at["drift"] < 0.4


def test_a_lost_pad_ends_the_descent_above_the_ground(fly, gains: Gains) -> None:
    flight = fly()
    pilot = Pilot(gains, Landing(0.23))

    def blind(flight) -> None:
        flight.pad_age = max(flight.t - 12.0, 0.0)

    flight.fly(pilot, 40.0, blind)
    assert any(text == "go around: pad lost" for _, text in pilot.events)
    assert flight.column("u").min() > 2.0
    assert not flight.column("contacts").any()


def test_the_pilot_is_quick_enough(fly, gains: Gains) -> None:
    """Budget 20 us a call on an idle core; here with room for a busy one."""
    flight = fly()
    pilot = Pilot(gains, Landing(0.23))
    flight.fly(pilot, 8.0)
    state = flight.estimate()
    best = math.inf
    for _ in range(10):
        start = time.perf_counter()
        for _ in range(500):
            pilot.update(state)
        best = min(best, (time.perf_counter() - start) / 500)
    assert best < 60e-6


def test_no_nan_no_jump_when_the_estimate_jumps(fly, gains: Gains) -> None:
    flight = fly()
    pilot = Pilot(gains, Hover())

    def jump(flight) -> None:
        flight.qpos[0] += 0.5 if abs(flight.t - 2.0) < 0.002 else 0.0

    flight.fly(pilot, 6.0, jump)
    for name in ("collective", "lateral", "longitudinal", "tail", "throttle"):
        assert np.isfinite(flight.column(name)).all()
    assert np.degrees(np.abs(flight.column("roll") - flight.at.roll).max()) < 6.0

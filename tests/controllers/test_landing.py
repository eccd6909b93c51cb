"""The landing sequence on scripted states: what enters which phase, and what breaks a landing off."""

import math
from dataclasses import replace

import numpy as np
import pytest

from controllers.landing import Landing, LandingLimits
from controllers.sequence import Demand, Hover, Phase
from flightlog.signals import StateEstimate

SKID_HEIGHT = 0.23
PERIOD = 0.02


def state(
    *,
    east: float = 0.0,
    north: float = 0.0,
    height: float = 10.0,
    speed: float = 0.0,
    climb: float = 0.0,
    roll: float = 0.0,
    pad_age: float = 0.04,
    spread: float = 0.03,
) -> StateEstimate:
    return StateEstimate(
        t=0.0,
        position=np.array([east, north, height]),
        velocity=np.array([speed, 0.0, climb]),
        acceleration=np.zeros(3),
        quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
        roll=roll,
        pitch=0.0,
        heading=0.0,
        rates=np.zeros(3),
        rotor_speed=157.0,
        std_position=np.full(3, spread),
        std_velocity=np.full(3, 0.02),
        std_attitude=np.full(3, 0.005),
        pad_age=pad_age,
        height_age=0.0,
    )


class Script:
    """A landing and its clock."""

    def __init__(self, **limits: float) -> None:
        self.landing = Landing(SKID_HEIGHT, LandingLimits(**limits))
        self.t = 0.0

    def show(self, seconds: float = PERIOD, **what: float) -> Demand:
        for _ in range(max(round(seconds / PERIOD), 1)):
            demand = self.landing.update(replace(state(**what), t=self.t))
            self.t += PERIOD
        return demand

    @property
    def phase(self) -> Phase:
        return self.landing.phase

    def descending(self) -> "Script":
        self.show(5.0)
        assert self.phase is Phase.DESCEND
        return self

    def flaring(self) -> "Script":
        self.descending().show(height=2.0)
        assert self.phase is Phase.FLARE
        return self


def test_the_phases_of_lei_2012_follow_each_other() -> None:
    script = Script()
    assert script.show(3.0, north=2.0).height == 10.0
    assert script.phase is Phase.APPROACH
    script.show(1.0)
    assert script.phase is Phase.HOVER
    script.show(1.2)
    assert script.phase is Phase.CHECK
    script.show(2.2)
    assert script.phase is Phase.DESCEND
    demand = script.show(height=5.0)
    assert demand.height < 0.0
    assert not demand.ground_effect
    assert script.show(height=2.2).ground_effect
    assert script.phase is Phase.FLARE
    assert script.show(height=0.6).powered
    assert not script.show(height=0.42).powered
    assert script.phase is Phase.CUTOFF
    script.show(0.2, height=0.24, climb=-0.2)
    assert script.phase is Phase.CUTOFF  # still sinking
    script.show(0.2, height=0.24)
    assert script.phase is Phase.LANDED
    assert not script.show(height=0.24).flying
    assert not script.landing.finished
    script.show(3.1, height=0.24)
    assert script.landing.finished
    texts = [text for _, text in script.landing.events]
    assert texts == ["approach", "hover", "check", "descend", "flare", "cutoff", "landed"]
    times = [t for t, _ in script.landing.events]
    assert times == sorted(times)


@pytest.mark.parametrize("what", [{"east": 0.6}, {"speed": 0.5}, {"height": 10.5}, {"pad_age": 2.0}, {"spread": 1.0}])
def test_the_check_waits_for_position_speed_height_and_pad(what: dict[str, float]) -> None:
    script = Script()
    script.show(2.5)
    script.show(5.0, **what)
    assert script.phase is Phase.CHECK
    script.show(1.5)
    assert script.phase is Phase.CHECK  # has to hold for two seconds
    script.show(1.0)
    assert script.phase is Phase.DESCEND


def test_after_some_patience_twice_the_limits_will_do() -> None:
    script = Script()
    script.show(2.5)
    script.show(11.0, east=0.6)
    assert script.phase is Phase.CHECK
    script.show(4.0, east=0.6)
    assert script.phase is Phase.DESCEND


def test_it_sinks_slower_the_lower_and_the_nearer_to_the_cone() -> None:
    script = Script().descending()
    rates = [script.show(height=height).rate for height in (9.0, 3.0, 1.8, 0.8)]
    assert rates == [0.8, 0.5, 0.4, 0.3]
    script = Script().descending()
    assert script.show(height=5.0, east=0.3).rate == 0.8  # cone there: 0.72 m
    assert 0.1 < script.show(height=5.0, east=0.6).rate < 0.5
    assert script.show(height=5.0, east=0.8).rate == 0.0
    assert script.phase is Phase.DESCEND


@pytest.mark.parametrize(
    ("what", "why"), [({"east": 2.0}, "off centre"), ({"pad_age": 2.0}, "pad lost"), ({"spread": 1.0}, "pad lost")]
)
def test_lost_pad_or_limits_end_in_a_go_around_after_some_patience(what: dict[str, float], why: str) -> None:
    script = Script().descending()
    assert script.show(3.5, height=3.0, **what).rate == 0.0
    assert script.phase is Phase.DESCEND
    script.show(1.0, height=3.0, **what)
    assert script.phase is Phase.GO_AROUND
    assert script.landing.events[-1][1] == f"go around: {why}"
    assert script.show(height=3.0, **what).height == script.landing.limits.again_height


def test_a_short_loss_only_stops_the_descent() -> None:
    script = Script().descending()
    script.show(3.0, height=5.0, pad_age=2.0)
    assert script.show(height=5.0).rate == 0.8
    script.show(3.0, height=5.0, pad_age=2.0)
    assert script.phase is Phase.DESCEND


def test_too_much_tilt_breaks_off_at_once() -> None:
    script = Script().flaring()
    script.show(height=1.0, roll=0.4)
    assert script.phase is Phase.GO_AROUND
    assert script.landing.events[-1][1] == "go around: tilt"


def test_close_to_the_ground_the_pad_may_go_unseen_for_longer() -> None:
    script = Script().flaring()
    assert script.show(height=0.7, pad_age=2.0).rate == 0.3
    script = Script().flaring()
    assert script.show(height=1.2, pad_age=2.0).rate == 0.0


def test_it_waits_above_the_ground_until_slow_and_centred_enough() -> None:
    script = Script().flaring()
    assert script.show(height=0.6, speed=0.4).rate == 0.0
    demand = script.show(height=0.4, speed=0.4)
    assert script.phase is Phase.FLARE
    assert demand.powered
    assert demand.height == pytest.approx(SKID_HEIGHT + 0.5)
    script.show(height=0.4, speed=0.05, east=0.3)
    assert script.phase is Phase.FLARE
    script.show(height=0.4, speed=0.05, east=0.05)
    assert script.phase is Phase.CUTOFF


def test_three_tries_then_it_holds_over_the_pad() -> None:
    script = Script()
    for _ in range(3):
        script.show(6.0, height=10.0 if script.landing.tries == 0 else 5.0)
        assert script.phase is Phase.DESCEND
        script.show(4.5, height=4.0, east=2.0)
        if script.phase is Phase.GO_AROUND:
            script.show(0.1, height=5.0)
            assert script.phase is Phase.CHECK
    assert script.phase is Phase.HOLD
    assert script.landing.events[-1][1] == "hold: off centre, 3 tries spent"
    assert script.show(height=4.0).height == 10.0
    assert not script.landing.finished


def test_a_pad_not_found_again_is_looked_for_from_higher_up() -> None:
    script = Script().descending()
    script.show(4.5, height=4.0, pad_age=3.0)
    script.show(1.0, height=5.0, pad_age=10.0)
    assert script.phase is Phase.CHECK
    assert script.show(height=5.0, pad_age=10.0).height == 5.0
    assert script.show(13.0, height=5.0, pad_age=10.0).height == 10.0


def test_standing_still_while_told_to_sink_is_the_ground() -> None:
    """A height that reads too much by half a metre must not keep the rotor running for ever."""
    script = Script().flaring()
    script.show(3.0, height=0.75, climb=-0.3)
    assert script.phase is Phase.FLARE
    script.show(1.7, height=0.75)
    assert script.phase is Phase.CUTOFF
    script.show(2.0, height=0.75)
    assert script.phase is Phase.CUTOFF
    script.show(1.0, height=0.75)
    assert script.phase is Phase.LANDED


def test_the_target_can_be_moved() -> None:
    script = Script().descending()
    script.landing.set_target(3.0, -2.0)
    demand = script.show(height=8.0)
    assert (demand.east, demand.north) == (3.0, -2.0)
    assert demand.rate == 0.0
    assert script.show(height=8.0, east=3.0, north=-2.0).rate == 0.8


def test_a_hover_holds_its_point_and_ends_in_time() -> None:
    hover = Hover(height=7.0, duration=5.0)
    hover.set_target(1.0, 2.0)
    demand = hover.update(state())
    assert (demand.east, demand.north, demand.height) == (1.0, 2.0, 7.0)
    assert not hover.finished
    hover.update(replace(state(), t=5.0))
    assert hover.finished
    assert hover.events == [(0.0, "hover")]
    assert math.isinf(Hover()._duration)


def test_a_descent_pauses_at_its_steps_and_does_not_take_them_for_the_ground() -> None:
    script = Script(steps=(2.0, 5.0, 1.0), step_time=3.0, hover_time=0.1, check_time=0.1)
    script.show(1.0)
    assert script.landing.phase is Phase.DESCEND
    assert script.show(height=8.0).height == 5.0
    assert script.show(2.9, height=5.0).height == 5.0
    assert script.show(0.2, height=5.0).height == 2.0
    assert script.show(2.9, height=2.0).height == 2.0
    assert script.show(0.2, height=2.0).height == 1.0
    assert script.show(2.9, height=1.0).height == 1.0  # longer than what counts as stuck
    assert script.landing.phase is Phase.FLARE
    assert script.show(0.2, height=1.0).height == -math.inf
    steps = [what for _, what in script.landing.events if what.startswith("step")]
    assert steps == ["step at 5 m", "step at 2 m", "step at 1 m"]

"""Height alone: the two sets of measurements, false echoes, downwash, and what the biases absorb."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from estimators import altitude
from estimators.altitude import AltitudeFilter, AltitudeNoise, Mode
from flightlog.equipment import Equipment

DT = 0.004
SONAR_LEVER = -0.03  # [m] of the ranger above the body origin
ECHO = 0.004**2


class Lift:
    """A body that goes up and down on rails, and feeds one filter."""

    def __init__(self, filter_: AltitudeFilter, height: Callable[[float], float], seed: int = 0) -> None:
        self.filter, self.height, self.rng = filter_, height, np.random.default_rng(seed)
        self.baro_error: Callable[[float, float], float] = lambda t, h: 0.4
        self.gps_error: Callable[[float], float] = lambda t: -0.5
        self.sees, self.echoes, self.baro, self.gps = True, True, True, True
        self.false_echo, self.scale = 0.05, 1.0
        self.t = 0.0
        self.modes: list[Mode] = []

    def run(self, until: float) -> float:
        """On to a time; the height error there."""
        rng, d = self.rng, 1e-3
        while self.t < until - 1e-9:
            self.t = t = round(self.t / DT + 1) * DT
            k = round(t / DT)
            h = self.height(t)
            push = (self.height(t - DT / 2 + d) - 2 * self.height(t - DT / 2) + self.height(t - DT / 2 - d)) / d**2
            climb = (self.height(t + d) - self.height(t - d)) / (2 * d)
            f = self.filter
            f.kalman.advance(t, np.array([0.0, 0.0, push + 0.03, 0.0, 0.0]))
            if k % 5 == 0 and self.baro:
                f.baro(t, h + self.baro_error(t, h) + 0.1 * rng.standard_normal())
            if k % 50 == 0 and self.gps:
                f.gps(
                    t, h + self.gps_error(t) + 0.04 * rng.standard_normal(), climb + 0.05 * rng.standard_normal(), 1.0
                )
            if k % 10 == 0 and self.sees:
                f.vision(t, self.scale * h + 0.003 * rng.standard_normal(), 0.004**2)
            if k % 12 == 0 and self.echoes:
                reach = h + SONAR_LEVER
                if reach <= 3.05:
                    f.sonar(t, h + 0.003 * rng.standard_normal(), ECHO, SONAR_LEVER)
                elif rng.random() < self.false_echo:
                    f.sonar(t, rng.uniform(0.15, 3.05) - SONAR_LEVER, ECHO, SONAR_LEVER)
                else:
                    f.sonar(t, math.nan, 1.0, SONAR_LEVER)
            f.kalman.refresh()
            last = f.kalman.last
            f.height, f.deviation = float(last["x"][0]), math.sqrt(last["p"][0, 0])
            f.height_time = float(last["accepted"][1:].max())
            self.modes.append(f.mode)
        return self.filter.height - self.height(self.t)


def descent(high: float, low: float, begin: float, end: float) -> Callable[[float], float]:
    def height(t: float) -> float:
        s = min(1.0, max(0.0, (t - begin) / (end - begin)))
        return high + (low - high) * s**3 * (10 - 15 * s + 6 * s * s)

    return height


@pytest.fixture
def filter_(equipment: Equipment) -> AltitudeFilter:
    return AltitudeFilter(AltitudeNoise.of(equipment), -0.25)


def test_false_echoes_at_height_change_nothing(filter_: AltitudeFilter) -> None:
    lift = Lift(filter_, lambda t: 10.0)
    lift.false_echo = 0.3
    assert abs(lift.run(30.0)) < 0.02
    assert set(lift.modes) == {Mode.HIGH}
    assert filter_.kalman.last["accepted"][altitude.TOPIC_SONAR] == -math.inf


def test_false_echoes_do_not_fool_a_filter_that_is_unsure(filter_: AltitudeFilter) -> None:
    """Barometer alone, half a metre wrong, hovering just out of the ranger's reach."""
    lift = Lift(filter_, lambda t: 3.3)
    lift.sees = lift.gps = False
    lift.false_echo = 0.2
    lift.baro_error = lambda t, h: -0.5
    lift.run(30.0)
    assert filter_.kalman.last["accepted"][altitude.TOPIC_SONAR] == -math.inf


def test_near_the_ground_the_downwash_does_not_pull(filter_: AltitudeFilter) -> None:
    lift = Lift(filter_, descent(10.0, 0.25, 5.0, 20.0))
    lift.baro_error = lambda t, h: 0.4 - 2.5 * math.exp(-max(0.0, h - 0.23) / 0.4)
    lift.run(14.0)
    bias = float(filter_.kalman.last["x"][altitude.B_Q])
    assert abs(lift.run(25.0)) < 0.01
    assert filter_.mode is Mode.NEAR
    assert float(filter_.kalman.last["x"][altitude.B_Q]) == pytest.approx(bias, abs=0.1)


def test_the_same_without_vision_and_gps(filter_: AltitudeFilter) -> None:
    """Barometer and ranger alone: the first brings it down, the second takes over."""
    lift = Lift(filter_, descent(10.0, 0.25, 5.0, 20.0))
    lift.sees = lift.gps = False
    lift.baro_error = lambda t, h: 0.4 - 2.5 * math.exp(-max(0.0, h - 0.23) / 0.4)
    assert abs(lift.run(25.0)) < 0.02


def test_the_barometer_s_bias_is_found_and_kept_for_the_way_up(filter_: AltitudeFilter) -> None:
    down, up = descent(6.0, 1.0, 5.0, 13.0), descent(1.0, 8.0, 18.0, 26.0)
    lift = Lift(filter_, lambda t: down(t) if t < 15 else up(t))
    lift.baro_error = lambda t, h: 0.8 - 2.5 * math.exp(-max(0.0, h - 0.23) / 0.4)
    lift.run(10.0)
    lift.sees = lift.gps = False
    assert abs(lift.run(17.0)) < 0.02
    assert filter_.mode is Mode.NEAR
    # back at height the barometer alone carries it, its bias known from before
    assert abs(lift.run(30.0)) < 0.15
    assert filter_.mode is Mode.HIGH


@pytest.mark.parametrize(("centre", "mode"), [(3.0, Mode.HIGH), (2.75, Mode.NEAR)])
def test_the_mode_has_hysteresis(filter_: AltitudeFilter, centre: float, mode: Mode) -> None:
    """Up and down across one threshold and not across the other: at most the first choice is made."""
    lift = Lift(filter_, lambda t: centre - SONAR_LEVER + 0.15 * math.sin(2.0 * t) * min(1.0, t / 5))
    lift.run(30.0)
    changes = sum(a is not b for a, b in zip(lift.modes, lift.modes[1:], strict=False))
    assert changes <= 1
    assert lift.modes[-1] is mode


def test_echoes_that_insist_correct_a_filter_astray(filter_: AltitudeFilter) -> None:
    """Without any other height than a barometer that is 3 m wrong, the ranger must win in the end."""
    lift = Lift(filter_, lambda t: 1.5)
    lift.sees = lift.gps = False
    lift.baro_error = lambda t, h: 3.0
    lift.echoes = False
    assert lift.run(10.0) > 1.5
    lift.echoes = True
    assert abs(lift.run(15.0)) < 0.02


def test_without_any_other_height_the_barometer_is_heard_near_the_ground(filter_: AltitudeFilter) -> None:
    lift = Lift(filter_, descent(4.0, 2.0, 5.0, 9.0))
    lift.baro_error = lambda t, h: 0.2
    lift.run(8.0)
    lift.sees = lift.gps = lift.echoes = False
    lift.run(60.0)
    assert abs(lift.filter.height - 2.0) < 1.0
    assert lift.filter.deviation < 1.5


def test_a_jump_of_the_gps_goes_into_its_bias(filter_: AltitudeFilter) -> None:
    lift = Lift(filter_, lambda t: 10.0)
    lift.gps_error = lambda t: -0.5 if t < 10 else 3.0
    lift.run(20.0)
    assert abs(lift.filter.height - 10.0) < 0.02
    assert float(filter_.kalman.last["x"][altitude.B_G]) == pytest.approx(3.0, abs=0.1)


def test_what_only_differs_in_bias_is_told_apart_by_vision_alone(filter_: AltitudeFilter) -> None:
    """Barometer and GPS cannot find the height within their biases, and the filter must know that."""
    lift = Lift(filter_, lambda t: 10.0)
    lift.sees = False
    lift.run(20.0)
    assert 0.3 < filter_.deviation < 0.8
    lift.sees = True
    lift.run(22.0)
    assert filter_.deviation < 0.02


def test_the_scale_of_vision_does_not_average_out_but_comes_down_with_the_height(filter_: AltitudeFilter) -> None:
    lift = Lift(filter_, descent(10.0, 1.0, 20.0, 35.0))
    lift.scale = 1.003
    lift.run(20.0)
    assert 0.008 < filter_.deviation < 0.02
    assert abs(lift.filter.height - 10.0) < 3.5 * filter_.deviation
    lift.echoes = False
    assert abs(lift.run(36.0)) < 0.006


def test_high_mode_is_the_published_filter_where_that_can_be(equipment: Equipment) -> None:
    """Equations 15 and 16 by filterpy: hovering, with the same noise and no acceleration, the same height."""
    noise = AltitudeNoise(
        acceleration=1e-6,
        acceleration_bias=1e-9,
        acceleration_drift=1e-9,
        baro_drift=1e-9,
        gps_bias=1e-9,
        gps_wander=1e-9,
        baro=0.1,
        gps=0.165,
        scale=1e-9,
    )
    filter_ = AltitudeFilter(noise, 0.0)
    root = filter_.kalman.memory["ring"][0, 0]
    root["p"] = np.diag([100.0**2, 1e-12, 1e-12, 0.7**2, 1e-12, 1e-18, 1e-18])
    oracle = KalmanFilter(dim_x=2, dim_z=1)
    oracle.x, oracle.P = np.zeros((2, 1)), np.diag([100.0**2, 0.7**2])
    oracle.F, oracle.Q = np.eye(2), np.zeros((2, 2))
    rng = np.random.default_rng(3)
    for k in range(1, 400):
        t = 0.02 * k
        filter_.kalman.advance(t, np.zeros(5))
        z = 10.0 + np.array([0.5 + 0.05 * rng.uniform(-1, 1), 0.05 * rng.uniform(-1, 1), 0.1 * rng.uniform(-1, 1)])
        filter_.baro(t, z[0])
        filter_.kalman.insert(t, altitude.GPS, filter_._rows[altitude.GPS], z[1], 0.165**2)
        filter_.vision(t, z[2], 0.351**2)
        filter_.kalman.refresh()
        for value, row, std in zip(z, [[1, 1], [1, 0], [1, 0]], [0.1, 0.165, 0.351], strict=True):
            oracle.update(np.array([[value]]), R=np.array([[std**2]]), H=np.array([row], float))
    last = filter_.kalman.last
    assert last["x"][altitude.H] == pytest.approx(oracle.x[0, 0], abs=1e-5)
    assert last["x"][altitude.B_Q] == pytest.approx(oracle.x[1, 0], abs=1e-5)
    assert last["p"][0, 0] == pytest.approx(oracle.P[0, 0], rel=1e-3)

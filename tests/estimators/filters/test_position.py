"""Horizontal position alone: cut marks, biases, tilt."""

import math
from dataclasses import replace

import numpy as np
import pytest

from estimators import position
from estimators.position import PositionFilter, PositionNoise
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment

DT = 0.004


class Rails:
    """Stands still in the world; what the sensors say is wrong by what is set."""

    def __init__(self, filter_: PositionFilter, seed: int = 0) -> None:
        self.filter, self.rng, self.t = filter_, np.random.default_rng(seed), 0.0
        self.gps_bias = np.array([0.6, -0.4])
        self.tilt = np.zeros(2)  # d of the attitude
        self.accelerometer = np.zeros(2)
        self.height = 10.0
        self.sees, self.gps = True, True

    def run(self, until: float) -> np.ndarray:
        """On to a time; x (10,) there."""
        rng, f = self.rng, self.filter
        while self.t < until - 1e-9:
            self.t = t = round(self.t / DT + 1) * DT
            k = round(t / DT)
            f.kalman.advance(t, np.array([*(GRAVITY * self.tilt + self.accelerometer), 0.0, 0.0, 0.0]))
            if k % 50 == 0 and self.gps:
                f.gps(t, *(self.gps_bias + 0.02 * rng.standard_normal(2)), *(0.05 * rng.standard_normal(2)), 1.0)
            if k % 10 == 0 and self.sees:
                seen = self.height * self.tilt + 0.004 * rng.standard_normal(2)
                f.vision(t, *seen, 0.005**2, 0.0, 0.005**2, self.height)
            f.kalman.refresh()
        return np.array(f.kalman.last["x"])


@pytest.fixture
def filter_(equipment: Equipment) -> PositionFilter:
    return PositionFilter(PositionNoise.of(equipment), 0.0)


def test_vision_finds_the_bias_of_the_gps_and_nothing_jumps_when_the_mark_is_lost(filter_: PositionFilter) -> None:
    rails = Rails(filter_)
    x = rails.run(10.0)
    np.testing.assert_allclose(x[[position.G_E, position.G_N]], rails.gps_bias, atol=0.08)
    rails.sees = False
    track = [rails.run(10.0 + 0.2 * k)[:2].copy() for k in range(1, 26)]
    assert np.abs(np.diff(track, axis=0)).max() < 0.03
    assert np.abs(track[-1]).max() < 0.15  # half a metre is what the GPS says


def test_gps_alone_leads_to_the_pad_and_knows_how_badly(filter_: PositionFilter) -> None:
    rails = Rails(filter_)
    rails.sees = False
    x = rails.run(20.0)
    np.testing.assert_allclose(x[:2], rails.gps_bias, atol=0.3)
    std = np.sqrt(np.diag(filter_.kalman.last["p"])[:2])
    assert np.all((std > 0.4) & (std < 0.8))


def test_a_mark_cut_so_that_one_direction_is_open_corrects_the_other_alone(filter_: PositionFilter) -> None:
    for t in np.arange(1, 100) * DT:
        filter_.kalman.advance(float(t), np.zeros(5))
    before = filter_.kalman.last["p"].copy()
    # sure along 30 deg from east, open across
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    sure, open_ = 0.01**2, 50.0**2
    c_ee, c_en, c_nn = c * c * sure + s * s * open_, c * s * (sure - open_), s * s * sure + c * c * open_
    assert filter_.vision(99 * DT, 0.5 * c, 0.5 * s, c_ee, c_en, c_nn, 0.0)
    filter_.kalman.refresh()
    last = filter_.kalman.last
    along, across = np.array([c, s]), np.array([-s, c])
    p = last["p"][:2, :2]
    assert along @ p @ along == pytest.approx(sure, rel=0.01)
    assert across @ p @ across == pytest.approx(before[0, 0], rel=0.01)
    assert along @ last["x"][:2] == pytest.approx(0.5, abs=1e-3)


def test_an_oblique_covariance_updates_as_the_joint_one_does(filter_: PositionFilter) -> None:
    """Two scalar updates along the principal axes against one of both together."""
    for t in np.arange(1, 100) * DT:
        filter_.kalman.advance(float(t), np.zeros(5))
    x, p = filter_.kalman.last["x"].copy(), filter_.kalman.last["p"].copy()
    r = np.array([[0.04, 0.03], [0.03, 0.06]])
    z, height = np.array([1.0, -2.0]), 8.0
    h = np.zeros((2, len(x)))
    h[0, [position.E, position.D_E]] = 1.0, height
    h[1, [position.N, position.D_N]] = 1.0, height
    gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
    filter_.vision(99 * DT, *z, r[0, 0], r[0, 1], r[1, 1], height)
    filter_.kalman.refresh()
    np.testing.assert_allclose(filter_.kalman.last["x"], x + gain @ (z - h @ x), atol=1e-8)
    np.testing.assert_allclose(filter_.kalman.last["p"], p - gain @ h @ p, atol=1e-7)


def test_tilt_and_accelerometer_hovering_are_one_and_coming_down_two(equipment: Equipment) -> None:
    """A levelled attitude: the tilt error hides the accelerometer's bias until the height changes."""
    steady = replace(PositionNoise.of(equipment), tilt_walk=1e-5)
    filter_ = PositionFilter(steady, 0.0)
    rails = Rails(filter_)
    rails.tilt = np.array([0.006, -0.004])
    rails.accelerometer = -GRAVITY * rails.tilt
    rails.run(20.0)
    hidden = np.sqrt(np.diag(filter_.kalman.last["p"])[position.D_E])
    for height in np.linspace(10.0, 1.0, 60):
        rails.height = float(height)
        x = rails.run(rails.t + 0.2)
    found = np.sqrt(np.diag(filter_.kalman.last["p"])[position.D_E])
    assert found < 0.9 * hidden
    assert np.abs(x[:2]).max() < 0.02


def test_told_of_its_correction_it_does_not_learn_the_tilt_twice(filter_: PositionFilter) -> None:
    """d' = c: after the attitude was turned by what was found, nothing is left to find."""
    rails = Rails(filter_)
    rails.tilt = np.array([0.01, 0.0])
    rails.sees = False
    x = rails.run(15.0)
    found = x[[position.D_E, position.D_N]]
    assert found[0] > 0.005
    filter_.kalman.advance(rails.t + DT, np.array([0.0, 0.0, 0.0, *(-found / DT)]))
    np.testing.assert_allclose(filter_.kalman.last["x"][[position.D_E, position.D_N]], 0.0, atol=1e-6)


def test_a_false_mark_does_not_take_it_away_and_the_true_one_comes_back(filter_: PositionFilter) -> None:
    rails = Rails(filter_)
    rails.run(5.0)
    rails.sees = False
    for k in range(1, 20):
        filter_.vision(rails.run(5.0 + 0.04 * k)[0] * 0 + rails.t, 3.0, 2.0, 1e-4, 0.0, 1e-4, 10.0)
    filter_.kalman.refresh()
    assert np.abs(filter_.kalman.last["x"][:2]).max() < 0.1
    rails.sees = True
    assert np.abs(rails.run(8.0)[:2]).max() < 0.1


def test_a_tilt_that_perspective_shows_leaves_the_position_what_the_picture_knows(filter_: PositionFilter) -> None:
    """In closed form: p + h d is seen to 1 mm and d to 0.5 mrad, nothing else is known."""
    h, seen, shown, prior = 8.0, 1e-3, 5e-4, filter_.noise.tilt_start
    filter_.kalman.advance(DT, np.zeros(5))
    assert filter_.vision(DT, 0.3 + h * 0.01, -0.2 - h * 0.02, seen**2, 0.0, seen**2, h)
    assert filter_.tilt(DT, 0.01, -0.02, shown**2, 0.0, shown**2)
    filter_.kalman.refresh()
    x, p = filter_.kalman.last["x"], filter_.kalman.last["p"]
    variance = 1.0 / (1.0 / prior**2 + 1.0 / shown**2)
    np.testing.assert_allclose(np.diag(p)[[position.D_E, position.D_N]], variance, rtol=1e-3)
    np.testing.assert_allclose(np.diag(p)[:2], seen**2 + h**2 * variance, rtol=1e-2)
    share = variance / shown**2
    np.testing.assert_allclose(x[[position.D_E, position.D_N]], [0.01 * share, -0.02 * share], rtol=1e-3)
    np.testing.assert_allclose(x[:2], [0.3 + h * 0.01 * (1 - share), -0.2 - h * 0.02 * (1 - share)], atol=1e-3)


def test_a_tilt_shown_better_one_way_corrects_that_way_alone(filter_: PositionFilter) -> None:
    c, s = math.cos(0.7), math.sin(0.7)
    sure, open_ = 1e-4**2, 1.0
    c_ee, c_en, c_nn = c * c * sure + s * s * open_, c * s * (sure - open_), s * s * sure + c * c * open_
    filter_.kalman.advance(DT, np.zeros(5))
    assert filter_.tilt(DT, 0.005 * c, 0.005 * s, c_ee, c_en, c_nn)
    filter_.kalman.refresh()
    p = filter_.kalman.last["p"][position.D_E : position.D_N + 1, position.D_E : position.D_N + 1]
    assert np.array([c, s]) @ p @ [c, s] == pytest.approx(sure, rel=1e-2)
    noise = filter_.noise
    unknown = noise.tilt_start**2 + (noise.accelerometer / GRAVITY) ** 2
    assert np.array([-s, c]) @ p @ [-s, c] == pytest.approx(unknown, rel=1e-2)

"""The key frame's place in the filter, and the filters as published."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from estimators import position
from estimators.complementary import ComplementaryGains, FlowVelocity, PlumbLineAttitude
from estimators.position import PositionFilter, PositionNoise
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment
from flightlog.rotations import angles, from_vector, matrix, multiply, quaternion

DT = 0.004


@pytest.fixture
def flown(equipment: Equipment) -> PositionFilter:
    """A filter with flow that has flown 0.4 s blind."""
    filter_ = PositionFilter(PositionNoise.of(equipment), 0.0, flow=True, integral=0.3)
    for k in range(1, 101):
        filter_.kalman.advance(DT * k, np.zeros(5))
    return filter_


def test_a_copied_state_is_the_stochastic_clone(flown: PositionFilter) -> None:
    """Against the textbook: x and P augmented by J x and J P J'."""
    x, p = (value.copy() for value in flown.kalman.state_at(100 * DT))
    flown.key_frame(100 * DT, 0.7)
    flown.kalman.refresh()
    jacobian = np.eye(len(x))
    for axis in range(2):
        jacobian[position.K_E + axis] = 0.0
        jacobian[position.K_E + axis, [position.E + axis, position.D_E + axis]] = 1.0, 0.7
    grain = np.zeros(len(x))
    grain[position.K_E : position.K_N + 1] = position.GRAIN**2
    got, covariance = flown.kalman.state_at(100 * DT)
    np.testing.assert_allclose(got, jacobian @ x, atol=1e-12)
    np.testing.assert_allclose(covariance, jacobian @ p @ jacobian.T + np.diag(grain), atol=1e-9)


def test_the_way_since_a_key_frame_does_not_tell_where_it_was(flown: PositionFilter) -> None:
    flown.key_frame(100 * DT, 0.0)
    for k in range(101, 501):
        flown.kalman.advance(DT * k, np.zeros(5))
        if k % 10 == 0:
            flown.flow(DT * k, 0.3 * DT * (k - 100), 0.0, 1e-8, 0.0)
    flown.kalman.refresh()
    x, p = flown.kalman.state_at(500 * DT)
    way = np.zeros(len(x))
    way[[position.E, position.K_E]] = 1.0, -1.0
    assert p[position.E, position.E] > 0.9 * 100.0**2, "as unsure as at the start"
    assert math.sqrt(way @ p @ way) < 2e-3
    assert x[position.VE] == pytest.approx(0.3, abs=0.02)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.permutations(range(8)))
def test_copies_too_act_in_order_of_time_whatever_the_order_of_arrival(equipment: Equipment, order: list[int]) -> None:
    def run(arrivals: list[int]) -> PositionFilter:
        filter_ = PositionFilter(PositionNoise.of(equipment), 0.0, flow=True, integral=0.3)
        for k in range(1, 101):
            filter_.kalman.advance(DT * k, np.array([0.3, -0.2, 0.0, 0.0, 0.0]))
        for i in arrivals:
            t = 0.02 + 0.045 * i
            if i in (0, 4):
                filter_.key_frame(t, 0.9)
            elif i in (2, 7):
                filter_.vision(t, 0.1 * i, 0.05, 1e-3, 0.0, 1e-3, 0.9)
            else:
                filter_.flow(t, 0.01 * i, -0.02 * i, 1e-4, 0.9)
            filter_.kalman.refresh()
        return filter_

    late, batch = run(order).kalman, run(list(range(8))).kalman
    for got, wanted in zip(late.state_at(0.4), batch.state_at(0.4), strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-7)
    assert np.all(late.innovations().component < position.KEY_E), "a copy is no measurement"


def test_without_flow_the_filter_has_no_key_frame(equipment: Equipment) -> None:
    noise = PositionNoise.of(equipment)
    plain, with_flow = PositionFilter(noise, 0.0), PositionFilter(noise, 0.0, flow=True, integral=0.3)
    assert plain.kalman.state_at(0.0)[0].shape == (position.K_E,)
    assert with_flow.kalman.state_at(0.0)[0].shape == (position.K_N + 1,)
    assert plain.kalman.memory.dtype is with_flow.kalman.memory.dtype, "compiled once"


def test_flow_finds_tilt_drift_and_the_gyroscopes_bias(equipment: Equipment) -> None:
    """Level flight at rest at 1 m, attitude wrong by 5 mrad and drifting 1 mrad/s: the force is off by g d."""
    noise = replace(PositionNoise.of(equipment), accelerometer=1e-4)
    filter_ = PositionFilter(noise, 0.0, flow=True, integral=0.3)
    rng = np.random.default_rng(2)
    for k in range(1, 1000):
        t = DT * k
        tilt = 0.005 + 0.001 * t
        filter_.kalman.advance(t, np.array([GRAVITY * tilt, 0.0, 0.0, 0.0, 0.0]))
        if k == 10:
            assert filter_.begin(t, 0.001, 0.01, 1.0)
            assert filter_.key_frame(t + 1e-6, 1.0)
            first = tilt
        elif k > 10 and k % 10 == 0:
            assert filter_.flow(t, tilt - first + 1e-4 * rng.standard_normal(), 1e-4 * rng.standard_normal(), 1e-8, 1.0)
    filter_.kalman.refresh()
    x, p = filter_.kalman.state_at(t)
    assert x[position.D_E] == pytest.approx(tilt, abs=1e-3)
    assert abs(x[position.D_E] - tilt) < 4.0 * math.sqrt(p[position.D_E, position.D_E])
    assert x[position.B_E] == pytest.approx(0.001, abs=3e-4)
    assert abs(x[position.B_N]) < 3e-4
    assert np.abs(x[:2]).max() < 0.002
    assert abs(x[position.B_E] - 0.001) < 4.0 * math.sqrt(p[position.B_E, position.B_E])


# as published


def test_the_plumb_line_turns_the_attitude_back_and_learns_the_gyroscopes_bias() -> None:
    truth = quaternion(0.1, -0.05, 0.4)
    filter_ = PlumbLineAttitude(ComplementaryGains(), multiply(truth, from_vector(np.array([0.06, -0.04, 0.0]))))
    force, bias = matrix(truth).T @ np.array([0.0, 0.0, GRAVITY]), np.array([0.002, -0.001, 0.0])
    for _ in range(int(120 / DT)):
        filter_.step(force, bias, DT)
    roll, pitch, _ = angles(filter_.quaternion)
    np.testing.assert_allclose([roll, pitch], [0.1, -0.05], atol=2e-4)


def test_published_velocity_forgets_a_constant_error_of_the_accelerometer() -> None:
    filter_, alone = FlowVelocity(ComplementaryGains()), FlowVelocity(ComplementaryGains())
    for k in range(int(20 / DT)):
        if k % 10 == 0:
            filter_.flow(np.zeros(2), 10 * DT)
        for each in (filter_, alone):
            each.step(np.array([0.05, 0.0]), DT)
    assert abs(filter_.velocity[0]) < 1e-3
    assert alone.velocity[0] == pytest.approx(1.0, rel=1e-6)
    assert alone.position[0] == pytest.approx(10.0, rel=1e-3)

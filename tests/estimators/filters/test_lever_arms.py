"""From sensors to the body origin, against scipy's rotations and sampled errors."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from estimators.attitude import AttitudeFilter, propagate
from estimators.attitude_memory import ATTITUDE
from estimators.lever_arms import antenna, pad_in_world, ranger
from flightlog.camera import DOWN
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment
from flightlog.rotations import quaternion

tilts = st.floats(-0.3, 0.3)


def memory_of(roll: float, pitch: float, heading: float, rates=(0.0, 0.0, 0.0)) -> np.ndarray:
    """An attitude filter's memory that holds one attitude."""
    memory = np.zeros(1, ATTITUDE)
    memory["q"] = memory["quaternions"][0, 0] = quaternion(roll, pitch, heading)
    memory["turning"][0, 0] = rates
    memory["samples"] = 1
    return memory


def rotation_of(memory: np.ndarray) -> Rotation:
    return Rotation.from_quat(memory["q"][0], scalar_first=True)


@settings(max_examples=50, deadline=None)
@given(roll=tilts, pitch=tilts, heading=st.floats(0, 6.28), wx=tilts, wy=tilts, wz=st.floats(-2, 2))
def test_the_antenna_is_taken_back_to_the_body_origin(roll, pitch, heading, wx, wy, wz) -> None:
    memory, mount, rates = memory_of(roll, pitch, heading, (wx, wy, wz)), np.array([-0.6, 0.02, 0.08]), [wx, wy, wz]
    rotation, p, v = rotation_of(memory), np.array([3.0, -2.0, 9.0]), np.array([0.5, 0.1, -0.7])
    at, moving = p + rotation.apply(mount), v + rotation.apply(np.cross(rates, mount))
    np.testing.assert_allclose(antenna(memory, 0.0, *at, *moving, mount), [*p, *v], atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(roll=tilts, pitch=tilts, heading=st.floats(0, 6.28), e=st.floats(-3, 3), n=st.floats(-3, 3), u=st.floats(1, 12))
def test_a_sighting_gives_the_place_it_was_made_from(roll, pitch, heading, e, n, u) -> None:
    memory, mount = memory_of(roll, pitch, heading), np.array([0.1, 0.0, -0.1])
    seen = DOWN.T @ (rotation_of(memory).inv().apply([-e, -n, -u]) - mount)
    found = pad_in_world(memory, 0.0, *seen, np.eye(3), mount, DOWN, 0.0, 0.0, 0.0)[:3]
    np.testing.assert_allclose(found, [e, n, u], atol=1e-9)


def test_the_covariance_of_a_sighting_is_that_of_its_errors() -> None:
    """Picture and heading errors drawn at random; the tilt's share of the horizontal is a state elsewhere."""
    rng = np.random.default_rng(0)
    memory, mount = memory_of(0.1, -0.05, 1.0), np.array([0.1, 0.0, -0.1])
    std_heading = 0.02
    memory["variance_heading"] = std_heading**2
    place = np.array([2.0, 1.0, 6.0])
    covariance = np.array([[4.0, 1.5, 0.5], [1.5, 2.0, -0.3], [0.5, -0.3, 9.0]]) * 1e-4
    seen = DOWN.T @ (rotation_of(memory).inv().apply(-place) - mount)
    found = pad_in_world(memory, 0.0, *seen, covariance, mount, DOWN, 0.0, 0.0, 0.0)
    samples = np.empty((20_000, 3))
    for i, error in enumerate(rng.multivariate_normal(np.zeros(3), covariance, len(samples))):
        arm = rotation_of(memory).apply(mount + DOWN @ (seen + error))
        samples[i] = -Rotation.from_rotvec([0, 0, std_heading * rng.standard_normal()]).apply(arm)
    c = np.cov(samples.T)
    np.testing.assert_allclose(found[3:], [c[0, 0], c[0, 1], c[1, 1], c[2, 2]], rtol=0.06)


def test_tilt_enters_the_height_by_the_lateral_distance() -> None:
    memory = memory_of(0.0, 0.0, 0.0)
    memory["variance_level"] = 0.01**2
    seen = DOWN.T @ np.array([-3.0, 0.0, -10.0])
    zero = np.zeros((3, 3))
    *_, c_uu = pad_in_world(memory, 0.0, *seen, zero, np.zeros(3), DOWN, 0.0, 0.0, 0.0)
    assert c_uu == pytest.approx((3.0 * 0.01) ** 2, rel=1e-9)


@pytest.mark.parametrize(("tilt_deg", "slant_deg"), [(0.0, 0.0), (8.0, 0.0), (15.0, 5.0), (25.0, 15.0)])
def test_the_nearest_ground_in_the_beam_answers(tilt_deg: float, slant_deg: float) -> None:
    memory, mount = memory_of(math.radians(tilt_deg), 0.0, 0.5), np.array([0.08, 0.0, -0.03])
    lever = rotation_of(memory).apply(mount)[2]
    above = 2.0
    echo = (above + lever) / math.cos(math.radians(slant_deg))
    height, found = ranger(memory, echo, mount, math.radians(10.0))
    assert height == pytest.approx(above, abs=1e-12)
    assert found == pytest.approx(lever, abs=1e-12)


def test_an_antenna_s_fix_is_taken_by_the_attitude_of_its_time(equipment: Equipment) -> None:
    """A fix of 0.18 s ago, while the nose turned by 30 deg since."""
    filter_ = AttitudeFilter(equipment)
    rate = math.radians(30.0) / 0.18
    for k in range(300):
        turn = rate if k >= 100 else 0.0
        propagate(filter_.memory, 0.004 * k, 0.0, 0.0, GRAVITY, 0.0, 0.0, turn, 0.0, 0.0, 1e-6, 1.0)
    mount, t = np.array([-0.6, 0.0, 0.0]), 299 * 0.004 - 0.18
    then = Rotation.from_quat(filter_.at(t), scalar_first=True)
    now = Rotation.from_quat(filter_.quaternion, scalar_first=True)
    assert np.degrees((then.inv() * now).magnitude()) == pytest.approx(30.0, abs=0.1)
    arm = then.apply(mount)
    np.testing.assert_allclose(antenna(filter_.memory, t, *arm, 0, 0, 0, mount)[:3], 0.0, atol=1e-9)

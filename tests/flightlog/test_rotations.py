import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from flightlog import rotations

# away from the poles of pitch, where heading and roll are one
rolls = st.floats(-math.pi + 1e-6, math.pi - 1e-6)
pitches = st.floats(-1.5, 1.5)
headings = st.floats(0.0, 2.0 * math.pi - 1e-9)
units = arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1).map(
    lambda q: q / np.linalg.norm(q)
)  # fmt: skip
vectors = arrays(float, 3, elements=st.floats(-3, 3))


def scipy_of(q):
    return Rotation.from_quat(q, scalar_first=True)


def around(angle):
    """Distance of an angle from 0 around the circle."""
    return abs(math.remainder(angle, 2.0 * math.pi))


@given(units)
def test_matrix_agrees_with_scipy(q):
    np.testing.assert_allclose(rotations.matrix(q), scipy_of(q).as_matrix(), atol=1e-12)


@given(units, units)
def test_product_turns_by_the_second_then_by_the_first(a, b):
    product = rotations.multiply(a, b)
    np.testing.assert_allclose(
        rotations.matrix(product), (scipy_of(a) * scipy_of(b)).as_matrix(), atol=1e-12
    )  # fmt: skip


@given(vectors, st.sampled_from([1.0, 1e-3, 1e-5, 1e-9, 0.0]))
def test_rotation_vector_agrees_with_scipy(v, scale):
    q = rotations.from_vector(v * scale)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(rotations.matrix(q), Rotation.from_rotvec(v * scale).as_matrix(), atol=1e-12)


@given(rolls, pitches, headings)
def test_angles_come_back(roll, pitch, heading):
    found = rotations.angles(rotations.quaternion(roll, pitch, heading))
    assert around(found[0] - roll) < 1e-7
    assert found[1] == pytest.approx(pitch, abs=1e-7)
    assert around(found[2] - heading) < 1e-7
    assert 0.0 <= found[2] < 2.0 * math.pi


@given(rolls, pitches, headings)
def test_one_rotation_and_whole_logs_agree(roll, pitch, heading):
    log = rotations.from_angles([roll, 0.0], [pitch, 0.0], [heading, 0.0])
    q = rotations.quaternion(roll, pitch, heading)
    np.testing.assert_allclose(rotations.matrix(q), log.as_matrix()[0], atol=1e-12)
    back = rotations.to_angles(log)
    assert around(back[0][0] - roll) < 1e-7
    assert back[1][0] == pytest.approx(pitch, abs=1e-7)
    assert around(back[2][0] - heading) < 1e-7


@given(rolls, pitches, headings)
def test_heading_pitch_roll_are_applied_in_this_order(roll, pitch, heading):
    def about(axis, angle):
        return Rotation.from_rotvec(np.array(axis) * angle).as_matrix()

    expected = about((0, 0, 1), math.pi / 2 - heading) @ about((0, 1, 0), -pitch) @ about((1, 0, 0), roll)
    np.testing.assert_allclose(rotations.matrix(rotations.quaternion(roll, pitch, heading)), expected, atol=1e-12)


NOSE, LEFT, UP = np.eye(3)


@pytest.mark.parametrize(
    ("angles", "body", "world"),
    [
        ((0, 0, 0), NOSE, (0, 1, 0)),  # heading 0: the nose to the north
        ((0, 0, 0), LEFT, (-1, 0, 0)),  # and left is west
        ((0, 0, math.pi / 2), NOSE, (1, 0, 0)),  # clockwise: heading 90 degrees is east
        ((0, math.radians(30), 0), NOSE, (0, math.cos(math.radians(30)), 0.5)),  # pitch: the nose up
        ((math.radians(30), 0, 0), LEFT, (-math.cos(math.radians(30)), 0, 0.5)),  # roll: left up, right down
    ],
)
def test_signs_of_roll_pitch_and_heading(angles, body, world):
    np.testing.assert_allclose(rotations.matrix(rotations.quaternion(*map(float, angles))) @ body, world, atol=1e-12)


@pytest.mark.parametrize(
    ("rate", "changes"),
    [
        ((0.1, 0, 0), (+1, 0, 0)),  # wx > 0 rolls right
        ((0, 0.1, 0), (0, -1, 0)),  # wy > 0 is nose down
        ((0, 0, 0.1), (0, 0, -1)),  # wz > 0 turns left
    ],
)
def test_signs_of_the_body_rates(rate, changes):
    start = rotations.quaternion(0.0, 0.0, 1.0)
    turned = rotations.multiply(start, rotations.from_vector(np.array(rate, float)))
    change = np.array(rotations.angles(turned)) - rotations.angles(start)
    np.testing.assert_allclose(change, 0.1 * np.array(changes), atol=1e-12)


@given(st.floats(-1e4, 1e4))
def test_wrap_keeps_the_direction(angle):
    wrapped = rotations.wrap(angle)
    assert -math.pi <= wrapped < math.pi
    assert around(wrapped - angle) < 1e-9


def test_wrap_ends():
    assert rotations.wrap(math.pi) == -math.pi
    assert rotations.wrap(-math.pi) == -math.pi
    assert rotations.wrap(math.nextafter(-math.pi, -4.0)) < math.pi


def test_heading_never_is_the_whole_circle():
    assert rotations.turn(-1e-17) == 0.0
    assert rotations.turn(2.0 * math.pi) == 0.0
    just_west_of_north = rotations.from_angles([0.0], [0.0], [-1e-17])
    assert 0.0 <= rotations.to_angles(just_west_of_north)[2][0] < 2.0 * math.pi

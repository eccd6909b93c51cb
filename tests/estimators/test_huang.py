"""The published horizon: line, ground's share and pitch by two cameras, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators.vision.huang_horizon import BETWEEN, HuangPair, exact_angles, level_share, pair_pitch
from estimators.vision.huang_line import GAUSS, SECOND, SIGMA, HuangLine, edges, find_line
from flightlog.camera import CameraModel, CameraMount
from flightlog.rotations import matrix, quaternion

CAMERA = CameraModel.centred(640, 480, 560.0)
A, B = CameraMount.forward(np.zeros(3)), CameraMount.forward(np.zeros(3), BETWEEN)
WIDTH, HEIGHT = CAMERA.width, CAMERA.height


def true_line(mount: CameraMount, roll: float, pitch: float) -> HuangLine:
    """The horizon of an ideal camera."""
    x, y, z = (matrix(quaternion(roll, pitch, 0.0)) @ mount.axes)[2]
    line = np.linalg.inv(CAMERA.matrix).T @ [x, y, z]
    line *= np.sign(line[1]) / np.hypot(line[0], line[1])
    return HuangLine(-line[2], math.atan2(line[1], line[0]))


def sky(mount: CameraMount, roll: float, pitch: float, seed: int = 0) -> np.ndarray:
    """Sky over ground (H, W, 3), the edge mixed over a pixel."""
    line = true_line(mount, roll, pitch)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    below = np.clip(x * math.cos(line.theta) + y * math.sin(line.theta) - line.rho + 0.5, 0, 1)[:, :, None]
    noise = np.random.default_rng(seed).normal(0, 2, (HEIGHT, WIDTH, 3))
    picture = np.array([150.0, 180, 220]) * (1 - below) + np.array([60.0, 80, 60]) * below + noise
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def test_the_filter_is_equation_7_and_silent_where_nothing_changes() -> None:
    x = np.arange(-8, 9.0)
    square = x[:, None] ** 2 + x**2
    printed = (square - 2 * SIGMA**2) / SIGMA**4 * np.exp(-square / (2 * SIGMA**2))
    ours = (SECOND * GAUSS.T + GAUSS * SECOND.T).astype(float)
    np.testing.assert_allclose(ours, printed, atol=2e-4)
    assert abs(ours.sum()) < 1e-5
    assert not edges(np.full((60, 80), 90, np.uint8)).any()


@given(st.floats(-0.5, 0.5), st.floats(-0.1, 0.1))
def test_the_exact_form_gives_back_the_attitude(roll: float, pitch: float) -> None:
    for mount in (A, B):
        np.testing.assert_allclose(exact_angles(true_line(mount, roll, pitch), CAMERA, mount), (roll, pitch), atol=1e-9)
    line = true_line(A, roll, pitch)
    assert line.roll == pytest.approx(roll, abs=1e-9)  # equation 1, exact at any pitch
    away = line.rho - CAMERA.cx * math.cos(line.theta) - CAMERA.cy * math.sin(line.theta)
    assert math.atan(away / CAMERA.fy) == pytest.approx(pitch, abs=1e-9)


@given(st.floats(-0.3, 0.3), st.floats(-0.1, 0.1))
def test_equation_3_is_the_area_below_the_line(roll: float, pitch: float) -> None:
    line = true_line(A, roll, pitch)
    rows = np.array([line.row(x) for x in np.linspace(-0.5, WIDTH - 0.5, 2001)])
    area = np.trapezoid(HEIGHT - 0.5 - rows, dx=WIDTH / 2000)
    assert line.ground_share(WIDTH, HEIGHT) == pytest.approx(area / (WIDTH * HEIGHT), abs=1e-9)


def test_pitch_by_the_pair_has_the_right_sign_and_the_tangent_s_error() -> None:
    levels = [level_share(CAMERA, mount) for mount in (A, B)]
    assert levels[0] == pytest.approx(0.5)
    assert levels[1] > levels[0]  # the lower camera sees more ground
    read = {}
    for degrees in (-10, -5, 0, 5):
        shares = [true_line(m, 0.0, math.radians(degrees)).ground_share(WIDTH, HEIGHT) for m in (A, B)]
        read[degrees] = math.degrees(pair_pitch(*shares, *levels))
    assert read[0] == pytest.approx(0.0, abs=1e-9)
    assert read[5] == pytest.approx(5.0, abs=0.05)
    assert read[-10] == pytest.approx(-10.32, abs=0.02)  # (tan 10 + tan 20 - tan 10) / 2 over tan 10


def test_lines_are_found_to_hough_s_cells() -> None:
    for roll, pitch in ((0.0, 0.0), (0.3, 0.05), (-0.4, -0.08)):
        line = find_line(sky(A, roll, pitch))
        assert line is not None
        found = exact_angles(line, CAMERA, A)
        assert math.degrees(abs(found[0] - roll)) < 1.0
        assert math.degrees(abs(found[1] - pitch)) < 0.6


def test_a_short_line_is_no_horizon() -> None:
    """A step that fades sideways and downward, so that it has one edge alone."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    for half, found in ((WIDTH // 12, False), (WIDTH // 4, True)):
        step = 100.0 * (y >= 240) * np.exp(-((x - 320.0) / half) ** 8 - (y - 240.0) / 80.0)
        assert (find_line((100.0 + step).astype(np.uint8)) is not None) == found


def test_a_pair_answers_with_the_later_picture_of_one_time() -> None:
    pair = HuangPair((CAMERA, A), (CAMERA, B))
    eye_a, eye_b = pair.eye("a"), pair.eye("b")
    roll, pitch = 0.1, -0.05
    first, second = sky(A, roll, pitch), sky(B, roll, pitch)
    assert eye_a.see(first, 1.0) is None
    seen = eye_b.see(second, 1.0)
    assert seen is not None
    assert math.degrees(abs(seen.roll - roll)) < 1.0
    assert math.degrees(abs(seen.pitch - pitch)) < 0.8
    assert eye_b.see(second, 1.1) is None  # the first camera's is a tenth of a second old
    assert eye_a.see(first, 1.1) is not None
    assert eye_b.see(np.full_like(second, 90), 1.1) is None

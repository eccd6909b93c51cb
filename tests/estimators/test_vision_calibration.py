"""Calibration against cameras that are known, and corners against where they were drawn."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimators.vision.calibration import Chessboard, calibrate, find_board
from flightlog.camera import CameraModel

TRUE = CameraModel(768, 494, 952.4, 816.3, 389.2, 241.7, (-0.21, 0.11, 6e-4, -4e-4, 0.0))
BOARD = Chessboard()


def sightings(rng, count, noise):
    """Corners of the board from `count` sides, noise [px] on each."""
    middle = BOARD.corners().mean(axis=0)
    found = []
    while len(found) < count:
        rotation = Rotation.from_euler("xyz", [*rng.uniform(-0.7, 0.7, 2), rng.uniform(-3, 3)]).as_matrix()
        place = np.array([*rng.uniform(-0.35, 0.35, 2), rng.uniform(1.2, 2.2)])
        pixels = TRUE.project((BOARD.corners() - middle) @ rotation.T + place)
        if TRUE.contains(pixels, 5.0).all():
            found.append(pixels + rng.normal(0, noise, pixels.shape))
    return found


def numbers(camera):
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion[:4]])


def test_the_lens_comes_back_within_its_stated_deviations():
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(6):
        found = calibrate(sightings(rng, 15, 0.1), BOARD, 768, 494)
        assert found.pictures == 15
        assert found.residual == pytest.approx(0.1 * 2**0.5, rel=0.1)
        errors.append((numbers(found.camera) - numbers(TRUE)) / found.std[:8])
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    print(f"errors over stated deviations, RMS: {np.round(rms, 2)}")
    assert np.max(np.abs(errors)) < 4.5
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.5


def test_corners_are_found_where_they_were_drawn():
    rng, cell = np.random.default_rng(1), 60
    squares = np.indices((BOARD.rows + 1, BOARD.columns + 1)).sum(axis=0) % 2
    print_out = cv2.copyMakeBorder(
        np.kron(np.where(squares == 0, 30, 220), np.ones((cell, cell))).astype(np.uint8), *[cell] * 4,
        cv2.BORDER_CONSTANT, value=220,
    )  # fmt: skip
    # squares begin one cell in; texel centres lie at integers
    inner = BOARD.corners()[:, :2] / BOARD.square * cell + 2 * cell - 0.5
    for _ in range(4):
        rotation = Rotation.from_euler("xyz", [*rng.uniform(-0.4, 0.4, 2), rng.uniform(-0.4, 0.4)]).as_matrix()
        flat = np.column_stack([rotation[:, 0], rotation[:, 1], [0.0, 0.0, 1.6]])
        to_board = np.array([[0.1 / cell, 0, -0.55], [0, 0.1 / cell, -0.4], [0, 0, 1.0]])
        pinhole = CameraModel.centred(768, 494, 952.4)
        homography = pinhole.matrix @ flat @ to_board
        finer = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1.0]])
        large = cv2.warpPerspective(print_out, finer @ homography, (4 * 768, 4 * 494), borderValue=120)
        image = cv2.GaussianBlur(cv2.resize(large, (768, 494), interpolation=cv2.INTER_AREA), (0, 0), 0.6)
        found = find_board(image, BOARD)
        expected = cv2.perspectiveTransform(inner[None], homography)[0]
        off = np.linalg.norm(found - expected, axis=1)
        if off.max() > 100.0:  # the board looks the same from its other end
            off = np.linalg.norm(found[::-1] - expected, axis=1)
        assert np.sqrt(np.mean(off**2)) < 0.05


def test_no_board_and_too_few_pictures():
    assert find_board(np.full((494, 768), 128, np.uint8), BOARD) is None
    with pytest.raises(ValueError, match="at least 5"):
        calibrate(sightings(np.random.default_rng(2), 4, 0.1), BOARD, 768, 494)

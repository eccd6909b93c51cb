"""A horizon's line refitted to a fraction of a pixel, and the foot line of hills that stand on it.

Terrain rises above the horizon and never sinks below it, so the fit is one-sided: the scale of the noise is that of
the points below the line, and points above are judged by it.
"""

import math
from dataclasses import dataclass

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

from estimators.vision.edges import GUARD, KERNEL, STEP, edge_offsets
from estimators.vision.pose import project_with_slopes
from estimators.vision.robust import NOISE_FLOOR
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

POINTS = 400  # along the line
LEAST_POINTS = 20
LEAST_FOUND = 0.3  # share of the points
LEAST_HEIGHT = 0.3  # of the upper quartile of step heights: less is no edge of the horizon
SKYLINE_NOISE = 0.3  # [px] of a column's own end of the sky
TUKEY = 4.685
ROUNDS = 12
SHARP = 0.45  # [px] the scale of a straight edge, even drawn in steps of a pixel; hills and trees are rougher
CLOSE = 0.4  # of the reach: nearer to the end of the sky than to any other edge
WHOLE = 0.7  # share of the points of a straight skyline
FEET_REACH = 24.0  # [px] about a ragged line
FEET_TURN = math.radians(3.0)
FEET_STEP = 5.0  # [grey levels]
FEET_BIN = 0.5  # [px]
FEET_SHARE = 0.35  # of the line's points that must lie on one straight edge


@dataclass(frozen=True, eq=False)
class HorizonFit:
    """A refitted candidate."""

    up: Floats  # (3,) world up in camera axes
    basis: Floats  # (3, 2) directions in which it may be wrong
    covariance: Floats  # (2, 2) along them [rad^2]
    residual: float  # [px] RMS of the points used
    scale: float  # [px] of those below the line
    share: float  # of the line's points that were used


@dataclass(frozen=True, eq=False)
class _Course:
    """Points along a horizon, in the picture."""

    pixels: Floats  # (N, 2)
    normals: Floats  # (N, 2) down the picture, of unit length
    jacobian: Floats  # (N, 2) [px/rad] how far a point moves along its normal when up turns along `basis`
    basis: Floats  # (3, 2) ahead and aside

    def turned(self, up: Floats, turn: Floats) -> Floats:
        """Up (3,) turned by (2,) [rad] along the basis."""
        moved = up + self.basis @ turn
        return np.asarray(moved / np.linalg.norm(moved))


def refit(layer: Image, camera: CameraModel, up: Floats, reach: float) -> HorizonFit | None:
    """The straight edge nearest to the world's up (3,) in camera axes along which `layer` (H, W) is brighter above.

    reach [px]: how far it may be from there. A straight skyline is the horizon, however faint, as no terrain is
    straight; where the skyline is rough, the straight edge at its foot is taken. None where there is no straight edge
    along most of it, as at a horizon of trees.
    """
    fit = _fit(layer, camera, up, CLOSE * reach)
    if fit is not None and fit.scale < SHARP and fit.share > WHOLE:
        return fit
    fit = _fit(layer, camera, up, reach)
    if fit is not None and fit.scale < SHARP:
        return fit
    foot = _foot(layer, camera, up if fit is None else fit.up)
    if foot is None:
        return None
    fit = _fit(layer, camera, foot, 2.0)
    return fit if fit is not None and fit.scale < SHARP and fit.share > FEET_SHARE else None


def rough(pixels: Floats, camera: CameraModel, up: Floats) -> HorizonFit | None:
    """The line through points (N, 2) [px] of a rough skyline, near to the world's up (3,) in camera axes.

    The camera has no lens. None where they do not lie along a line.
    """
    if len(pixels) < LEAST_POINTS:
        return None
    rays = camera.rays(pixels)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
    ahead /= np.linalg.norm(ahead)
    basis = np.column_stack([ahead, np.cross(up, ahead)])
    # up + basis (a, b) is at right angles to a ray where the ray is that much below the first plane
    jacobian = camera.fx * rays @ basis
    turn, residuals, weights, scale = lower_line(jacobian, -camera.fx * rays @ up, SKYLINE_NOISE)
    up = up + basis @ turn
    return _judged(up / np.linalg.norm(up), basis, jacobian, residuals, weights, scale, camera)


def _course(camera: CameraModel, up: Floats) -> _Course | None:
    """Points of the horizon that lie in the picture; None where it does not cross it."""
    ahead = np.array([0.0, 0.0, 1.0]) - up[2] * up
    ahead /= np.linalg.norm(ahead)
    aside = np.cross(up, ahead)
    s = np.linspace(-1.0, 1.0, POINTS)
    rays = np.cos(s)[:, None] * ahead + np.sin(s)[:, None] * aside
    seen = rays[:, 2] > 0.2
    s, rays = s[seen], rays[seen]
    if len(s) < LEAST_POINTS:
        return None
    pixels, slopes = project_with_slopes(camera, rays)
    seen = camera.contains(pixels, GUARD)
    if seen.sum() < LEAST_POINTS:
        return None
    s, pixels, slopes = s[seen], pixels[seen], slopes[seen]
    c, sn = np.cos(s)[:, None], np.sin(s)[:, None]
    tangents = (slopes @ (c * aside - sn * ahead)[:, :, None])[:, :, 0]
    downward = -(slopes @ up)
    normals = np.column_stack([tangents[:, 1], -tangents[:, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    normals *= np.where(np.sum(normals * downward, axis=1) < 0.0, -1.0, 1.0)[:, None]
    # up + a ahead + b aside moves a point of the horizon by -(a cos s + b sin s) up
    push = np.sum(normals * downward, axis=1)[:, None]
    return _Course(pixels, normals, push * np.hstack([c, sn]), np.column_stack([ahead, aside]))


def _fit(layer: Image, camera: CameraModel, up: Floats, reach: float) -> HorizonFit | None:
    course = _course(camera, up)
    for _ in range(4):
        if course is None:
            return None
        offsets, heights = edge_offsets(layer, course.pixels, course.normals, reach, 1.0, KERNEL)
        good = np.isfinite(offsets)
        if good.sum() < LEAST_POINTS:
            return None
        good &= heights > LEAST_HEIGHT * np.percentile(heights[good], 75)
        if good.sum() < LEAST_FOUND * len(good):
            return None
        jacobian = course.jacobian[good]
        turn, residuals, weights, scale = lower_line(jacobian, offsets[good], NOISE_FLOOR)
        up, basis = course.turned(up, turn), course.basis
        if np.abs(jacobian @ turn).max() < 0.02:
            break
        course = _course(camera, up)
    return _judged(up, basis, jacobian, residuals, weights, scale, camera, len(good))


def _judged(
    up: Floats, basis: Floats, jacobian: Floats, residuals: Floats, weights: Floats, scale: float,
    camera: CameraModel, count: int | None = None,
) -> HorizonFit | None:  # fmt: skip
    """A fit with its covariance; None where too few of the points were used. `count`: of them and those not found."""
    used = weights > 0.1
    kept = residuals[used]
    residual = float(np.sqrt(np.mean(kept**2)))
    share = len(kept) / (count or len(residuals))
    if share < LEAST_FOUND:
        return None
    # neighbouring points of hills and waves are not independent: fewer measurements than points
    memory = float(np.clip(np.sum(kept[1:] * kept[:-1]) / max(np.sum(kept**2), 1e-12), 0.0, 0.98))
    noise = max(NOISE_FLOOR, residual) * math.sqrt((1.0 + memory) / (1.0 - memory))
    covariance = noise**2 * np.asarray(np.linalg.inv(jacobian[used].T @ jacobian[used]), float)
    # terrain moves and tilts a line by about its raggedness, and by more where much of the skyline is not on the line
    doubt = residual / share**2
    covariance += np.diag([doubt / camera.fy, doubt / (0.5 * camera.width)]) ** 2
    return HorizonFit(up, basis, np.asarray(covariance), residual, scale, share)


@numba.njit(cache=True)
def lower_line(jacobian, offsets, floor):
    """Unknowns (2,), residuals and weights (N,), and the scale [px] of what lies below the line.

    jacobian (N, 2); offsets (N,) [px], downward; floor [px] of that scale. Tukey's weights by the scale of the points
    below alone: where those above lie as near, it is plain least squares; where hills stand, the line sinks to
    their feet.
    """
    n = len(offsets)
    residuals = offsets - np.median(offsets)
    weights = np.ones(n)
    turn, scale = np.zeros(2), floor
    for _ in range(ROUNDS):
        below = residuals[residuals > 0.0]
        scale = max(floor, 1.4826 * np.median(below)) if len(below) > 0 else floor
        aa, ab, bb, ay, by = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(n):
            w = max(0.0, 1.0 - (residuals[i] / (TUKEY * scale)) ** 2) ** 2
            a, b, y = jacobian[i, 0], jacobian[i, 1], offsets[i]
            weights[i] = w
            aa, ab, bb = aa + w * a * a, ab + w * a * b, bb + w * b * b
            ay, by = ay + w * a * y, by + w * b * y
        determinant = aa * bb - ab * ab
        if determinant <= 1e-9 * aa * bb:
            break
        turn[0], turn[1] = (bb * ay - ab * by) / determinant, (aa * by - ab * ay) / determinant
        for i in range(n):
            residuals[i] = offsets[i] - jacobian[i, 0] * turn[0] - jacobian[i, 1] * turn[1]
    return turn, residuals, weights, scale


def _foot(layer: Image, camera: CameraModel, up: Floats) -> Floats | None:
    """Up (3,) by the straightest edge near a ragged line: most points of all edges within half a pixel of one line."""
    course = _course(camera, up)
    if course is None:
        return None
    across = np.arange(-FEET_REACH, FEET_REACH + STEP, STEP)
    x = (course.pixels[:, :1] + across * course.normals[:, :1]).astype(np.float32)
    y = (course.pixels[:, 1:] + across * course.normals[:, 1:]).astype(np.float32)
    strip = cv2.remap(layer, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)
    taps = np.concatenate([KERNEL[::-1], [0.0], -KERNEL])
    response = cv2.filter2D(strip, cv2.CV_32F, taps[None, :].astype(np.float32), borderType=cv2.BORDER_REPLICATE)
    middle = response[:, 1:-1]
    peak = (middle > response[:, :-2]) & (middle >= response[:, 2:]) & (middle > FEET_STEP)
    place, column = np.nonzero(peak)
    if len(place) < LEAST_POINTS:
        return None
    curvature = response[place, column] - 2.0 * middle[place, column] + response[place, column + 2]
    shift = 0.5 * (response[place, column] - response[place, column + 2]) / np.minimum(curvature, -1e-6)
    offsets = across[1:-1][column] + STEP * shift
    jacobian = course.jacobian[place]
    # lines a cos s + b sin s: for each b the commonest a
    width = FEET_BIN / np.abs(course.jacobian[:, 1]).max()
    best, found = 0, np.zeros(2)
    for b in np.arange(-FEET_TURN, FEET_TURN, width):
        a = (offsets - jacobian[:, 1] * b) / jacobian[:, 0]
        size = FEET_BIN / np.median(np.abs(jacobian[:, 0]))
        bins = np.floor(a / size).astype(int)
        low = int(bins.min())
        counts = np.bincount(bins - low)
        both = counts[:-1] + counts[1:] if len(counts) > 1 else counts
        k = int(np.argmax(both))
        if both[k] > best:
            best, found = int(both[k]), np.array([(low + k + 1) * size, b])
    return course.turned(up, found) if best > FEET_SHARE * len(course.pixels) else None

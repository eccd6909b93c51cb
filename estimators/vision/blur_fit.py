"""Fit of a blurred H's appearance to the grey levels of a picture: for marks too small or too blurred for edges.

Unknowns: centre and angle, two small turns of the pad's normal, the H's proportions, the camera's straight motion
during the exposure, the width of a round blur; each but the pose with a prior. The light's level, its slope across the
picture and the mark's contrast are linear and solved along. Levenberg-Marquardt with robust weights.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.blurred_h import appearance, parts
from estimators.vision.pose import LevelAxes, MarkPose, directions, place
from flightlog.camera import CameraModel
from flightlog.marks import HMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

MARGIN = 0.12  # of the mark's size around it that must be plain
FEWEST, LARGEST = 60, 120_000  # [px] of the picture
COARSEST = 1.5  # [grey levels] no picture is better than this: compression, rounding
MODELLED = 0.02  # of the range of greys: a pixel's square is no Gaussian, a print not quite plain
CORRELATED = 1.6  # growth of the noise because neighbouring pixels' errors go together
SWEEP_STD, BLUR_STD = 8.0, 0.6  # [px], of the logarithm: priors of motion and round blur
MOST_SWEPT, MOST_BLURRED = 0.9, 0.2  # of the leg
BLUR = 0.8  # [px] usual round blur


@dataclass(frozen=True, eq=False)
class Look:
    """What a picture of the mark is made by."""

    pose: MarkPose
    level: LevelAxes  # as given
    tilt: Floats  # (2,) [rad] turn of the level about the camera's x and y
    mark: HMark
    sweep: Floats  # (2,) [px] motion during the exposure
    blur: float  # [px]

    @property
    def axes(self) -> LevelAxes:
        """The level with its turn."""
        return self.level.turned(np.append(self.tilt, 0.0))


@dataclass(frozen=True, eq=False)
class Beliefs:
    """Standard deviations of what is known beforehand, about a usual value."""

    usual: HMark  # proportions; its leg is known
    proportions: Floats  # (2,) of the logarithms of width and stroke over leg
    tilt: float  # [rad]


@dataclass(frozen=True, eq=False)
class BlurFit:
    """What the fit found."""

    look: Look
    covariance: Floats  # (8, 8) x, y, z [m], angle, tilt x, tilt y [rad], log width/leg, log stroke/leg
    explained: float  # [0..1] share of the grey levels' variance in the mark and its gaps that the mark explains
    anatomy: Floats  # (7,) contrast of each part (`blurred_h.parts`) over the whole's; NaN outside the picture
    contrast: float  # [grey levels]
    residual: float  # [grey levels] robust
    visible: float  # share of the mark in the picture


@dataclass(frozen=True, eq=False)
class _Patch:
    rays: Floats  # (N, 2)
    grey: Floats  # (N,)
    frame: Floats  # (N, 3) 1 and the place in the patch, within +-1


def fit_blurred(
    image: Image, camera: CameraModel, start: Look, beliefs: Beliefs, *, polarity: int = 0, iterations: int = 20
) -> BlurFit | None:
    """The look of the mark in a picture (H, W), from `start`. None where it runs away."""
    look, damping, patch = start, 1e-2, None
    cost, scale = math.inf, COARSEST
    for iteration in range(iterations):
        if patch is None or iteration in (3, 7, 12):
            patch = _patch(image, camera, look)
            if patch is None:
                return None
            cost, scale = math.inf, _scale(patch, camera, look)
        residuals, jacobian = _linearised(patch, camera, look)
        if polarity and iteration > 4 and _solve(jacobian[:, 11:], patch.grey)[3] * polarity < 0.0:
            return None
        step, cost_now = _step_of(residuals, jacobian, look, beliefs, scale, damping)
        if not math.isfinite(cost):
            cost = cost_now
        trial = _moved(look, step)
        if trial is not None and _smeared(trial, camera):
            trial = None
        if trial is None:
            damping *= 10.0
            if damping > 1e4:
                return None
            continue
        trial_cost = _cost(_residuals(patch, camera, trial), trial, beliefs, scale)
        if trial_cost <= cost:
            gained = cost - trial_cost
            look, cost, damping = trial, trial_cost, max(damping / 5.0, 1e-6)
            scale_now = _scale(patch, camera, look)
            if gained < 1e-4 * cost and iteration > 12:
                break
            if abs(scale_now - scale) > 0.05 * scale:
                scale, cost = scale_now, math.inf
        else:
            damping *= 6.0
            if damping > 1e6:
                break
    return _result(image, camera, look, beliefs)


def _smeared(look: Look, camera: CameraModel) -> bool:
    """Whether so blurred that anything could be an H."""
    leg = look.mark.leg * min(camera.fx, camera.fy) / look.pose.position[2]  # [px]
    return float(np.hypot(*look.sweep)) > MOST_SWEPT * leg or look.blur > MOST_BLURRED * leg


def _patch(image: Image, camera: CameraModel, look: Look) -> _Patch | None:
    """The pixels in and around the mark."""
    mark, axes = look.mark, look.axes
    size = max(mark.leg, mark.width)
    per_pixel = look.pose.position[2] / min(camera.fx, camera.fy)
    margin = MARGIN * size + (2.0 * look.blur + 0.5 * float(np.hypot(*look.sweep)) + 1.5) * per_pixel
    a, b = mark.width / 2 + margin, mark.leg / 2 + margin
    corners = np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
    pixels = camera.project(place(corners, look.pose, axes))
    if not np.all(np.isfinite(pixels)) or np.abs(pixels).max() > 1e5:
        return None
    low = np.clip(np.floor(pixels.min(axis=0)), 0, None).astype(int)
    high = np.clip(np.ceil(pixels.max(axis=0)) + 1, None, [camera.width, camera.height]).astype(int)
    if np.any(high - low < 4) or (high - low).prod() > LARGEST:
        return None
    mask = np.zeros(high[::-1] - low[::-1], np.uint8)
    cv2.fillConvexPoly(mask, np.rint((pixels - low) * 16).astype(np.int32), 255, cv2.LINE_8, 4)
    rows, columns = np.nonzero(mask)
    if len(rows) < FEWEST:
        return None
    grey = image[low[1] : high[1], low[0] : high[0]][rows, columns].astype(float)
    places = np.column_stack([columns + low[0], rows + low[1]]).astype(float)
    half = 0.5 * (high - low)
    frame = np.column_stack([np.ones(len(rows)), (places - low) / half - 1.0])
    return _Patch(np.ascontiguousarray(camera.rays(places)[:, :2]), grey, frame)


def _homography(pose: MarkPose, level: LevelAxes) -> Floats:
    """From rays to mark axes [m]."""
    x_axis, y_axis = directions(pose, level)
    return np.linalg.inv(np.column_stack([x_axis, y_axis, pose.position]))


def _optics(camera: CameraModel, look: Look, to_mark: Floats) -> tuple[Floats, int, Floats, Floats]:
    """Sweep of the rays, points along it, sizes and blurs [m] for the kernels."""
    focal = np.array([camera.fx, camera.fy])
    centre = look.pose.position / look.pose.position[2]
    q = to_mark[2] @ centre
    sigmas = look.blur * np.linalg.norm(to_mark[:2, :2] / q / focal, axis=1)
    length = float(np.hypot(*look.sweep))
    samples = int(min(max(math.ceil(length / max(1.5 * look.blur, 0.5)) + 1, 1), 16)) if length > 0.2 else 1
    return look.sweep / focal, samples, np.array([look.mark.width, look.mark.leg, look.mark.stroke]), sigmas


def _turned_pose(look: Look, change: Floats) -> Floats:
    """Homography after a change (6,) of position, angle, tilt."""
    axes = look.level.turned(np.append(look.tilt + change[4:6], 0.0))
    return _homography(MarkPose(look.pose.position + change[:3], look.pose.angle + float(change[3])), axes)


def _linearised(patch: _Patch, camera: CameraModel, look: Look) -> tuple[Floats, Floats]:
    """Residuals (N,) after the linear part, and their jacobian (N, 15): by what `_moved` moves, and the linear part."""
    to_mark = _turned_pose(look, np.zeros(6))
    sweep, samples, sizes, sigmas = _optics(camera, look, to_mark)
    value, slope = appearance(patch.rays, to_mark, sweep, samples, sizes, sigmas)
    basis = np.column_stack([patch.frame, value])
    linear = _solve(basis, patch.grey)
    rays = np.column_stack([patch.rays, np.ones(len(patch.rays))])
    mapped = rays @ to_mark.T
    x, y, q = mapped[:, 0] / mapped[:, 2], mapped[:, 1] / mapped[:, 2], mapped[:, 2]
    jacobian = np.empty((len(value), 15))
    depth = look.pose.position[2]
    for j, size in enumerate((depth, depth, depth, 1.0, 1.0, 1.0)):
        change = np.zeros(6)
        change[j] = 1e-5 * size
        moved = rays @ ((_turned_pose(look, change) - to_mark) / change[j]).T
        jacobian[:, j] = (
            slope[:, 0] * (moved[:, 0] - x * moved[:, 2]) / q + slope[:, 1] * (moved[:, 1] - y * moved[:, 2]) / q
        )
    jacobian[:, 6] = slope[:, 4] * look.mark.width
    jacobian[:, 7] = slope[:, 5] * look.mark.stroke
    for j, focal in enumerate((camera.fx, camera.fy)):
        across = (to_mark[0, j] - x * to_mark[2, j]) / q / focal
        along = (to_mark[1, j] - y * to_mark[2, j]) / q / focal
        jacobian[:, 8 + j] = slope[:, 2] * across + slope[:, 3] * along
    jacobian[:, 10] = slope[:, 6]
    jacobian[:, :11] *= linear[3]
    jacobian[:, 11:] = basis
    return patch.grey - basis @ linear, jacobian


def _residuals(patch: _Patch, camera: CameraModel, look: Look) -> Floats:
    to_mark = _turned_pose(look, np.zeros(6))
    value, _ = appearance(patch.rays, to_mark, *_optics(camera, look, to_mark))
    basis = np.column_stack([patch.frame, value])
    return np.asarray(patch.grey - basis @ _solve(basis, patch.grey))


def _solve(basis: Floats, grey: Floats) -> Floats:
    """Linear part by least squares, once reweighted against what else lies in the patch."""
    gram = np.eye(basis.shape[1]) * 1e-9 * len(grey)
    linear = np.linalg.solve(basis.T @ basis + gram, basis.T @ grey)
    residuals = np.abs(grey - basis @ linear)
    weights = 1.0 / np.maximum(residuals, max(1.5 * float(np.median(residuals)), COARSEST))
    weighted = basis * weights[:, None]
    return np.asarray(np.linalg.solve(weighted.T @ basis + gram * weights.mean(), weighted.T @ grey))


def _scale(patch: _Patch, camera: CameraModel, look: Look) -> float:
    return max(_floor(patch), 1.4826 * float(np.median(np.abs(_residuals(patch, camera, look)))))


def _floor(patch: _Patch) -> float:
    """Least noise [grey levels]."""
    low, high = np.percentile(patch.grey, (5, 95))
    return max(COARSEST, MODELLED * float(high - low))


def _off_usual(look: Look, beliefs: Beliefs) -> tuple[Floats, Floats]:
    """The 11 unknowns less their usual values, and the precision of those."""
    usual = beliefs.usual
    off = np.concatenate(
        [
            np.zeros(4), look.tilt,
            [math.log(look.mark.width / usual.width), math.log(look.mark.stroke / usual.stroke)],
            look.sweep, [math.log(look.blur / BLUR)],
        ]
    )  # fmt: skip
    std = np.concatenate([np.full(4, 1e6), np.full(2, max(beliefs.tilt, 1e-6)), np.maximum(beliefs.proportions, 1e-6)])
    return off, 1.0 / np.concatenate([std, [SWEEP_STD, SWEEP_STD, BLUR_STD]]) ** 2


def _cost(residuals: Floats, look: Look, beliefs: Beliefs, scale: float) -> float:
    """Huber's, with the priors."""
    r = np.abs(residuals) / scale
    off, precision = _off_usual(look, beliefs)
    return float(np.where(r < 2.0, 0.5 * r * r, 2.0 * r - 2.0).sum() + 0.5 * (precision * off**2).sum())


def _step_of(
    residuals: Floats, jacobian: Floats, look: Look, beliefs: Beliefs, scale: float, damping: float
) -> tuple[Floats, float]:
    weights = np.minimum(1.0, 2.0 * scale / np.maximum(np.abs(residuals), 1e-9)) / scale**2
    weighted = jacobian * weights[:, None]
    normal, right = weighted.T @ jacobian, weighted.T @ residuals
    off, precision = _off_usual(look, beliefs)
    normal[np.arange(11), np.arange(11)] += precision
    right[:11] -= precision * off
    diagonal = np.diag(normal).copy()
    normal[np.arange(15), np.arange(15)] += damping * diagonal + 1e-12
    return np.asarray(np.linalg.solve(normal, right)[:11], float), _cost(residuals, look, beliefs, scale)


def _moved(look: Look, step: Floats) -> Look | None:
    """After a step (11,) of position, angle, tilt, logarithms of width and stroke, sweep, logarithm of the blur."""
    if not np.all(np.isfinite(step)):
        return None
    position = look.pose.position + step[:3]
    if position[2] <= 0.2 * look.pose.position[2] or abs(step[3]) > 0.6 or np.abs(look.tilt + step[4:6]).max() > 0.7:
        return None
    width, stroke = look.mark.width * math.exp(step[6]), look.mark.stroke * math.exp(step[7])
    if not 0.3 * look.mark.leg < width < 2.0 * look.mark.leg or not 0.05 * look.mark.leg < stroke < 0.45 * width:
        return None
    blur = look.blur * math.exp(float(np.clip(step[10], -1.0, 1.0)))
    return replace(
        look, pose=MarkPose(position, look.pose.angle + float(step[3])), tilt=look.tilt + step[4:6],
        mark=HMark(look.mark.leg, width, stroke), sweep=look.sweep + step[8:10], blur=float(np.clip(blur, 0.25, 8.0)),
    )  # fmt: skip


def _result(image: Image, camera: CameraModel, look: Look, beliefs: Beliefs) -> BlurFit | None:
    patch = _patch(image, camera, look)
    if patch is None:
        return None
    residuals, jacobian = _linearised(patch, camera, look)
    scale = max(_floor(patch), 1.4826 * float(np.median(np.abs(residuals))))
    contrast = float(_solve(jacobian[:, 11:], patch.grey)[3])
    weights = np.minimum(1.0, 2.0 * scale / np.maximum(np.abs(residuals), 1e-9)) / (CORRELATED * scale) ** 2
    normal = (jacobian * weights[:, None]).T @ jacobian
    normal[np.arange(11), np.arange(11)] += _off_usual(look, beliefs)[1]
    covariance = np.asarray(np.linalg.pinv(normal)[:8, :8], float)
    to_mark = _turned_pose(look, np.zeros(6))
    shares = parts(patch.rays, to_mark, *_optics(camera, look, to_mark))
    within = shares.sum(axis=1) > 0.15
    floor = COARSEST**2 * within.sum()
    plain = patch.grey[within] - patch.frame[within] @ _solve(patch.frame[within], patch.grey[within])
    explained = 1.0 - (float((residuals[within] ** 2).sum()) + floor) / (float((plain**2).sum()) + floor)
    gram = np.column_stack([patch.frame, shares])
    ridge = np.eye(gram.shape[1]) * 1e-6 * len(patch.grey)
    anatomy = np.linalg.solve(gram.T @ gram + ridge, gram.T @ patch.grey)[3:] / contrast
    seen, whole = shares.sum(axis=0), _whole_parts(camera, look, to_mark)
    return BlurFit(
        look, covariance, explained, np.where(seen > 0.25 * whole, anatomy, np.nan), contrast, scale,
        float(min(seen[:5].sum() / whole[:5].sum(), 1.0)),
    )  # fmt: skip


def _whole_parts(camera: CameraModel, look: Look, to_mark: Floats) -> Floats:
    """Area (7,) [px^2] that each part has in a picture that does not cut it."""
    mark = look.mark
    q = to_mark[2] @ (look.pose.position / look.pose.position[2])
    per_pixel = abs(np.linalg.det(to_mark)) / q**3 / (camera.fx * camera.fy)  # [m^2]
    half = 0.5 * mark.leg * mark.stroke
    between = mark.width - 2 * mark.stroke
    gap = between * 0.5 * (mark.leg - mark.stroke)
    return np.array([half, half, half, half, between * mark.stroke, gap, gap]) / per_pixel

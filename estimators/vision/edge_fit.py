"""Fit of a mark's outline to the edges of a picture: robust Gauss-Newton on sub-pixel offsets along model normals.

Unknowns: the mark's centre and angle; with them three nuisances, each with a prior: two small turns of the pad's
normal (the attitude is not perfect; `tilt_std`) and a common outward shift of all edges (`bleed_std`: gamma, glare and
texture filtering make a bright mark look larger all around, which would otherwise be read as a nearer mark).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.vision.edges import GUARD, KERNEL, edge_offsets
from estimators.vision.pose import LevelAxes, MarkPose, directions, project_with_slopes
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]

SPACING = 1.5  # [px] least distance of edge points
MOST_PER_EDGE = 40
SHARED = 1.06  # growth of the noise because neighbouring profiles share pixels (measured: NEES of 400 pictures)
CORNER_MARGIN = 3.0  # [px] blur rounds corners, which pulls edges near them inwards
NOISE_FLOOR = 0.05  # [px] no edge is better known than this
NARROW = 3.0  # [px] search once the pose is close
HOPELESS = 1.8  # [px] spread of the edges after two steps; chance edges within the narrow search give 2.2
VAGUE = np.array([10.0, 10.0, 10.0, 3.0])  # [m, rad] standard deviation of what the picture leaves open


@dataclass(frozen=True, eq=False)
class OutlineSamples:
    """Points along a mark's outline, mark axes [m]."""

    points: Floats  # (N, 2)
    tangents: Floats  # (N, 2) unit
    normals: Floats  # (N, 2) unit, outward
    edge: NDArray[np.intp]  # (N,) number of the edge
    to_corner: Floats  # (N,) distance to the nearer end of the edge
    along: NDArray[np.intp]  # (N,) place along its edge, counted

    @classmethod
    def of(cls, outline: Floats, per_edge: int = 64) -> "OutlineSamples":
        """Samples of a closed outline (M, 2), counter-clockwise."""
        ends = np.roll(outline, -1, axis=0)
        sides = ends - outline
        lengths = np.linalg.norm(sides, axis=1)
        units = sides / lengths[:, None]
        t = (np.arange(per_edge) + 0.5) / per_edge
        points = outline[:, None, :] + t[None, :, None] * sides[:, None, :]
        tangents = np.repeat(units, per_edge, axis=0)
        return cls(
            points.reshape(-1, 2),
            tangents,
            np.column_stack([tangents[:, 1], -tangents[:, 0]]),
            np.repeat(np.arange(len(outline)), per_edge),
            (np.minimum(t, 1.0 - t)[None, :] * lengths[:, None]).ravel(),
            np.tile(np.arange(per_edge), len(outline)),
        )

    def take(self, keep: NDArray[np.bool_]) -> "OutlineSamples":
        """The samples (N,) kept."""
        return OutlineSamples(
            self.points[keep], self.tangents[keep], self.normals[keep],
            self.edge[keep], self.to_corner[keep], self.along[keep],
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class EdgeFit:
    """What the fit found."""

    pose: MarkPose
    level: LevelAxes  # corrected by the fitted tilt
    covariance: Floats  # (4, 4) x, y, z [m], angle [rad]; without the start's prior
    residual: float  # [px] RMS of the edge points used
    used: int  # edge points that agree
    expected: int  # edge points of the model in the picture
    contrast: float  # [grey levels] mark minus surroundings
    bleed: float  # [px] common outward shift


@dataclass(frozen=True, eq=False)
class _View:
    """The samples as the pose would show them."""

    pixels: Floats  # (N, 2)
    normals: Floats  # (N, 2) unit, outward in the picture
    jacobian: Floats  # (N, 7) of the offset along the normal by x, y, z, angle, tilt x, tilt y, bleed
    pitch: Floats  # (N,) [px/m] along the edge


def _view(samples: OutlineSamples, camera: CameraModel, pose: MarkPose, level: LevelAxes) -> _View:
    x_axis, y_axis = directions(pose, level)
    basis = np.stack([x_axis, y_axis])
    arms = samples.points @ basis
    points = pose.position + arms
    ahead = points[:, 2] > 1e-3
    points = np.where(ahead[:, None], points, [0.0, 0.0, 1.0])
    pixels, slopes = project_with_slopes(camera, points)
    pixels[~ahead] = np.nan
    tangent = (slopes @ (samples.tangents @ basis)[:, :, None])[:, :, 0]
    outward = (slopes @ (samples.normals @ basis)[:, :, None])[:, :, 0]
    pitch = np.linalg.norm(tangent, axis=1)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]]) / np.maximum(pitch, 1e-12)[:, None]
    normal *= np.where(np.sum(normal * outward, axis=1) < 0.0, -1.0, 1.0)[:, None]
    by_point = (normal[:, None, :] @ slopes)[:, 0, :]
    # growing angle turns the mark's y towards level right, its x away from level forward
    by_angle = samples.points[:, :1] * -y_axis + samples.points[:, 1:] * x_axis
    jacobian = np.empty((len(arms), 7))
    jacobian[:, :3] = by_point
    jacobian[:, 3] = np.sum(by_point * by_angle, axis=1)
    # e x arm for the camera's x and y axes
    jacobian[:, 4] = by_point[:, 2] * arms[:, 1] - by_point[:, 1] * arms[:, 2]
    jacobian[:, 5] = by_point[:, 0] * arms[:, 2] - by_point[:, 2] * arms[:, 0]
    jacobian[:, 6] = 1.0
    return _View(pixels, normal, jacobian, pitch)


def _choose(samples: OutlineSamples, camera: CameraModel, pose: MarkPose, level: LevelAxes) -> OutlineSamples:
    """The samples that can be measured: in the picture, off the corners, far enough apart for independent noise."""
    view = _view(samples, camera, pose, level)
    seen = camera.contains(view.pixels, GUARD) & (samples.to_corner * view.pitch >= CORNER_MARGIN)
    if not seen.any():
        return samples.take(seen)
    edges = int(samples.edge.max()) + 1
    number = np.bincount(samples.edge[seen], minlength=edges)
    # pixels from one sample to the next, mean along each edge
    spacing = np.bincount(samples.edge[seen], weights=view.pitch[seen], minlength=edges) / np.maximum(number, 1)
    per_edge = len(samples.edge) / edges
    lengths = np.bincount(samples.edge, weights=samples.to_corner, minlength=edges) * 4.0 / per_edge
    spacing *= lengths / per_edge
    stride = np.ceil(np.maximum(SPACING / np.maximum(spacing, 1e-9), number / MOST_PER_EDGE)).astype(int)
    stride = np.clip(stride, 1, None)[samples.edge]
    return samples.take(seen & (samples.along % stride == stride // 2))


def _weights(residuals: Floats, scale: float, redescending: bool) -> Floats:
    ratio = np.abs(residuals) / scale
    if redescending:  # Tukey
        return np.asarray(np.where(ratio < 4.685, (1.0 - (ratio / 4.685) ** 2) ** 2, 0.0))
    return np.asarray(1.345 / np.maximum(ratio, 1.345))  # Huber


def _spread(residuals: Floats) -> float:
    middle = len(residuals) // 2
    return max(NOISE_FLOOR, 1.4826 * float(np.partition(np.abs(residuals), middle)[middle]))


def _solve(jacobian: Floats, offsets: Floats, precision: Floats, to_prior: Floats) -> tuple[Floats, Floats, float]:
    """Robust step (7,), the residuals it leaves (N,) and their scale [px]."""
    residuals: Floats = offsets - float(np.median(offsets))
    step = np.zeros(len(precision))
    scale = 1.0
    for rounds in range(5):
        scale = _spread(residuals)
        weights = _weights(residuals, scale, rounds > 1) / scale**2
        normal = (jacobian * weights[:, None]).T @ jacobian + np.diag(precision)
        step = np.linalg.solve(normal, (jacobian * weights[:, None]).T @ offsets + precision * to_prior)
        residuals = np.asarray(offsets - jacobian @ step)
    return step, residuals, scale


def fit_outline(
    image: NDArray[np.uint8],
    camera: CameraModel,
    samples: OutlineSamples,
    level: LevelAxes,
    start: MarkPose,
    *,
    prior_std: Floats,
    reach: float,
    polarity: int = 0,
    tilt_std: float = 0.0,
    bleed_std: float = 0.2,
    iterations: int = 8,
    least_points: int = 16,
) -> EdgeFit | None:
    """Pose of the mark in a picture (H, W), from `start`. None where too few edges are found.

    prior_std (4,) of x, y, z [m] and angle [rad] holds the solution near `start` where the visible edges leave a
    direction open, and is weak elsewhere: it pulls the answer by about (std of the answer / prior_std)^2 of the way
    to `start`, and is left out of the covariance, where what the picture leaves open has `VAGUE` instead.
    reach [px]: search along the normals at first; polarity: +1 light mark, -1 dark mark, 0 whichever is seen.
    """
    prior = np.concatenate([prior_std, np.full(2, max(tilt_std, 1e-9)), [bleed_std]])
    precision = 1.0 / prior**2
    total = np.zeros(7)  # what the steps add up to
    pose, axes = start, level
    chosen = _choose(samples, camera, pose, axes)
    moved, search = 0.0, reach
    for iteration in range(iterations):
        if moved > 2.0:
            chosen = _choose(samples, camera, pose, axes)
        if len(chosen.points) < least_points:
            return None
        view = _view(chosen, camera, pose, axes)
        at = view.pixels + total[6] * view.normals
        offsets, heights = edge_offsets(image, at, view.normals, search, float(polarity or 1), KERNEL)
        if polarity == 0:
            others = edge_offsets(image, at, view.normals, search, -1.0, KERNEL)
            polarity = 1 if heights.sum() >= others[1].sum() else -1
            if polarity < 0:
                offsets, heights = others
        good = np.isfinite(offsets)
        if good.sum() < least_points:
            return None
        good &= heights > 0.3 * np.percentile(heights[good], 75)
        if good.sum() < least_points:
            return None
        jacobian = view.jacobian[good]
        step, residuals, scale = _solve(jacobian, offsets[good], precision, -total)
        if iteration > 1 and scale > HOPELESS:
            return None
        change = jacobian @ step
        if not np.all(np.isfinite(step)):
            return None
        # a step beyond the search is no measurement: keep the fit from running away
        moved = float(np.abs(change).max())
        step *= min(1.0, 2.0 * search / max(moved, 1e-9))
        total += step
        pose = MarkPose(start.position + total[:3], start.angle + float(total[3]))
        if pose.position[2] <= 0.0:
            return None
        axes = level.turned(np.array([total[4], total[5], 0.0]))
        if moved < 0.02:
            break
        search = float(np.clip(3.0 * scale + moved, NARROW, reach))
    inliers = np.abs(residuals) <= max(3.0 * scale, 0.3)
    used = int(inliers.sum())
    if used < least_points:
        return None
    residual = float(np.sqrt(np.mean(residuals[inliers] ** 2)))
    freedom = used / max(used - 5, 1)
    noise = SHARED * max(NOISE_FLOOR, residual * np.sqrt(freedom))
    kept = jacobian[inliers]
    information = kept.T @ kept / noise**2 + np.diag(np.concatenate([1.0 / VAGUE**2, precision[4:]]))
    covariance = np.linalg.inv(information)[:4, :4]
    # a wrong tilt of a tilted camera also turns its heading
    covariance[3, 3] += tilt_std**2 * (1.0 - level.up[2] ** 2)
    return EdgeFit(
        pose, axes, covariance, residual, used, len(chosen.points),
        polarity * float(np.median(heights[good][inliers])), float(total[6]),
    )  # fmt: skip

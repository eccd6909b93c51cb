"""Fit of a mark's outline to the edges of a picture: robust Gauss-Newton on sub-pixel offsets along model normals.

Unknowns: the mark's centre and angle; with them three nuisances, each with a prior: two small turns of the pad's
normal (the attitude is not perfect; `tilt_std`) and a common outward shift of all edges (`bleed_std`: gamma, glare and
texture filtering make a bright mark look larger all around, which would otherwise be read as a nearer mark).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.vision.edges import KERNEL, edge_offsets, sharpness
from estimators.vision.outline import OutlineSamples, View, choose, view
from estimators.vision.pose import LevelAxes, MarkPose
from estimators.vision.robust import NOISE_FLOOR, solve
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]

SHARED = 1.06  # growth of the noise because neighbouring profiles share pixels (measured: NEES of 400 pictures)
NARROW = 3.0  # [px] search once the pose is close
FAINT = 0.2  # of the usual step height: shadow and motion blur weaken an edge, less is chance
HOPELESS = 1.8  # [px] spread of the edges after two steps; chance edges within the narrow search give 2.2
VAGUE = np.array([10.0, 10.0, 10.0, 3.0])  # [m, rad] standard deviation of what the picture leaves open
FEWEST_FACING = 6  # edge points whose mean profile shows the blur
USUAL_DISAGREEMENT = 1.4  # of whole edges over what their points' scatter explains: 95 % of sharp pictures have less


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
    places: Floats  # (N, 2) [m] mark axes of the expected edge points
    agree: NDArray[np.bool_]  # (N,) which of them are used
    tilt: Floats  # (2,) [rad] by which the level turns about the camera's x and y, from the picture alone: no prior
    tilt_covariance: Floats  # (2, 2) [rad^2] of it
    sharpness: float  # [0..1] of the edges that face the way most blurred (`edges.sharpness`)
    facing: float  # share of the expected edge points that agree, among those that face the way with the least


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
    chosen = choose(samples, camera, pose, axes)
    moved, search = 0.0, reach
    for iteration in range(iterations):
        if moved > 2.0:
            chosen = choose(samples, camera, pose, axes)
        if len(chosen.points) < least_points:
            return None
        shown = view(chosen, camera, pose, axes)
        at = shown.pixels + total[6] * shown.normals
        offsets, heights = edge_offsets(image, at, shown.normals, search, float(polarity or 1), KERNEL)
        if polarity == 0:
            others = edge_offsets(image, at, shown.normals, search, -1.0, KERNEL)
            polarity = 1 if heights.sum() >= others[1].sum() else -1
            if polarity < 0:
                offsets, heights = others
        good = np.isfinite(offsets)
        if good.sum() < least_points:
            return None
        good &= heights > FAINT * np.percentile(heights[good], 75)
        if good.sum() < least_points:
            return None
        jacobian = shown.jacobian[good]
        step, residuals, scale = solve(jacobian, offsets[good], precision, -total)
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
    agree = np.zeros(len(good), bool)
    agree[np.flatnonzero(good)[inliers]] = True
    residual = float(np.sqrt(np.mean(residuals[inliers] ** 2)))
    freedom = used / max(used - 5, 1)
    together = _disagreement(residuals[inliers], chosen.edge[good][inliers]) / USUAL_DISAGREEMENT
    noise = SHARED * max(NOISE_FLOOR, residual * np.sqrt(freedom), together)
    kept = jacobian[inliers]
    information = kept.T @ kept / noise**2 + np.diag(np.concatenate([1.0 / VAGUE**2, precision[4:]]))
    inverse = np.linalg.inv(information)
    covariance = inverse[:4, :4]
    tilt, tilt_covariance = _without_prior(total[4:6], inverse[4:6, 4:6], prior[4:6])
    # a wrong tilt of a tilted camera also turns its heading
    covariance[3, 3] += tilt_std**2 * (1.0 - level.up[2] ** 2)
    return EdgeFit(
        pose, axes, covariance, residual, used, len(chosen.points),
        polarity * float(np.median(heights[good][inliers])), float(total[6]), chosen.points, agree,
        tilt, tilt_covariance, *_each_way(image, chosen, view(chosen, camera, pose, axes), total[6], agree, polarity),
    )  # fmt: skip


def _disagreement(residuals: Floats, edge: NDArray[np.intp]) -> float:
    """Noise [px] of one point that would explain how whole edges miss the fit: their points' errors may go together.

    residuals (N,) [px] and the edge (N,) of each. 0 where too few edges are seen to tell.
    """
    number = np.bincount(edge)
    sums = np.bincount(edge, weights=residuals)[number > 0]
    number = number[number > 0]
    return float(np.sqrt(np.sum(sums**2 / number) / (len(number) - 5))) if len(number) > 6 else 0.0


def _each_way(
    image: NDArray[np.uint8],
    samples: OutlineSamples,
    shown: View,
    bleed: float,
    agree: NDArray[np.bool_],
    polarity: int,
) -> tuple[float, float]:
    """Least sharpness, and least share of the edge points that agree, of the edges that face one of four ways.

    Motion blurs the edges across it and leaves those along it sharp.
    """
    quarter = np.rint(np.arctan2(samples.normals[:, 1], samples.normals[:, 0]) / (np.pi / 2)).astype(int) % 4
    least, share = 1.0, 1.0
    for way in range(4):
        facing = quarter == way
        if facing.sum() < FEWEST_FACING:
            continue
        seen = facing & agree
        share = min(share, float(seen.sum() / facing.sum()))
        if seen.sum() >= FEWEST_FACING:
            at = shown.pixels[seen] + bleed * shown.normals[seen]
            least = min(least, sharpness(image, at, shown.normals[seen], polarity))
    return least, share


def _without_prior(mean: Floats, covariance: Floats, prior_std: Floats) -> tuple[Floats, Floats]:
    """What was measured of some unknowns, from their posterior and a prior about 0: information subtracted."""
    information = np.linalg.inv(covariance)
    left = np.linalg.inv(information - np.diag((1.0 - 1e-6) / prior_std**2))
    return left @ information @ mean, left

"""A mark's outline as points with normals, and how a pose shows them in a picture."""

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from estimators.vision.edges import GUARD
from estimators.vision.pose import LevelAxes, MarkPose, directions, project_with_slopes
from flightlog.camera import CameraModel

Floats = NDArray[np.float64]

SPACING = 1.5  # [px] least distance of edge points
MOST_PER_EDGE = 40
CORNER_MARGIN = 3.0  # [px] blur rounds corners, which pulls edges near them inwards


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
class View:
    """Outline samples as a pose shows them."""

    pixels: Floats  # (N, 2); NaN behind the camera
    normals: Floats  # (N, 2) unit, outward in the picture
    jacobian: Floats  # (N, 7) of the offset along the normal by x, y, z, angle, tilt x, tilt y, bleed
    pitch: Floats  # (N,) [px/m] along the edge


def view(samples: OutlineSamples, camera: CameraModel, pose: MarkPose, level: LevelAxes) -> View:
    """How `pose` shows the samples, with the derivatives that the fit needs."""
    x_axis, y_axis = directions(pose, level)
    basis = np.stack([x_axis, y_axis])
    arms = samples.points @ basis
    points = pose.position + arms
    ahead = points[:, 2] > 1e-3
    points[~ahead] = (0.0, 0.0, 1.0)
    pixels, slopes = project_with_slopes(camera, points)
    pixels[~ahead] = np.nan
    normals, jacobian, pitch = _derivatives(
        samples.points, samples.tangents @ basis, samples.normals @ basis, arms, slopes, x_axis, y_axis
    )
    return View(pixels, normals, jacobian, pitch)


@numba.njit(cache=True)
def _derivatives(points, tangents, outwards, arms, slopes, x_axis, y_axis):
    """Normals (N, 2) in the picture, jacobian (N, 7) and pitch (N,) of `View`.

    points (N, 2) mark axes; tangents, outwards, arms (N, 3) camera axes; slopes (N, 2, 3) of the projection.
    """
    n = len(points)
    normals, jacobian, pitch = np.empty((n, 2)), np.empty((n, 7)), np.empty(n)
    for i in range(n):
        s = slopes[i]
        tu = s[0, 0] * tangents[i, 0] + s[0, 1] * tangents[i, 1] + s[0, 2] * tangents[i, 2]
        tv = s[1, 0] * tangents[i, 0] + s[1, 1] * tangents[i, 1] + s[1, 2] * tangents[i, 2]
        ou = s[0, 0] * outwards[i, 0] + s[0, 1] * outwards[i, 1] + s[0, 2] * outwards[i, 2]
        ov = s[1, 0] * outwards[i, 0] + s[1, 1] * outwards[i, 1] + s[1, 2] * outwards[i, 2]
        length = math.hypot(tu, tv)
        pitch[i] = length
        nu, nv = tv / max(length, 1e-12), -tu / max(length, 1e-12)
        if nu * ou + nv * ov < 0.0:
            nu, nv = -nu, -nv
        normals[i, 0], normals[i, 1] = nu, nv
        gx, gy, gz = nu * s[0, 0] + nv * s[1, 0], nu * s[0, 1] + nv * s[1, 1], nu * s[0, 2] + nv * s[1, 2]
        jacobian[i, 0], jacobian[i, 1], jacobian[i, 2] = gx, gy, gz
        # growing angle turns the mark's y towards level right, its x away from level forward
        x, y = points[i, 0], points[i, 1]
        jacobian[i, 3] = (
            gx * (y * x_axis[0] - x * y_axis[0])
            + gy * (y * x_axis[1] - x * y_axis[1])
            + gz * (y * x_axis[2] - x * y_axis[2])
        )
        # e x arm for the camera's x and y axes
        jacobian[i, 4] = gz * arms[i, 1] - gy * arms[i, 2]
        jacobian[i, 5] = gx * arms[i, 2] - gz * arms[i, 0]
        jacobian[i, 6] = 1.0
    return normals, jacobian, pitch


def choose(samples: OutlineSamples, camera: CameraModel, pose: MarkPose, level: LevelAxes) -> OutlineSamples:
    """The samples that can be measured: in the picture, off the corners, far enough apart for independent noise."""
    shown = view(samples, camera, pose, level)
    seen = camera.contains(shown.pixels, GUARD) & (samples.to_corner * shown.pitch >= CORNER_MARGIN)
    if not seen.any():
        return samples.take(seen)
    edges = int(samples.edge.max()) + 1
    number = np.bincount(samples.edge[seen], minlength=edges)
    # pixels from one sample to the next, mean along each edge
    spacing = np.bincount(samples.edge[seen], weights=shown.pitch[seen], minlength=edges) / np.maximum(number, 1)
    per_edge = len(samples.edge) / edges
    lengths = np.bincount(samples.edge, weights=samples.to_corner, minlength=edges) * 4.0 / per_edge
    spacing *= lengths / per_edge
    stride = np.ceil(np.maximum(SPACING / np.maximum(spacing, 1e-9), number / MOST_PER_EDGE)).astype(int)
    stride = np.clip(stride, 1, None)[samples.edge]
    return samples.take(seen & (samples.along % stride == stride // 2))

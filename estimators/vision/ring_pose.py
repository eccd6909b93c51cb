"""Six degrees of freedom of the ring landmark by ellipse and orthogonal iteration, no attitude needed.

What the refuelling paper on Wu 2019's last page does with a drogue: an ellipse through the ring's contour says where it
is, the pose comes from points by orthogonal iteration (Lu, Hager and Mjolsness 2000). Here the ellipse's edge is taken
to a fraction of a pixel, and as soon as there is a pose, each of its points has its counterpart on the ring: the one
in the same direction from the centre.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision import lhm
from estimators.vision.edges import KERNEL, edge_offsets
from estimators.vision.ellipse import fit_ellipse
from estimators.vision.lhm import PointPose
from estimators.vision.pose import LevelAxes, MarkPose, level_axes, on_pad_plane, place
from estimators.vision.roi import region
from estimators.vision.sighting import PadPrediction, PadSighting
from estimators.vision.wu_features import RingFeatures, find_features
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import RingMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
RING_POINTS = 72
REACH = 3.0  # [px] from the contour to its edge
WINDOW = 3  # [px] half side of the corner refinement's window
PASSES = 2  # of pairing ring points anew
ROUGH, FINE = 1e-5, 1e-6  # [rad] to which the corners alone, and all points, are iterated
MOST_CONTOUR = 400  # points of it that the ellipse is fitted to
RAGGED = 1.5  # [px] RMS beyond which the points are not the mark's
TWO_ALIKE = 4.0  # ratio of the two minima's errors below which the attitude decides
LEAST_STD = 0.1  # [px] of an edge point or corner


class RingPoseFrontEnd:
    """Looks for one ring landmark with six or more of its Ts' corners. Keeps nothing from one picture to the next."""

    def __init__(self, camera: CameraModel, mount: CameraMount, mark: RingMark, *, roi: bool = True) -> None:
        """roi: look only where the prediction has the mark, and everywhere if it is not there."""
        self.camera, self.mount, self.mark, self.roi = camera, mount, mark, roi
        self._corners = np.column_stack([mark.t_corners(), np.zeros(16)])
        self._reach = float(np.hypot(*mark.t_corners().T).max())
        self._upright = level_axes(UPRIGHT, mount)

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB which is made grey; None where its pose is not found.

        attitude (4,) wxyz: the zero of the answer's angle, and which of two minima is right where they fit alike.
        """
        grey = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8) if image.ndim == 3 else image
        level = level_axes(attitude, self.mount)
        box = region(self.camera, prediction, self._reach) if self.roi and prediction is not None else None
        if box is not None:
            x0, y0, x1, y1 = box
            seen = self._look(np.ascontiguousarray(grey[y0:y1, x0:x1]), (x0, y0), level, "tracked")
            if seen is not None:
                return seen
        return self._look(grey, (0, 0), level, "acquired")

    def _look(self, grey: Image, corner: tuple[int, int], level: LevelAxes, source: str) -> PadSighting | None:
        # the circle test allows for what tilt does to a circle: the attitude is not used to find anything
        features = find_features(
            grey, corner, lambda pixels: on_pad_plane(pixels, self.camera, self._upright), self.mark
        )
        if features is None:
            return None
        corners = self._refined(grey, corner, features)
        edge = self._edge(grey, corner, features)
        found = np.isfinite(corners[:, 0])
        if edge is None or found.sum() < 4:
            return None
        points = _Points(self._corners[found], corners[found], edge, features.radius)
        pose = self._pose(points, level)
        return None if pose is None else self._sighting(pose, points, level, source)

    def _refined(self, grey: Image, corner: tuple[int, int], features: RingFeatures) -> Floats:
        """The Ts' corners (16, 2) [px] to a fraction of a pixel; NaN where not found."""
        corners = features.corners.copy()
        found = np.isfinite(corners[:, 0])
        if found.any():
            start = (corners[found] - corner).astype(np.float32).reshape(-1, 1, 2)
            criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 30, 0.01)
            fine = cv2.cornerSubPix(grey, start, (WINDOW, WINDOW), (-1, -1), criteria).reshape(-1, 2) + corner
            corners[found] = np.where(np.linalg.norm(fine - corners[found], axis=1)[:, None] < WINDOW, fine, np.nan)
        return corners

    def _edge(self, grey: Image, corner: tuple[int, int], features: RingFeatures) -> Floats | None:
        """Points (N, 2) [px] on the outermost ring's edge, along the normals of the ellipse through its contour."""
        thinned = features.contour[:: max(1, len(features.contour) // MOST_CONTOUR)]
        ellipse = fit_ellipse(thinned - corner)
        if ellipse is None:
            return None
        points = ellipse.points(RING_POINTS)
        normals = np.column_stack([points, np.ones(len(points))]) @ ellipse.conic[:, :2]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        offsets, _ = edge_offsets(grey, points, normals, REACH, 1.0, KERNEL)
        seen = np.isfinite(offsets)
        if seen.sum() < RING_POINTS // 2:
            return None
        return np.asarray((points + offsets[:, None] * normals)[seen] + corner)

    def _pose(self, seen: "_Points", level: LevelAxes) -> PointPose | None:
        """The pose that fits the points; of two that fit alike the one that the attitude says."""
        corner_rays, edge_rays = self.camera.rays(seen.corners), self.camera.rays(seen.edge)
        found = lhm.solve(seen.model, corner_rays, settled=ROUGH)
        if not found:
            return None
        pose = found[0]
        if len(found) == 2 and found[1].error < TWO_ALIKE * found[0].error:
            pose = max(found, key=lambda item: float(item.rotation[:, 2] @ level.up))
        rays = np.vstack([corner_rays, edge_rays])
        for _ in range(PASSES):
            sums = lhm.gather(np.vstack([seen.model, _on_ring(edge_rays, seen.radius, pose)]), rays)
            rotation, rounds = lhm.descend(sums, pose.rotation, FINE)
            pose = PointPose(rotation, lhm.translation(sums, rotation), float(lhm.error(sums, rotation)), rounds)
        return pose if pose.translation[2] > 0.0 else None

    def _sighting(self, pose: PointPose, seen: "_Points", level: LevelAxes, source: str) -> PadSighting | None:
        position, normal = pose.translation, pose.rotation[:, 2]
        model = np.vstack([seen.model, _on_ring(self.camera.rays(seen.edge), seen.radius, pose)])
        shown = self.camera.project(model @ pose.rotation.T + position)
        missed = shown - np.vstack([seen.corners, seen.edge])
        count = len(seen.corners)
        of_corners = math.sqrt(float(np.sum(missed[:count] ** 2)) / (2 * count))
        of_edge = math.sqrt(float(np.mean(np.sum(missed[count:] ** 2, axis=1))))
        residual = math.sqrt(float(np.mean(np.sum(missed**2, axis=1))))
        if residual > RAGGED:
            return None
        # a ring's edge is known across itself only, so it counts for half
        std = np.repeat([max(LEAST_STD, of_corners), math.sqrt(2.0) * max(LEAST_STD, of_edge)], [count, len(seen.edge)])
        six = lhm.covariance(model, pose, std / math.sqrt(self.camera.fx * self.camera.fy))
        axis = pose.rotation[:, 1]
        angle = math.atan2(axis @ level.right, axis @ level.forward)
        keep = np.array([0, 1, 2, 3])
        turn = np.eye(6)[keep]
        turn[3] = np.append(np.zeros(3), -normal)  # the angle is clockwise
        covariance = turn @ six @ turn.T
        deviations = np.sqrt(np.diag(covariance))
        outline = self.camera.project(place(self.mark.outline(), MarkPose(position, angle), level))
        return PadSighting(
            position=position,
            angle=angle,
            std_position=deviations[:3],
            std_angle=float(deviations[3]),
            covariance=covariance,
            quality=min(1.0, len(model) / (16 + RING_POINTS)),
            visible=float(np.mean(self.camera.contains(outline))),
            outline=outline,
            source="tracked" if source == "tracked" else "acquired",
            up=normal,
            residual=residual,
            contrast=math.nan,
        )


@dataclass(frozen=True, eq=False)
class _Points:
    """What the pose is found from."""

    model: Floats  # (N, 3) [m] corners of the Ts
    corners: Floats  # (N, 2) [px] where they are seen
    edge: Floats  # (M, 2) [px] points on a ring's outer edge
    radius: float  # [m] of that


def _on_ring(rays: Floats, radius: float, pose: PointPose) -> Floats:
    """Where on a ring of `radius` [m] the points (N, 3) seen along rays (N, 3) should be."""
    normal = pose.rotation[:, 2]
    hit = rays * (pose.translation @ normal / (rays @ normal))[:, None]
    flat = (hit - pose.translation) @ pose.rotation[:, :2]
    flat *= radius / np.linalg.norm(flat, axis=1)[:, None]
    return np.column_stack([flat, np.zeros(len(flat))])

"""The ring pad's front end: finds Wu 2019's landmark without knowledge, follows it, and goes on when it is cut.

Finding: circles about one centre on the level plane, the angle from the bars around them. Then, and when following: a
fit of the mark's projected edges to the picture's sub-pixel edges, all unknowns at once. Rings are fitted as what they
are seen as, so an imaged ellipse's centre is never taken for the ring's. Which edges take part depends on their size in
the picture: from above the rings, the Ts and the guide line; near the ground the landing grid's holes and the innermost
ring.
"""

import math
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.edge_fit import EdgeFit, fit_outline
from estimators.vision.h_mark import reduced
from estimators.vision.pose import LevelAxes, MarkPose, level_axes, place
from estimators.vision.ring_samples import WIDE, ring_samples
from estimators.vision.ring_search import RingSearch
from estimators.vision.robust import NOISE_FLOOR
from estimators.vision.sighting import PadPrediction, PadSighting, SeenLevel
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import RingMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

APART = 5.0  # [px] edges nearer to one another run into one another
NARROW = 4.0  # [px] search once the pose is close
REACH_SHARE = 0.8  # of the way to the next edge of the same contrast that may be searched
SHARPEST_REACH = 12.0  # [px] search on one level of the pyramid
BLUR = 0.65  # [px] of a focused picture: the pixel itself, the lens, the way between pixels
RAGGED = 0.9  # [px] RMS beyond which edges are not the mark's; chance edges give 1.7
PAINT, RAGGED_NEAR = 2.5e-4, 1.3  # [mark sizes] no edge is painted straighter; [px] that much is believed, near by
LEAST_CONTRAST = 8.0  # [grey levels]
FOLLOWED, FOLLOWED_CUT, FOUND = 0.55, 0.5, 0.75  # share of the model's edge points that must agree
LEAST_POINTS = 60  # to be found
PRIOR_WIDTH = 3.0  # a prediction holds a fit with this many times its standard deviation: loosely
GATE = 5.0  # standard deviations between prediction and a followed mark
FARTHEST = 0.96  # [mark sizes] of any edge from the centre
OPEN_ANGLE = 3.0  # [rad]
LEVEL_KNOWN = math.radians(1.0)  # the pad's normal is given where perspective shows it better than that
WARP = 0.02  # [px] by which edges may be off together so as to look like a tilt: lens, paint, texture filter


class RingFrontEnd:
    """Looks for one ring mark in the pictures of one camera. Keeps nothing from one picture to the next."""

    def __init__(
        self,
        camera: CameraModel,
        mount: CameraMount,
        mark: RingMark,
        *,
        variant: Literal["helideck"] = "helideck",
        tilt_std: float = math.radians(0.3),
        scale_std: float = 5e-4,
        pixel_std: float = 0.03,
    ) -> None:
        """What the pictures cannot tell about themselves, as standard deviations that enter the answer's covariance.

        tilt_std [rad] of roll and pitch, large where the tilt is to be solved from the picture; scale_std [1] of focal
        length and mark's size; pixel_std [px] of the place of all edges together (principal point, texture filter).
        """
        if variant != "helideck":
            raise ValueError(f"variant: no front end named {variant!r}; there is 'helideck'")
        self.camera, self.mount, self.mark, self.tilt_std = camera, mount, mark, tilt_std
        self.scale_std, self.pixel_std = scale_std, pixel_std
        self._samples = ring_samples(mark)
        self._search = RingSearch(camera, mark)
        self._focal = min(camera.fx, camera.fy)
        steps = np.linspace(-FARTHEST, FARTHEST, 49) * mark.size
        grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        painted = np.hypot(*grid.T) <= mark.size / 2
        for corners in mark.bars():
            flat = corners.astype(np.float32).reshape(-1, 1, 2)
            painted |= [cv2.pointPolygonTest(flat, (float(x), float(y)), False) >= 0 for x, y in grid]
        self._inside = grid[painted]
        turn = np.linspace(0.0, 2.0 * math.pi, 49)
        rim = np.column_stack([np.sin(turn), np.cos(turn)])
        # one stroke: from the guide line's end along the axis and around every ring on the way
        self._outline = np.vstack(
            [mark.guide_outlines()[-1][2:].mean(axis=0), *(outer * rim for _, outer in mark.rings)]
        )

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB which is made grey; or None.

        attitude: (4,) wxyz, body to world, at the picture's time. prediction: where the filter expects the mark, or
        None. Without one the rings are found, whole or cut; where too few of the bars are in the picture the angle is
        NaN and its standard deviation some radians.
        """
        if image.ndim == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        if image.shape != (self.camera.height, self.camera.width):
            raise ValueError(
                f"picture: {image.shape[1]}x{image.shape[0]}, the camera has {self.camera.width}x{self.camera.height}"
            )
        level = level_axes(attitude, self.mount)
        if prediction is not None:
            sighting = self._track(image, level, prediction)
            if sighting is not None:
                return sighting
            sighting = self._acquire(image, level, prediction)
            if sighting is not None:
                return sighting
        return self._acquire(image, level, None)  # the filter may be mistaken, and surer than it should be

    # following

    def _track(self, image: Image, level: LevelAxes, prediction: PadPrediction) -> PadSighting | None:
        start = MarkPose(np.asarray(prediction.position, float), float(prediction.angle))
        depth = start.position[2]
        if depth <= 0.05:
            return None
        std = np.append(prediction.std_position, prediction.std_angle)
        prior = np.maximum(PRIOR_WIDTH * std, np.append(np.full(3, 0.01 + 0.01 * depth), 0.035))
        spread, room = self._spread(start.position, std), REACH_SHARE * WIDE * self.mark.size * self._focal / depth
        if 2.0 * spread > room:
            return None
        fit = self._refine(image, level, start, prior, min(3.0 * spread + 1.5, room))
        if fit is None or not self._agrees(fit, start, std):
            return None
        return self._sighting(fit, level, tracked=True)

    def _agrees(self, fit: EdgeFit, start: MarkPose, std: Floats) -> bool:
        """Whether a followed mark is good enough, and where it was expected."""
        if not self._sound(fit, share=FOLLOWED if self._whole(fit) else FOLLOWED_CUT):
            return False
        difference = np.append(fit.pose.position - start.position, fit.pose.angle - start.angle)
        fitted = np.sqrt(np.diag(fit.covariance))
        return bool(np.all(np.abs(difference) <= GATE * np.hypot(std, fitted) + 0.002 * fit.pose.position[2]))

    def _whole(self, fit: EdgeFit) -> bool:
        return bool(self.camera.contains(self.camera.project(place(self._inside, fit.pose, fit.level))).all())

    def _sound(self, fit: EdgeFit, share: float) -> bool:
        brushed = PAINT * self.mark.size * self._focal / fit.pose.position[2]
        ragged = min(max(RAGGED, brushed), RAGGED_NEAR)
        return fit.used >= share * fit.expected and fit.residual <= ragged and abs(fit.contrast) >= LEAST_CONTRAST

    def _spread(self, position: Floats, std: Floats) -> float:
        """One standard deviation of where the mark's edges lie in the picture [px], the worst of them.

        position (3,) [m] in camera axes; std (4,) of x, y, z [m], angle [rad].
        """
        x, y, depth = position
        focal = max(self.camera.fx, self.camera.fy)
        # what counts is how far the part in the picture reaches from the mark's centre
        across = 0.5 * math.hypot(self.camera.width, self.camera.height)
        radius = min(FARTHEST * self.mark.size * focal / depth, across + focal * math.hypot(x, y) / depth)
        lateral = focal / depth * max(std[0], std[1])
        along = std[2] / depth * (radius + focal * math.hypot(x, y) / depth)
        return math.sqrt(lateral**2 + along**2 + (std[3] * radius) ** 2)

    def _refine(
        self, image: Image, level: LevelAxes, start: MarkPose, prior: Floats, reach: float, turns: bool = True
    ) -> EdgeFit | None:
        """Edge fits from a wide search on few edges of a reduced picture to a narrow one on all edges of the picture.

        reach [px] of the first search; turns: the angle is known, so that bars and holes may take part.
        """
        fit: EdgeFit | None = None
        for _ in range(4):
            scale = self._focal / start.position[2]  # [px/m]
            factor = 1
            while reach / factor > SHARPEST_REACH and factor < 8:
                factor *= 2
            samples = self._samples.clear(
                APART * factor / scale, reach / REACH_SHARE / scale, blur=BLUR / scale, round_only=not turns
            )
            if samples is None:
                return None
            picture, camera = reduced(image, self.camera, factor)
            fit = fit_outline(
                picture, camera, samples, level, start, prior_std=prior, reach=reach / factor, polarity=1,
                tilt_std=self.tilt_std, iterations=8 if factor == 1 else 6,
            )  # fmt: skip
            if fit is None:
                return None
            if factor == 1 and reach <= NARROW:
                return fit
            start = fit.pose
            left_open = np.minimum(np.sqrt(np.diag(fit.covariance)), prior / PRIOR_WIDTH)
            if not turns:
                left_open[3] = 0.0
            narrow = max(NARROW, 3.0 * self._spread(start.position, left_open))
            if factor == 1 and narrow >= 0.7 * reach:
                return fit  # what is still open cannot be closed by the edges that are clear enough
            reach = min(narrow, 0.7 * reach)
        return fit

    # finding

    def _acquire(self, image: Image, level: LevelAxes, prediction: PadPrediction | None) -> PadSighting | None:
        left, top, right, bottom = self._region(prediction)
        if right - left < 20 or bottom - top < 20:
            return None
        region = np.asarray(cv2.medianBlur(np.ascontiguousarray(image[top:bottom, left:right]), 3), np.uint8)
        for poses in self._search.poses(region, (left, top), level, prediction.angle if prediction else 0.0):
            for start, turned in poses:
                fit = self._verified(image, level, start, turned)
                if fit is not None:
                    return self._sighting(fit, level, tracked=False, turned=turned)
        return None

    def _region(self, prediction: PadPrediction | None) -> tuple[int, int, int, int]:
        """Left, top, right, bottom [px] of where the mark is expected within three standard deviations."""
        if prediction is None or prediction.position[2] <= 0.0:
            return 0, 0, self.camera.width, self.camera.height
        centre = self.camera.project(np.asarray(prediction.position, float))[0]
        std = np.append(prediction.std_position, prediction.std_angle)
        nearest = max(prediction.position[2] - 3.0 * prediction.std_position[2], 0.3 * prediction.position[2])
        reach = 3.0 * self._spread(prediction.position, std) + 8.0
        half = max(self.camera.fx, self.camera.fy) * self.mark.size / nearest + reach
        low = np.clip(centre - half, 0, [self.camera.width, self.camera.height]).astype(int)
        high = np.clip(centre + half + 1, 0, [self.camera.width, self.camera.height]).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _verified(self, image: Image, level: LevelAxes, start: MarkPose, turned: bool) -> EdgeFit | None:
        depth = start.position[2]
        prior = np.array([0.2 * depth, 0.2 * depth, 0.3 * depth, 0.5])
        # a circle of a threshold is good to a pixel or so, the tilt moves the edges of a near mark
        reach = 4.0 + 0.01 * min(self.mark.size * self._focal / depth, self.camera.width)
        fit = self._refine(image, level, start, prior, reach, turns=turned)
        if fit is None or not self._sound(fit, share=FOUND) or fit.used < LEAST_POINTS:
            return None
        # a small shape is fitted by chance more easily
        return fit if fit.residual <= 0.02 * self.mark.size * self._focal / fit.pose.position[2] else None

    # answering

    def _sighting(self, fit: EdgeFit, given: LevelAxes, *, tracked: bool, turned: bool = True) -> PadSighting:
        inside = self.camera.contains(self.camera.project(place(self._inside, fit.pose, fit.level)), -0.5)
        covariance = fit.covariance + self._systematic(fit.pose.position)
        if not turned:
            covariance[3, :] = covariance[:, 3] = 0.0
            covariance[3, 3] = OPEN_ANGLE**2
        std = np.sqrt(np.diag(covariance))
        quality = fit.used / fit.expected * min(1.0, 0.3 / max(fit.residual, 1e-6))
        return PadSighting(
            position=fit.pose.position,
            angle=math.pi - (math.pi - fit.pose.angle) % (2.0 * math.pi) if turned else math.nan,
            std_position=std[:3],
            std_angle=float(std[3]),
            covariance=covariance,
            quality=float(min(quality, 1.0)),
            visible=float(np.mean(inside)),
            outline=self.camera.project(place(self._outline, fit.pose, fit.level)),
            source="acquired" if not tracked else "tracked" if bool(inside.all()) else "cut",
            up=fit.level.up,
            residual=fit.residual,
            contrast=fit.contrast,
            level=self._level(fit, given),
        )

    @staticmethod
    def _level(fit: EdgeFit, given: LevelAxes) -> SeenLevel | None:
        """The pad's normal as the picture alone shows it.

        White noise averages out over the edge points, what they have in common does not: with n points of noise s, an
        error of `WARP` in the tilt's own pattern is WARP sqrt(n) / s standard deviations.
        """
        covariance = fit.tilt_covariance * (1.0 + fit.used * (WARP / max(fit.residual, NOISE_FLOOR)) ** 2)
        if not np.all(np.isfinite(covariance)) or np.max(np.diag(covariance)) > LEVEL_KNOWN**2:
            return None
        up = given.turned(np.append(fit.tilt, 0.0)).up
        # a turn e about the camera's x and y moves the normal by e x up
        moved = np.array([[0.0, up[2]], [-up[2], 0.0], [up[1], -up[0]]])
        return SeenLevel(up, moved @ covariance @ moved.T)

    def _systematic(self, position: Floats) -> Floats:
        """Covariance (4, 4) of what does not average out over a picture's edges."""
        along = np.append(self.scale_std * position, 0.0)  # a wrong scale moves the mark along its ray
        per_pixel = position[2] / np.array([self.camera.fx, self.camera.fy])
        across = np.array([per_pixel[0], per_pixel[1], 0.0, per_pixel[0] / self.mark.size])
        return np.asarray(np.outer(along, along) + np.diag((self.pixel_std * across) ** 2))

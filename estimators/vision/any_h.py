"""H front end for pictures of the user's own: any plain H, small or large, sharp or smeared, on whatever plate."""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.blur_fit import Beliefs, BlurFit, Look, fit_blurred
from estimators.vision.cut_h import cut_starts, enough_seen
from estimators.vision.h_mark import reduced
from estimators.vision.level_sets import Blob, blobs
from estimators.vision.pose import (
    LevelAxes,
    MarkPose,
    directions,
    from_pad_plane,
    level_axes,
    on_pad_plane,
    place,
    wrap_axis,
)
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.camera import CameraModel, CameraMount
from flightlog.marks import HMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

USUAL = (0.85, 0.19)  # width and stroke over leg
SPREAD = np.array([0.3, 0.35])  # standard deviations of their logarithms
SEARCH_SIDE = 900  # [px] longer side of the picture whose level sets are looked at first
SEARCH_LEG, FINAL_LEG = 36.0, 100.0  # [px] longest leg in the reduced pictures of search and answer
SHORTEST_LEG = 9.0  # [px] of an H that can be told from other things
SWEEPS = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.3), (0.22, 0.22), (0.22, -0.22))  # of the leg: motions tried
CLEAR = 0.93  # explained: nothing better need be sought
SWEPT_TRIED = 3  # blobs that are tried with motion
LEAST_EXPLAINED = 0.85
STROKES, GAPS = (0.6, 1.4), 0.28  # contrast of the parts over the whole's
PROPORTIONS = ((0.5, 1.4), (0.09, 0.34))  # width and stroke over leg
NARROWEST_GAP = 0.1  # between the legs, over the leg
CARRIES_TILT = 5.0  # [px] leg^2/f beyond which a picture's faults are less than 2 deg of tilt
FAULTS, TILT_FAULTS = 0.1, 0.15  # [px] that lens, print and picture are wrong by, together and across the mark


def sound(fit: BlurFit) -> bool:
    """Whether a fit is an H beyond doubt."""
    mark, strokes, gaps = fit.look.mark, fit.anatomy[:5], fit.anatomy[5:]
    width, stroke = mark.width / mark.leg, mark.stroke / mark.leg
    return bool(
        fit.explained >= LEAST_EXPLAINED
        and PROPORTIONS[0][0] <= width <= PROPORTIONS[0][1]
        and PROPORTIONS[1][0] <= stroke <= PROPORTIONS[1][1]
        and width - 2 * stroke >= NARROWEST_GAP
        and np.isfinite(strokes).sum() >= 3
        and np.isfinite(gaps).any()
        and np.nanmin(strokes) >= STROKES[0]
        and np.nanmax(strokes) <= STROKES[1]
        and np.nanmax(np.abs(gaps)) <= GAPS
        and abs(fit.contrast) >= max(8.0, 3.0 * fit.residual)
    )


def _heading(look: Look) -> float:
    """Angle [rad] of the mark's axis clockwise from the horizontal projection of image up."""
    up = look.axes.up
    _, axis = directions(look.pose, look.axes)
    forward = np.array([0.0, -1.0, 0.0]) + up[1] * up  # image up less its part along the normal
    right = np.cross(forward, up)
    return math.atan2(float(axis @ right), float(axis @ forward))


@dataclass(frozen=True, eq=False)
class AnyHSighting:
    """One sighting, and what else was found out."""

    pad: PadSighting
    mark: HMark  # as measured
    std_tilt: float  # [rad] of the pad's normal, the worse direction


@dataclass(frozen=True)
class _Scale:
    """The picture reduced by a whole factor."""

    factor: int
    image: Image
    camera: CameraModel


class AnyHFrontEnd:
    """Looks for one H of known leg and unknown proportions. Keeps nothing from one picture to the next."""

    def __init__(
        self, camera: CameraModel, mount: CameraMount, leg: float, *, tilt_std: float = math.radians(0.3),
        mark: HMark | None = None,
    ) -> None:  # fmt: skip
        """Leg [m]; tilt_std [rad] of roll and pitch; mark: proportions where they are known."""
        self.camera, self.mount, self.leg, self.tilt_std = camera, mount, leg, tilt_std
        self._usual = mark or HMark(leg, USUAL[0] * leg, USUAL[1] * leg)
        self._spread = SPREAD if mark is None else np.full(2, 0.01)

    def see(self, image: Image, attitude: Floats, prediction: PadPrediction | None = None) -> PadSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB, or None. The prediction is not used."""
        found = self.find(image, attitude)
        return None if found is None else found.pad

    def find(self, image: Image, attitude: Floats) -> AnyHSighting | None:
        """The mark in a picture (H, W) uint8, or (H, W, 3) RGB, with its proportions; None where there is none.

        attitude: (4,) wxyz, body to world. `PadSighting.up` differs from it where the tilt could be solved.
        """
        if image.ndim == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
        level = level_axes(attitude, self.mount)
        scales = self._scales(image)
        first = next((i for i, s in enumerate(scales) if max(s.image.shape) <= SEARCH_SIDE), len(scales) - 1)
        for i in range(first, -1, -1):  # a mark too small for the reduced picture is sought in a larger one
            found = self._search(scales, i, level)
            if found is not None:
                return self._answer(found, scales, level)
        return None

    def _scales(self, image: Image) -> list[_Scale]:
        scales, factor = [], 1
        while min(image.shape) / factor >= 32 and factor <= 64:
            scales.append(_Scale(factor, *reduced(image, self.camera, factor)))
            factor *= 2
        return scales

    def _search(self, scales: list[_Scale], index: int, level: LevelAxes) -> BlurFit | None:
        here = scales[index]
        shapes = blobs(np.asarray(cv2.GaussianBlur(here.image, (0, 0), 0.7), np.uint8))
        starts: list[tuple[Look, int]] = []
        for blob in shapes:
            if blob.cut:
                continue
            look = self._whole(blob, here.camera, level)
            if look is not None:
                starts.append((look, blob.polarity))
        best: BlurFit | None = None
        for swept in (False, True):
            for look, polarity in starts[: SWEPT_TRIED if swept else None]:
                fit = self._tried(look, polarity, scales, swept)
                if fit is not None and (best is None or fit.explained > best.explained):
                    best = fit
                    if fit.explained > CLEAR:
                        return fit
        if best is None:
            for blob in (blob for blob in shapes if blob.cut):
                for pose, mark in cut_starts(blob.contour, here.camera, level, self._usual, self._spread):
                    start = Look(pose, level, np.zeros(2), mark, np.zeros(2), 0.9)
                    fit = self._tried(start, blob.polarity, scales, False)
                    if fit is not None and (best is None or fit.explained > best.explained):
                        best = fit
        return best

    def _whole(self, blob: Blob, camera: CameraModel, level: LevelAxes) -> Look | None:
        """The H that a blob's rectangle suggests."""
        half = np.stack([blob.legs, -blob.legs, blob.across, -blob.across]) / 2
        flat = on_pad_plane(np.vstack([blob.centre[None], blob.centre + half]), camera, level)
        if not np.all(np.isfinite(flat)):
            return None
        along, across = flat[1] - flat[2], flat[3] - flat[4]
        length = float(np.hypot(*along))
        width = float(np.clip(np.hypot(*across) / length, 0.55, 1.3)) * self.leg
        mark = HMark(self.leg, width, min(blob.stroke * self.leg, 0.4 * width))
        position = from_pad_plane(flat[0, 0], flat[0, 1], self.leg / length, level)
        return Look(MarkPose(position, math.atan2(along[0], along[1])), level, np.zeros(2), mark, np.zeros(2), 0.9)

    def _leg_in(self, look: Look, scale: _Scale) -> float:
        """Length [px] of the legs in a picture."""
        return self.leg * min(scale.camera.fx, scale.camera.fy) / float(look.pose.position[2])

    def _tried(self, look: Look, polarity: int, scales: list[_Scale], swept: bool) -> BlurFit | None:
        """The best sound fit from a start, at rest or swept, in a picture just large enough."""
        scale = next((s for s in scales if self._leg_in(look, s) <= SEARCH_LEG), scales[-1])
        leg = self._leg_in(look, scale)
        beliefs = Beliefs(self._usual, self._spread, 1e-3)
        best: BlurFit | None = None
        for sweep in SWEEPS[1:] if swept else SWEEPS[:1]:
            start = replace(look, sweep=np.array(sweep) * leg)
            fit = fit_blurred(scale.image, scale.camera, start, beliefs, polarity=polarity, iterations=14)
            if fit is not None and sound(fit) and (best is None or fit.explained > best.explained):
                best = replace(fit, look=replace(fit.look, sweep=fit.look.sweep * scale.factor,
                                                 blur=fit.look.blur * scale.factor))  # fmt: skip
                if best.explained > CLEAR:
                    break
        return best

    def _answer(self, found: BlurFit, scales: list[_Scale], level: LevelAxes) -> AnyHSighting | None:
        """The fit repeated in a larger picture, with tilt where it is carried."""
        look = found.look
        scale = next((s for s in scales if self._leg_in(look, s) <= FINAL_LEG), scales[-1])
        full = self._leg_in(look, scales[0])
        carried = full**2 / min(self.camera.fx, self.camera.fy) >= CARRIES_TILT and found.visible > 0.95
        # a tilt that is known better than a picture could tell is left alone
        solvable = carried and self.tilt_std > TILT_FAULTS / CARRIES_TILT
        tilt = self.tilt_std if solvable else 1e-3
        start = replace(look, sweep=look.sweep / scale.factor, blur=max(look.blur / scale.factor, 0.4))
        fit = fit_blurred(scale.image, scale.camera, start, Beliefs(self._usual, self._spread, tilt), iterations=25)
        if fit is None or not sound(fit) or not enough_seen(self._corners(fit.look), self.camera):
            return None
        worst = self.tilt_std
        if solvable:
            worst = float(np.sqrt(np.linalg.eigvalsh(fit.covariance[4:6, 4:6])[-1]))
            worst = min(math.hypot(worst, TILT_FAULTS * min(self.camera.fx, self.camera.fy) / full**2), self.tilt_std)
        return AnyHSighting(self._sighting(fit, scale), fit.look.mark, worst)

    def _corners(self, look: Look) -> Floats:
        """Corners (12, 2) [px] of the outline."""
        return self.camera.project(place(look.mark.outline(), look.pose, look.axes))

    def _sighting(self, fit: BlurFit, scale: _Scale) -> PadSighting:
        look = fit.look
        pose, axes = look.pose, look.axes
        corners = self._corners(look)
        whole = bool(self.camera.contains(corners, -0.5).all())
        per_pixel = pose.position[2] / np.array([scale.camera.fx, scale.camera.fy])
        along = pose.position * FAULTS / self._leg_in(look, scale)
        across = np.array([per_pixel[0], per_pixel[1], 0.0, per_pixel[0] / self.leg]) * FAULTS
        covariance = fit.covariance[:4, :4] + np.diag(across**2)
        covariance[:3, :3] += np.outer(along, along)
        std = np.sqrt(np.diag(covariance))
        quality = float(np.clip((fit.explained - 0.8) / 0.2, 0.0, 1.0))
        return PadSighting(
            position=pose.position, angle=wrap_axis(_heading(look)), std_position=std[:3], std_angle=float(std[3]),
            covariance=covariance, quality=quality, visible=1.0 if whole else fit.visible, outline=corners,
            source="acquired" if whole else "cut", up=axes.up, residual=FAULTS, contrast=fit.contrast,
        )  # fmt: skip

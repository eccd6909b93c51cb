"""The landing mark in pictures of the user's own."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from estimators.eyes import FrontEnd
from estimators.vision.any_h import AnyHFrontEnd
from estimators.vision.pose import level_axes
from estimators.vision.sighting import PadSighting
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment
from flightlog.errors import UserError
from flightlog.marks import HMark, RingMark
from flightlog.rotations import quaternion
from helideck.carrier_attitude import AttitudeTable
from helideck.pictures import camera_of, read_grey

Floats = NDArray[np.float64]

MOUNT = CameraMount.downward(np.zeros(3))
KNOWN_TILT = math.radians(0.3)  # standard deviation of a roll and pitch that are given
LEVEL_TILT = math.radians(5.0)  # and of a carrier's that is taken to be level
SOLVED = math.radians(2.0)  # a tilt that the picture tells better than this is solved


How = Literal["given", "solved", "level"]


class Words(Protocol):
    """What the command line says about camera and mark."""

    @property
    def size(self) -> float: ...  # noqa: D102
    @property
    def fx(self) -> float: ...  # noqa: D102
    @property
    def fy(self) -> float | None: ...  # noqa: D102
    @property
    def cx(self) -> float | None: ...  # noqa: D102
    @property
    def cy(self) -> float | None: ...  # noqa: D102
    @property
    def dist(self) -> str | None: ...  # noqa: D102
    @property
    def roll_deg(self) -> float | None: ...  # noqa: D102
    @property
    def pitch_deg(self) -> float | None: ...  # noqa: D102
    @property
    def attitude(self) -> Path | None: ...  # noqa: D102
    @property
    def mark(self) -> Literal["h", "ring"]: ...  # noqa: D102
    @property
    def variant(self) -> Literal["helideck", "published"]: ...  # noqa: D102


@dataclass(frozen=True)
class PadAnswer:
    """What one picture shows; None where nothing is found. Level axes share the camera's heading."""

    image: str
    found: bool
    height_m: float | None = None  # camera above the pad's plane
    forward_m: float | None = None  # the mark's centre
    left_m: float | None = None
    heading_deg: float | None = None  # the mark's axis clockwise from image up; (-90, 90] for an H
    height_std_m: float | None = None
    forward_std_m: float | None = None
    left_std_m: float | None = None
    heading_std_deg: float | None = None
    quality: float | None = None
    attitude: How | None = None
    visible: float | None = None  # share of the mark in the picture


@dataclass(eq=False)
class PadViewer:
    """Looks at one picture after the other; a front end is made for each size of picture."""

    words: Words
    table: AttitudeTable | None
    _eyes: dict[tuple[int, ...], FrontEnd] = field(default_factory=dict)

    @classmethod
    def of(cls, words: Words) -> "PadViewer":
        """The viewer that these words ask for. Raises UserError for numbers that make no sense."""
        if not (math.isfinite(words.size) and words.size > 0.0):
            raise UserError(f"--size {words.size}: the mark's size is a positive number of metres")
        if (words.roll_deg is None) != (words.pitch_deg is None):
            raise UserError("--roll-deg and --pitch-deg go together")
        if words.attitude is not None and words.roll_deg is not None:
            raise UserError("--attitude goes without --roll-deg and --pitch-deg")
        for name, value in (("--roll-deg", words.roll_deg), ("--pitch-deg", words.pitch_deg)):
            if value is not None and not abs(value) <= 60.0:
                raise UserError(f"{name} {value}: must lie within 60 degrees")
        return cls(words, None if words.attitude is None else AttitudeTable.read(words.attitude))

    def look(self, path: Path) -> PadAnswer:
        """What the picture in a file shows. Raises PictureError where it cannot be read."""
        image = read_grey(path)
        attitude = self._attitude(path)
        known = quaternion(*(attitude or (0.0, 0.0)), 0.0)
        tilt_std = LEVEL_TILT if attitude is None else KNOWN_TILT
        eye = self._eye(image, tilt_std)
        if isinstance(eye, AnyHFrontEnd):
            found = eye.find(image, known)
            seen = None if found is None else found.pad
            tilt_std = tilt_std if found is None else found.std_tilt
        else:
            seen = eye.see(image, known, None)
        if seen is None:
            return PadAnswer(str(path), found=False)
        how: How = "given" if attitude is not None else "solved" if tilt_std < SOLVED else "level"
        up = seen.up if how == "solved" else level_axes(known, MOUNT).up
        return self._answer(path, seen, up, how, tilt_std)

    def _attitude(self, path: Path) -> tuple[float, float] | None:
        if self.table is not None:
            return self.table.of(path)
        if self.words.roll_deg is None or self.words.pitch_deg is None:
            return None
        return math.radians(self.words.roll_deg), math.radians(self.words.pitch_deg)

    def _eye(self, image: NDArray[np.uint8], tilt_std: float) -> FrontEnd:
        if image.shape not in self._eyes:
            w = self.words
            self._eyes[image.shape] = self._front_end(camera_of(image, w.fx, w.fy, w.cx, w.cy, w.dist), tilt_std)
        return self._eyes[image.shape]

    def _front_end(self, camera: CameraModel, tilt_std: float) -> FrontEnd:
        from estimators.vision.front_ends import pad_eye

        size = self.words.size
        if self.words.mark == "h" and self.words.variant == "helideck":
            return AnyHFrontEnd(camera, MOUNT, size, tilt_std=tilt_std)
        spec = CameraSpec(25.0, 0.0, camera, MOUNT, colour=False)
        mark = RingMark(size) if self.words.mark == "ring" else HMark(size, size, 0.2 * size)
        equipment = Equipment({}, {"down": spec}, mark, 0.0, 0.0, 101325.0, 288.15, np.zeros(3))
        eye = pad_eye(equipment, self.words.variant)
        assert eye is not None
        return eye

    def _answer(self, path: Path, seen: PadSighting, up: Floats, how: How, tilt_std: float) -> PadAnswer:
        forward = np.array([0.0, -1.0, 0.0]) + up[1] * up  # image up, made horizontal
        forward /= np.linalg.norm(forward)
        axes = np.stack([-up, forward, np.cross(up, forward)])
        height, ahead, left = axes @ seen.position
        # a tilt error turns the mark about the camera
        tilt = np.array([math.hypot(ahead, left), height, height]) * tilt_std
        std = np.sqrt(np.diag(axes @ seen.covariance[:3, :3] @ axes.T) + tilt**2)
        return PadAnswer(
            str(path), True, float(height), float(ahead), float(left), math.degrees(seen.angle),
            float(std[0]), float(std[1]), float(std[2]), math.degrees(seen.std_angle), seen.quality, how, seen.visible,
        )  # fmt: skip


def as_line(answer: dict[str, Any]) -> str:
    """One picture's answer for people."""
    if answer["found"] is None:
        return f"{answer['image']}: could not be looked at"
    if not answer["found"]:
        return f"{answer['image']}: not found"
    return (
        f"{answer['image']}: {answer['height_m']:.3f} +- {answer['height_std_m']:.3f} m above the pad, "
        f"{answer['forward_m']:+.3f} m forward, {answer['left_m']:+.3f} m left, "
        f"heading {answer['heading_deg']:+.2f} deg (attitude {answer['attitude']}, "
        f"{100 * answer['visible']:.0f} % of the mark visible)"
    )

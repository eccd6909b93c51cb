"""The landing mark in pictures of the user's own."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from estimators.eyes import FrontEnd
from estimators.vision.pose import level_axes
from estimators.vision.sighting import PadSighting
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec, Equipment
from flightlog.errors import UserError
from flightlog.marks import HMark
from flightlog.rotations import quaternion
from helideck.carrier_attitude import AttitudeTable
from helideck.pictures import camera_of, read_grey

Floats = NDArray[np.float64]

MOUNT = CameraMount.downward(np.zeros(3))
KNOWN_TILT = math.radians(0.3)  # standard deviation of a roll and pitch that are given
LEVEL_TILT = math.radians(5.0)  # and of a carrier's that is taken to be level


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
    attitude: Literal["given", "solved", "level"] | None = None
    visible: float | None = None  # share of the mark in the picture


@dataclass(eq=False)
class PadViewer:
    """Looks at one picture after the other; a front end is made for each size of picture."""

    words: Words
    table: AttitudeTable | None
    _eyes: dict[tuple[int, ...], tuple[CameraModel, FrontEnd]] = field(default_factory=dict)

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
        seen = self._eye(image).see(image, quaternion(*(attitude or (0.0, 0.0)), 0.0), None)
        if seen is None:
            return PadAnswer(str(path), found=False)
        return self._answer(path, seen, attitude)

    def _attitude(self, path: Path) -> tuple[float, float] | None:
        if self.table is not None:
            return self.table.of(path)
        if self.words.roll_deg is None or self.words.pitch_deg is None:
            return None
        return math.radians(self.words.roll_deg), math.radians(self.words.pitch_deg)

    def _eye(self, image: NDArray[np.uint8]) -> FrontEnd:
        if image.shape not in self._eyes:
            w = self.words
            camera = camera_of(image, w.fx, w.fy, w.cx, w.cy, w.dist)
            self._eyes[image.shape] = camera, self._front_end(camera)
        return self._eyes[image.shape][1]

    def _front_end(self, camera: CameraModel) -> FrontEnd:
        from estimators.vision.front_ends import pad_eye

        if self.words.mark == "ring":
            raise UserError("--mark ring: there is no front end for it yet")
        mark = HMark(self.words.size, self.words.size, 0.2 * self.words.size)
        spec = CameraSpec(25.0, 0.0, camera, MOUNT, colour=False)
        equipment = Equipment({}, {"down": spec}, mark, 0.0, 0.0, 101325.0, 288.15, np.zeros(3))
        eye = pad_eye(equipment, self.words.variant)
        assert eye is not None
        return eye

    def _answer(self, path: Path, seen: PadSighting, attitude: tuple[float, float] | None) -> PadAnswer:
        level = level_axes(quaternion(*(attitude or (0.0, 0.0)), 0.0), MOUNT)
        axes = np.stack([seen.up, level.forward, -level.right])
        height, forward, left = axes @ seen.position * [-1.0, 1.0, 1.0]
        # a tilt error turns the mark about the camera
        tilt = np.array([math.hypot(forward, left), height, height]) * (LEVEL_TILT if attitude is None else KNOWN_TILT)
        std = np.sqrt(np.diag(axes @ seen.covariance[:3, :3] @ axes.T) + tilt**2)
        return PadAnswer(
            str(path), True, float(height), float(forward), float(left), math.degrees(seen.angle),
            float(std[0]), float(std[1]), float(std[2]), math.degrees(seen.std_angle), seen.quality,
            "level" if attitude is None else "given", seen.visible,
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
        f"heading {answer['heading_deg']:+.2f} deg (attitude {answer['attitude']}, {100 * answer['visible']:.0f} % of the mark visible)"
    )

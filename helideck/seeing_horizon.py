"""The horizon in pictures of the user's own."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from estimators.vision.horizon import HorizonFrontEnd, HorizonSighting
from estimators.vision.huang_horizon import BETWEEN, HuangPair
from flightlog.camera import CameraModel, CameraMount
from flightlog.constants import EARTH_RADIUS
from flightlog.errors import UserError
from helideck.pictures import Image, PictureError, camera_of, read_colour

AHEAD = CameraMount.forward(np.zeros(3))
LOWER = CameraMount.forward(np.zeros(3), BETWEEN)


class Words(Protocol):
    """What the command line says about the camera."""

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
    def height(self) -> float | None: ...  # noqa: D102
    @property
    def variant(self) -> Literal["helideck", "published"]: ...  # noqa: D102


@dataclass(frozen=True)
class HorizonAnswer:
    """What one picture, or pair, shows; None where there is no horizon."""

    image: str
    found: bool
    roll_deg: float | None = None  # right side down positive
    pitch_deg: float | None = None  # nose up positive
    roll_std_deg: float | None = None
    pitch_std_deg: float | None = None
    line: tuple[tuple[float, float], tuple[float, float]] | None = None  # [px] left and right end


@dataclass(eq=False)
class HorizonViewer:
    """Looks at one picture or pair after the other; a front end is made for each size of picture."""

    words: Words
    dip: float  # [rad]
    _eyes: dict[tuple[int, ...], Any] = field(default_factory=dict)
    _clock: float = 0.0  # [s] pairs looked at so far

    @classmethod
    def of(cls, words: Words) -> "HorizonViewer":
        """The viewer that these words ask for. Raises UserError for numbers that make no sense."""
        height = words.height
        if height is not None and not 0.0 <= height <= 50_000.0:
            raise UserError(f"--height {height}: must lie within 0 .. 50000 m")
        return cls(words, math.sqrt(2.0 * (height or 0.0) / EARTH_RADIUS))

    def look(self, paths: Sequence[Path]) -> HorizonAnswer:
        """What one picture shows, or as published a pair. Raises PictureError where one cannot be read."""
        images = [read_colour(path) for path in paths]
        if any(image.shape != images[0].shape for image in images):
            raise PictureError(f"{paths[1]}: is not of the size of {paths[0]}, with which it makes a pair")
        seen = self._seen(images)
        if seen is None:
            return HorizonAnswer(str(paths[0]), found=False)
        stds = math.degrees(seen.std_roll), math.degrees(seen.std_pitch)
        return HorizonAnswer(
            str(paths[0]), True, math.degrees(seen.roll), math.degrees(seen.pitch - self.dip), *stds, seen.line
        )

    def _seen(self, images: Sequence[Image]) -> HorizonSighting | None:
        shape = images[0].shape
        if shape not in self._eyes:
            w = self.words
            camera = camera_of(images[0], w.fx, w.fy, w.cx, w.cy, w.dist)
            self._eyes[shape] = self._pair(camera) if len(images) == 2 else HorizonFrontEnd(camera, AHEAD)
        eye = self._eyes[shape]
        if isinstance(eye, HorizonFrontEnd):
            return eye.see(images[0])
        # the pair answers with the later of its two pictures; what it saw before must not count
        self._clock += 1.0
        eye.see("b", images[1], self._clock)
        found: HorizonSighting | None = eye.see("a", images[0], self._clock)
        return found

    @staticmethod
    def _pair(camera: CameraModel) -> HuangPair:
        if camera.distorted:
            raise UserError("--dist: the published method knows no lens; leave it out, or undistort the pictures first")
        return HuangPair((camera, AHEAD), (camera, LOWER))


def as_line(answer: dict[str, Any]) -> str:
    """An answer for people."""
    if answer["found"] is None:
        return f"{answer['image']}: unreadable"
    if not answer["found"]:
        return f"{answer['image']}: no horizon"
    return (
        f"{answer['image']}: roll {answer['roll_deg']:+.2f} +- {answer['roll_std_deg']:.2f} deg, "
        f"pitch {answer['pitch_deg']:+.2f} +- {answer['pitch_std_deg']:.2f} deg"
    )

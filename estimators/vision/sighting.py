"""What a pad front end is told beforehand and what it answers."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from flightlog.signals import Frame, PadSample

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PadPrediction:
    """Where the filter expects the mark at the picture's time; camera axes.

    Standard deviations are the filter's own, one sigma; region of interest and search widths follow from them.
    """

    position: Floats  # (3,) [m] the mark's centre in camera axes
    angle: float  # [rad] as PadSighting.angle, in (-pi, pi]
    std_position: Floats  # (3,) [m] camera axes
    std_angle: float  # [rad]


@dataclass(frozen=True, eq=False)
class SeenLevel:
    """The pad's normal by perspective alone: the attitude that the front end was given is not in it."""

    up: Floats  # (3,) camera axes
    covariance: Floats  # (3, 3) [rad^2] of it


@dataclass(frozen=True, eq=False)
class PadSighting:
    """One sighting of the mark.

    angle: azimuth of the mark's axis minus azimuth of image up, both clockwise seen from above, image up taken by its
    horizontal projection: heading of the mark = heading of the camera + angle (for the down camera the camera's
    heading is the vehicle's). Modulo the mark's own turn: in (-pi/2, pi/2] for an H, in (-pi, pi] for a ring; NaN where
    the picture leaves it open.

    covariance (4, 4) is of (x, y, z [m], angle [rad]), from the picture alone: the prediction is not in it, and a
    direction that the visible edges leave open has a standard deviation of metres. It holds the front end's share of
    an unknown tilt (`tilt_std`); the error that a wrong attitude makes when the position is turned into the world is
    the navigator's to add.
    """

    position: Floats  # (3,) [m] the mark's centre, camera axes
    angle: float  # [rad]
    std_position: Floats  # (3,) [m]
    std_angle: float  # [rad]
    covariance: Floats  # (4, 4) of x, y, z [m], angle [rad]
    quality: float  # [0..1] share of the expected edge points that agree, lowered where edges are ragged
    visible: float  # [0..1] share of the mark's area in the picture
    outline: Floats  # (N, 2) [px] the mark's corners in the picture, for drawing; NaN behind the camera
    source: Literal["acquired", "tracked", "cut"]  # cut: tracked with part of the mark outside the picture
    up: Floats  # (3,) the pad's normal in camera axes as fitted (the attitude's, corrected within tilt_std)
    residual: float  # [px] RMS of the edge points used
    contrast: float  # [grey levels] mark minus surroundings across its edges; negative for a dark mark
    level: SeenLevel | None = None  # where the mark is large enough in the picture to show its tilt

    def sample(self, frame: Frame) -> PadSample:
        """The sighting as the sample that a sensor of the mark would give for this picture."""
        x, y, z = self.position.tolist()
        std_x, std_y, std_z = self.std_position.tolist()
        return PadSample(
            frame.t, frame.t_arrival, x, y, z, self.angle, std_x, std_y, std_z, self.std_angle, self.quality,
            self.source,
        )  # fmt: skip

    @property
    def overlay(self) -> Floats:
        """(N + 1, 2) [px] the outline, closed."""
        return np.vstack([self.outline, self.outline[:1]])

"""The sun."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Light:
    """Where the sun stands and how strong daylight is; strength 1 is a clear noon."""

    sun_elevation: float = math.radians(45.0)  # [rad] above the horizon
    sun_azimuth: float = math.radians(225.0)  # [rad] clockwise from north
    strength: float = 1.0  # [1] factor on all light, sun and sky alike

    # level ground of reflectance 1 is rendered at this level from any elevation; `illuminance` carries the rest
    HORIZONTAL: ClassVar[float] = 0.80
    BEAM: ClassVar[float] = 0.65  # of it from the sun at the zenith

    def __post_init__(self) -> None:
        if not 0.0 < self.sun_elevation <= math.pi / 2:
            raise ValueError(f"sun elevation {math.degrees(self.sun_elevation):.1f} deg: must be in (0, 90]")
        if not self.strength > 0.0:
            raise ValueError(f"light strength {self.strength}: must be positive")

    def direction(self) -> NDArray[np.float64]:
        """Unit vector (3,) ENU along which sunlight travels."""
        c = math.cos(self.sun_elevation)
        return -np.array(
            [c * math.sin(self.sun_azimuth), c * math.cos(self.sun_azimuth), math.sin(self.sun_elevation)]
        )

    @property
    def ambient(self) -> float:
        """Light [1] from the whole sky that, with the beam, gives level ground its constant level in the renderer."""
        return self.HORIZONTAL - self.BEAM * math.sin(self.sun_elevation)

    @property
    def illuminance(self) -> float:
        """Light on level ground [1] against that of a sun at 45 deg: beam and sky by elevation, times strength."""
        return self.strength * (0.34 + self.BEAM * math.sin(self.sun_elevation)) / 0.80

    def shadow(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where on the ground, (2,) east and north [m], the shadow of a point (3,) [m] falls."""
        # a sun below 15 deg would throw the blob out of every picture; real shadows there are faint streaks
        d = self.direction()
        return np.asarray(position[:2] + d[:2] / max(-d[2], math.sin(math.radians(15.0))) * max(position[2], 0.0))

"""A flight's local axes on the WGS 84 ellipsoid."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

_AXIS = 6_378_137.0  # [m] semi-major axis
_ECCENTRICITY_2 = 6.694379990141e-3


@dataclass(frozen=True)
class LocalFrame:
    """East, north and up from an origin, to first order in latitude and longitude.

    A kilometre from the origin the tangent's error is below 0.1 m, but for the longitude lines' convergence, which
    turns north by the longitude difference times the sine of the latitude.
    """

    latitude: float  # [deg]
    longitude: float  # [deg]
    altitude: float  # [m]

    def _radii(self) -> tuple[float, float]:
        """Metres for a radian of latitude, and of longitude."""
        sine = math.sin(math.radians(self.latitude))
        root = math.sqrt(1.0 - _ECCENTRICITY_2 * sine * sine)
        meridian = _AXIS * (1.0 - _ECCENTRICITY_2) / root**3 + self.altitude
        return meridian, (_AXIS / root + self.altitude) * math.cos(math.radians(self.latitude))

    def enu(
        self, latitude: ArrayLike, longitude: ArrayLike, altitude: ArrayLike
    ) -> tuple[Floats, Floats, Floats]:
        """(e, n, u), each (N,) [m], of places by latitude and longitude [deg] and altitude [m]."""
        north, east = self._radii()
        turned = (np.asarray(longitude, float) - self.longitude + 180.0) % 360.0 - 180.0
        return (
            east * np.radians(turned),
            north * np.radians(np.asarray(latitude, float) - self.latitude),
            np.asarray(altitude, float) - self.altitude,
        )

    def geographic(self, e: ArrayLike, n: ArrayLike, u: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """(latitude [deg], longitude [deg], altitude [m]), each (N,): the inverse of `enu`."""
        north, east = self._radii()
        longitude = self.longitude + np.degrees(np.asarray(e, float) / east)
        return (
            self.latitude + np.degrees(np.asarray(n, float) / north),
            (longitude + 180.0) % 360.0 - 180.0,
            self.altitude + np.asarray(u, float),
        )

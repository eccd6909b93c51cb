"""The horizon as a measurement of the attitude's tilt error, which the position filter has among its states.

A sighting gives the world's up in body axes. Turned into the world by the attitude of the picture's time it would
point straight up; its horizontal part is the tilt error d of that attitude, as the position filter means it. So the
horizon levels the attitude, shows the accelerometer's error where hovering alone cannot, and acts at the time of its
picture however late it comes.
"""

import math

import numpy as np

from estimators.altitude import AltitudeFilter, H
from estimators.attitude import AttitudeFilter
from estimators.position import PositionFilter
from flightlog.constants import EARTH_RADIUS
from flightlog.rotations import matrix
from flightlog.signals import HorizonSample

MOUNT = math.radians(0.05)  # no forward camera's axes are known better
ALIKE = 10.0  # sightings that see the same hills: together they count for one
STEEP = 0.1  # least horizontal part of the nose's direction


class HorizonFusion:
    """Takes sightings of the horizon; `dips`: it lies below elevation 0, as on the round earth."""

    def __init__(self, *, dips: bool) -> None:
        self._dips = dips

    def take(
        self, s: HorizonSample, attitude: AttitudeFilter, altitude: AltitudeFilter, position: PositionFilter
    ) -> bool:
        """Whether the sighting could be used."""
        spread = s.std_roll + s.std_pitch
        if not (s.valid and math.isfinite(s.t + s.roll + s.pitch + spread) and min(s.std_roll, s.std_pitch) > 0.0):
            return False
        pitch, roll = s.pitch, s.roll
        if self._dips:
            state, _ = altitude.kalman.state_at(s.t)
            pitch -= math.sqrt(2.0 * max(float(state[H]), 0.0) / EARTH_RADIUS)
        rotation = matrix(attitude.at(s.t))
        c, sn = rotation[0, 0], rotation[1, 0]
        level = math.hypot(c, sn)
        if level < STEEP:
            return False
        c, sn = c / level, sn / level
        up = np.array([math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)])
        east, north, _ = rotation @ up
        return position.horizon(
            s.t, c, sn, c * east + sn * north, c * north - sn * east,
            ALIKE * (s.std_pitch**2 + MOUNT**2), ALIKE * (s.std_roll**2 + MOUNT**2),
        )  # fmt: skip

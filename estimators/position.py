"""Horizontal position and velocity from inertial, vision and GPS; and what they say of the tilt.

    x = [e, n, ve, vn, d_e, d_n, a_e, a_n, g_e, g_n]

position and velocity of the body origin, tilt error of the attitude, error of the accelerometer, bias of the GPS.

A tilt error d [rad] does two things: R f is off by g d, and a position by vision, turned into the world by that
attitude, is off by d times the height (it does not average out at 25 pictures a second). Hovering, the first cannot be
told from an error of the accelerometer; coming down, the second can. The attitude filter turns back what is found here
and says so: its turning is an input of this filter, d' = c.

Without the bias of the GPS as a state the machine would run off by half a metre when the mark leaves the picture;
vision observes it, and what is left when the mark is lost is what the GPS has wandered since.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators.attitude_memory import INPUTS
from estimators.delayed_kalman import Component, DelayedKalman, LinearModel
from estimators.replay import TAKEN
from flightlog.constants import GRAVITY
from flightlog.equipment import Equipment

Floats = NDArray[np.float64]

E, N, VE, VN, D_E, D_N, A_E, A_N, G_E, G_N = range(10)  # states
GPS_E, GPS_N, GPS_VE, GPS_VN, VISION_1, VISION_2 = range(6)  # components
TOPIC_GPS, TOPIC_GPS_VELOCITY, TOPIC_VISION = range(3)
BLIND = 5.0  # [m] a direction that the picture leaves this open is not measured


@dataclass(frozen=True)
class PositionNoise:
    """What the filter assumes; standard deviations."""

    acceleration: float = 0.03  # [m/s^2/sqrt(Hz)] white
    tilt_start: float = 0.012  # [rad] after alignment
    tilt_walk: float = 0.0015  # [rad/sqrt(s)] unknown bias of the gyroscopes, scale errors in turns
    accelerometer: float = 0.06  # [m/s^2] bias, and misalignment times gravity
    accelerometer_tau: float = 100.0  # [s]
    gps: float = 0.05  # [m] white
    gps_bias: float = 0.6  # [m] at the start
    gps_wander: float = 0.25  # [m]
    gps_wander_tau: float = 60.0  # [s]
    gps_velocity: float = 0.05  # [m/s] white

    @classmethod
    def of(cls, equipment: Equipment) -> "PositionNoise":
        """From the sensors as fitted; what is not fitted keeps its default and is never heard of."""
        given: dict[str, float] = {}
        if (imu := equipment.sensors.get("imu")) is not None:
            bias = math.hypot(imu["accel_bias_std"], imu["accel_drift_std"], GRAVITY * imu["misalignment_std"])
            # as a walk that comes as far as a constant bias does in the 3 s that it takes to be corrected
            walk = math.hypot(imu["gyro_bias_std"], imu["gyro_drift_std"]) * math.sqrt(3.0)
            given |= {
                "acceleration": math.hypot(imu["accel_noise"], 0.01),
                "accelerometer": bias,
                "tilt_walk": math.hypot(walk, imu["gyro_noise"]),
            }
        if (gps := equipment.sensors.get("gps")) is not None:
            given |= {
                "gps": math.hypot(gps["noise"], 0.01),
                "gps_bias": math.hypot(gps["bias_std"], gps["wander_std"]),
                "gps_wander": gps["wander_std"],
                "gps_wander_tau": gps["wander_tau"],
                "gps_velocity": gps["velocity_noise"],
            }
        return cls(**given)


def model(noise: PositionNoise) -> LinearModel:
    """The derivatives are p' = v, v' = f - g d - a, d' = c; a Gauss-Markov; the GPS bias walks as far as its wander."""
    dynamics, inputs = np.zeros((10, 10)), np.zeros((10, INPUTS))
    density, driven = np.zeros((10, 10)), np.zeros((10, 10))
    for axis in range(2):
        dynamics[E + axis, VE + axis] = 1.0
        dynamics[VE + axis, D_E + axis] = -GRAVITY
        dynamics[VE + axis, A_E + axis] = -1.0
        dynamics[A_E + axis, A_E + axis] = -1.0 / noise.accelerometer_tau
        inputs[VE + axis, axis] = 1.0
        inputs[D_E + axis, 3 + axis] = 1.0
        density[A_E + axis, A_E + axis] = 2.0 * noise.accelerometer**2 / noise.accelerometer_tau
        density[G_E + axis, G_E + axis] = 2.0 * noise.gps_wander**2 / noise.gps_wander_tau
        driven[VE + axis, VE + axis] = noise.acceleration**2
        driven[D_E + axis, D_E + axis] = noise.tilt_walk**2
    components = [
        Component(TOPIC_GPS, patience=10, jump=G_E),
        Component(TOPIC_GPS, patience=10, jump=G_N),
        Component(TOPIC_GPS_VELOCITY, patience=10),
        Component(TOPIC_GPS_VELOCITY, patience=10),
        Component(TOPIC_VISION, patience=25, reference=True),
        Component(TOPIC_VISION, patience=25, reference=True),
    ]
    return LinearModel(dynamics, inputs, density, driven, components)


class PositionFilter:
    """The filter; positions [m] of the body origin, east and north of the pad's centre."""

    def __init__(self, noise: PositionNoise, t: float, epochs: int = 160) -> None:
        """Starts at `t` [s], knowing nothing of the position; remembers so many epochs."""
        self.noise = noise
        start = np.repeat([100.0, 3.0, noise.tilt_start, noise.accelerometer, noise.gps_bias], 2)
        self.kalman = DelayedKalman(model(noise), t, np.zeros(10), np.diag(start**2), epochs=epochs)
        self._rows = tuple(np.zeros(10) for _ in range(4))
        for axis in range(2):
            self._rows[GPS_E + axis][[E + axis, G_E + axis]] = 1.0
            self._rows[GPS_VE + axis][VE + axis] = 1.0
        self._row = np.zeros(10)

    def gps(self, t: float, e: float, n: float, ve: float, vn: float, dilution: float) -> bool:
        """Position [m] and velocity [m/s] of the body origin; `dilution` multiplies their standard deviations."""
        insert, rows = self.kalman.insert, self._rows
        place, speed = (dilution * self.noise.gps) ** 2, (dilution * self.noise.gps_velocity) ** 2
        if insert(t, GPS_E, rows[GPS_E], e, place) != TAKEN:
            return False
        insert(t, GPS_N, rows[GPS_N], n, place)
        insert(t, GPS_VE, rows[GPS_VE], ve, speed)
        insert(t, GPS_VN, rows[GPS_VN], vn, speed)
        return True

    def vision(self, t: float, e: float, n: float, c_ee: float, c_en: float, c_nn: float, height: float) -> bool:
        """Position [m] by a picture from `height` [m], and its covariance [m^2].

        A mark cut by the picture's edge may leave one direction open, which seldom is east or north: the covariance
        is turned to its principal axes, and each is a scalar measurement of its own, uncorrelated with the other.
        """
        mean, half = 0.5 * (c_ee + c_nn), 0.5 * (c_ee - c_nn)
        spread = math.hypot(half, c_en)
        # cos and sin of the large axis, counter-clockwise from east
        turn = 0.5 * math.atan2(c_en, half) if spread > 1e-12 * mean else 0.0
        c, s = math.cos(turn), math.sin(turn)
        return self._along(t, VISION_1, c, s, c * e + s * n, mean + spread, height) and self._along(
            t, VISION_2, -s, c, -s * e + c * n, mean - spread, height
        )

    def _along(self, t: float, component: int, c: float, s: float, z: float, variance: float, height: float) -> bool:
        if variance > BLIND * BLIND:
            return True
        row = self._row
        row[E], row[N], row[D_E], row[D_N] = c, s, c * height, s * height
        return self.kalman.insert(t, component, row, z, variance) == TAKEN

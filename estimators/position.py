"""Horizontal position and velocity from inertial, vision, GPS and optical flow; and what they say of the tilt.

    x = [e, n, ve, vn, d_e, d_n, a_e, a_n, g_e, g_n, b_e, b_n]

position and velocity of the body origin, tilt error of the attitude, error of the accelerometer, bias of the GPS, bias
of the gyroscopes.

A tilt error d [rad] does two things: R f is off by g d, and a position by vision, turned into the world by that
attitude, is off by d times the height (it does not average out at 25 pictures a second). Hovering, the first cannot be
told from an error of the accelerometer; coming down, the second can. The attitude filter turns back what is found here
and says so: its turning is an input of this filter, d' = b + c, and so is the share of every correction that it takes
off the gyroscopes' bias, b' = m c.

Without the bias of the GPS as a state the machine would run off by half a metre when the mark leaves the picture;
vision observes it, and what is left when the mark is lost is what the GPS has wandered since.

Optical flow measures the way since a picture was taken, the key frame. Where the vehicle was then is two states more,

    k = p + h d   at the time of the key frame,

copied with their correlations, and a flow is p + h d - k: it never tells where the vehicle is, but as long as the
pictures are compared with the same key frame the error does not grow either.
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

E, N, VE, VN, D_E, D_N, A_E, A_N, G_E, G_N, B_E, B_N, K_E, K_N = range(14)  # states; from K_E on where there is flow
GPS_E, GPS_N, GPS_VE, GPS_VN, VISION_1, VISION_2 = range(6)  # components
TILT_1, TILT_2, HORIZON_AHEAD, HORIZON_ASIDE = range(10, 14)
# what a picture says of the way to it comes before what begins with it
FLOW_E, FLOW_N, KEY_E, KEY_N = range(6, 10)
TOPIC_GPS, TOPIC_GPS_VELOCITY, TOPIC_VISION, TOPIC_FLOW, TOPIC_TILT, TOPIC_HORIZON = range(6)
GRAIN = 1e-4  # [m] of a copied place
AFTER = 1e-6  # [s] apart are measurements of one kind that are of one time
BLIND = 5.0  # [m] a direction that the picture leaves this open is not measured


@dataclass(frozen=True)
class PositionNoise:
    """What the filter assumes; standard deviations."""

    acceleration: float = 0.03  # [m/s^2/sqrt(Hz)] white
    calm_acceleration: float = 0.005  # [m/s^2/sqrt(Hz)] the same in flight by flow, low and slow
    tilt_start: float = 0.012  # [rad] after alignment
    tilt_walk: float = 3e-4  # [rad/sqrt(s)] white noise of the gyroscopes, scale errors in turns
    accelerometer: float = 0.06  # [m/s^2] bias, and misalignment times gravity
    accelerometer_drift: float = 0.01  # [m/s^2]
    accelerometer_drift_tau: float = 100.0  # [s]
    gyro_bias: float = 0.001  # [rad/s] of it at the start
    gyro_drift: float = 1.4e-4  # [rad/s]
    gyro_drift_tau: float = 300.0  # [s]
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
            given |= {
                # the noise is given as a one-sided density; scale errors make more of manoeuvres
                "acceleration": math.hypot(imu["accel_noise"] / math.sqrt(2.0), 0.006),
                "calm_acceleration": math.hypot(imu["accel_noise"], 0.003),
                "accelerometer": bias,
                "accelerometer_drift": imu["accel_drift_std"],
                "accelerometer_drift_tau": imu["accel_drift_tau"],
                "tilt_walk": math.hypot(5e-5, imu["gyro_noise"] / math.sqrt(2.0)),
                "gyro_bias": math.hypot(imu["gyro_bias_std"], imu["gyro_drift_std"]),
                "gyro_drift": imu["gyro_drift_std"],
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


def model(noise: PositionNoise, *, flow: bool = False, integral: float = 0.0) -> LinearModel:
    """The derivatives are p' = v, v' = f - g d - a, d' = b + c, b' = integral c; a and g walk by their drift.

    Of the gyroscopes' bias b the attitude filter takes off `integral` [1/s] times what it turns. Walks, not
    Gauss-Markov processes, which would forget what is constant. `flow`: with the key frame's place, which stays.
    """
    n = K_N + 1 if flow else K_E
    dynamics, inputs = np.zeros((n, n)), np.zeros((n, INPUTS))
    density, driven = np.zeros((n, n)), np.zeros((n, n))
    for axis in range(2):
        dynamics[E + axis, VE + axis] = 1.0
        dynamics[VE + axis, D_E + axis] = -GRAVITY
        dynamics[VE + axis, A_E + axis] = -1.0
        dynamics[D_E + axis, B_E + axis] = 1.0
        inputs[VE + axis, axis] = 1.0
        inputs[D_E + axis, 3 + axis] = 1.0
        inputs[B_E + axis, 3 + axis] = integral
        density[A_E + axis, A_E + axis] = 2.0 * noise.accelerometer_drift**2 / noise.accelerometer_drift_tau
        density[G_E + axis, G_E + axis] = 2.0 * noise.gps_wander**2 / noise.gps_wander_tau
        driven[VE + axis, VE + axis] = noise.acceleration**2
        density[B_E + axis, B_E + axis] = 2.0 * noise.gyro_drift**2 / noise.gyro_drift_tau
        driven[D_E + axis, D_E + axis] = noise.tilt_walk**2
        if flow:
            driven[VE + axis, VE + axis] = noise.calm_acceleration**2
    components = [
        Component(TOPIC_GPS, patience=10, jump=G_E),
        Component(TOPIC_GPS, patience=10, jump=G_N),
        Component(TOPIC_GPS_VELOCITY, patience=10),
        Component(TOPIC_GPS_VELOCITY, patience=10),
        Component(TOPIC_VISION, patience=25, reference=True),
        Component(TOPIC_VISION, patience=25, reference=True),
        Component(TOPIC_FLOW, patience=25, jump=K_E),
        Component(TOPIC_FLOW, patience=25, jump=K_N),
        Component(TOPIC_FLOW, patience=25, copies=K_E),
        Component(TOPIC_FLOW, patience=25, copies=K_N),
        Component(TOPIC_TILT, patience=25),
        Component(TOPIC_TILT, patience=25),
        Component(TOPIC_HORIZON, patience=50, jump=D_E),
        Component(TOPIC_HORIZON, patience=50, jump=D_N),
    ]
    return LinearModel(dynamics, inputs, density, driven, components)


class PositionFilter:
    """The filter; positions [m] of the body origin, east and north of the pad's centre."""

    def __init__(
        self, noise: PositionNoise, t: float, epochs: int = 160, *, flow: bool = False, integral: float = 0.0
    ) -> None:
        """Starts at `t` [s], knowing nothing of the position; remembers so many epochs; `flow`, `integral`: as `model`
        has them.
        """
        self.noise = noise
        unsure = [100.0, 3.0, noise.tilt_start, noise.accelerometer, noise.gps_bias, noise.gyro_bias, 100.0]
        start = np.repeat(unsure, 2)
        laws, room = model(noise, flow=flow, integral=integral), len(start)
        n = len(laws.dynamics)
        self.kalman = DelayedKalman(laws, t, np.zeros(n), self._start(start[:n]), epochs=epochs, room=room)
        self._rows = tuple(np.zeros(room) for _ in range(4))
        for axis in range(2):
            self._rows[GPS_E + axis][[E + axis, G_E + axis]] = 1.0
            self._rows[GPS_VE + axis][VE + axis] = 1.0
        self._row, self._way = np.zeros(room), np.zeros(room)

    @staticmethod
    def _start(deviations: Floats) -> Floats:
        """Covariance (n, n) to start from.

        The attitude was aligned by the force: what the accelerometer's error a has tilted it by is d = -a/g, and only
        what comes on top (the flight was not quite without acceleration) is independent of it.
        """
        p = np.diag(deviations**2)
        for axis in range(2):
            variance = deviations[A_E + axis] ** 2
            p[D_E + axis, D_E + axis] += variance / GRAVITY**2
            p[D_E + axis, A_E + axis] = p[A_E + axis, D_E + axis] = -variance / GRAVITY
        return p

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
        c, s, large, small = _principal(c_ee, c_en, c_nn)
        return self._along(t, VISION_1, c, s, c * e + s * n, large, height) and self._along(
            t, VISION_2, -s, c, -s * e + c * n, small, height
        )

    def tilt(self, t: float, d_e: float, d_n: float, c_ee: float, c_en: float, c_nn: float) -> bool:
        """Tilt error [rad] of the attitude in force at `t`, as a picture's perspective shows it, and its covariance."""
        c, s, large, small = _principal(c_ee, c_en, c_nn)
        row, insert = self._row, self.kalman.insert
        row[E], row[N], row[D_E], row[D_N] = 0.0, 0.0, c, s
        taken = insert(t, TILT_1, row, c * d_e + s * d_n, large) == TAKEN
        row[D_E], row[D_N] = -s, c
        return insert(t, TILT_2, row, -s * d_e + c * d_n, small) == TAKEN and taken

    def _along(self, t: float, component: int, c: float, s: float, z: float, variance: float, height: float) -> bool:
        if variance > BLIND * BLIND:
            return True
        row = self._row
        row[E], row[N], row[D_E], row[D_N] = c, s, c * height, s * height
        return self.kalman.insert(t, component, row, z, variance) == TAKEN

    def horizon(
        self, t: float, c: float, s: float, ahead: float, aside: float, variance_ahead: float, variance_aside: float
    ) -> bool:
        """Tilt error [rad] along a horizontal direction (c east, s north) and along the one to its left; [rad^2]."""
        row, insert = self._way, self.kalman.insert
        row[:] = 0.0
        row[D_E], row[D_N] = c, s
        taken = insert(t, HORIZON_AHEAD, row, ahead, variance_ahead) == TAKEN
        row[D_E], row[D_N] = -s, c
        return insert(t, HORIZON_ASIDE, row, aside, variance_aside) == TAKEN and taken

    def begin(self, t: float, position: float, velocity: float, acceleration: float) -> bool:
        """At `t` [s] at rest over the origin, the force of so far taken for the plumb line; to so many m, m/s, m/s^2
        (1 sigma).
        """
        taken = True
        known = (({E: 1.0}, position), ({VE: 1.0}, velocity), ({D_E: GRAVITY, A_E: 1.0}, acceleration))
        for axis in range(2):
            for number, (states, std) in enumerate(known):
                row = self._way
                row[:] = 0.0
                for state, factor in states.items():
                    row[state + axis] = factor
                # one kind of measurement, so each needs a time of its own
                taken &= self.kalman.insert(t - number * AFTER, FLOW_E + axis, row, 0.0, std**2) == TAKEN
        return taken

    def key_frame(self, t: float, height: float) -> bool:
        """From now on flow counts from where the vehicle is at `t` [s], `height` [m] above what it sees."""
        return all(
            self.kalman.insert(t, KEY_E + axis, self._apparent(axis, height), 0.0, GRAIN**2) == TAKEN
            for axis in range(2)
        )

    def flow(self, t: float, e: float, n: float, variance: float, height: float) -> bool:
        """The way [m] since the key frame and its variance [m^2], seen from `height` [m]."""
        taken = True
        for axis, way in enumerate((e, n)):
            row = self._apparent(axis, height)
            row[K_E + axis] = -1.0
            taken &= self.kalman.insert(t, FLOW_E + axis, row, way, variance) == TAKEN
        return taken

    def _apparent(self, axis: int, height: float) -> Floats:
        """Row of p + h d, where a sighting straight below puts the vehicle."""
        row = self._way
        row[:] = 0.0
        row[E + axis], row[D_E + axis] = 1.0, height
        return row


def _principal(c_ee: float, c_en: float, c_nn: float) -> tuple[float, float, float, float]:
    """Cosine and sine of a covariance's large axis, counter-clockwise from east, and the two variances."""
    mean, half = 0.5 * (c_ee + c_nn), 0.5 * (c_ee - c_nn)
    spread = math.hypot(half, c_en)
    turn = 0.5 * math.atan2(c_en, half) if spread > 1e-12 * mean else 0.0
    return math.cos(turn), math.sin(turn), mean + spread, mean - spread

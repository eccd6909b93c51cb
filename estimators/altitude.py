"""Height and climb rate from inertial, barometer, GPS, vision and ultrasonic ranger.

Lei et al. 2012, equations 15 to 27, extended: the published state is height and barometer bias; here it is

    x = [h, v, b_a, b_q, b_g, s, c]

height of the body origin above the pad's plane, climb rate, vertical error of the acceleration, bias of the barometer,
bias of the GPS height, scale errors of vision (focal length) and of the ranger (speed of sound). What stays the same
for a flight is a state and not noise: it does not average out. The measurements, all of h:

    high:  baro h + b_q    GPS h + b_g    vision h (1 + s)      (equations 15, 16)
    near:  GPS h + b_g     vision h (1 + s)    ranger h (1 + c)   (equations 17, 18; the barometer is shut out)

Which set is used follows from the PREDICTED height with hysteresis, not from what the ranger says, since beyond its
reach the ranger answers with echoes from nowhere. Nor is it believed at once when it should have come into reach: so
many of its last samples must have agreed with the filter. Near the ground the barometer reads the rotor's downwash;
there it is left out and its bias keeps its value, its uncertainty growing as its drift does.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from estimators.attitude_memory import INPUTS
from estimators.delayed_kalman import Component, DelayedKalman, LinearModel
from estimators.replay import TAKEN
from flightlog.equipment import Equipment

Floats = NDArray[np.float64]

H, V, B_A, B_Q, B_G, S, C = range(7)  # states
BARO, GPS, GPS_CLIMB, VISION, SONAR = range(5)  # components
TOPIC_BARO, TOPIC_GPS, TOPIC_VISION, TOPIC_SONAR = range(4)


class Mode(Enum):
    """Which of the two sets of measurements is in use."""

    HIGH = "high"
    NEAR = "near"


@dataclass(frozen=True)
class AltitudeNoise:
    """What the filter assumes of its sensors; standard deviations. Defaults: the published platform's."""

    acceleration: float = 0.03  # [m/s^2/sqrt(Hz)] white: sensor, vibration left by the notches
    acceleration_bias: float = 0.06  # [m/s^2] bias and scale error at 1 g
    acceleration_drift: float = 0.01  # [m/s^2]
    acceleration_drift_tau: float = 100.0  # [s]
    baro: float = 0.15  # [m] white
    baro_bias: float = 0.7  # [m] at the start
    baro_drift: float = 0.35  # [m]
    baro_drift_tau: float = 60.0  # [s]
    gps: float = 0.05  # [m] white
    gps_bias: float = 0.7  # [m] at the start
    gps_wander: float = 0.25  # [m]
    gps_wander_tau: float = 60.0  # [s]
    climb: float = 0.05  # [m/s] white, of the GPS
    scale: float = 0.0011  # [1] of vision: the focal length is known to 1 px of 952
    sonar_scale: float = 0.005  # [1] of the ranger
    reach_low: float = 2.7  # [m] predicted range of the ranger below which the near set is used
    reach_high: float = 3.0  # [m] and above which it is left

    @classmethod
    def of(cls, equipment: Equipment) -> "AltitudeNoise":
        """From the sensors as fitted; what is not fitted keeps its default and is never heard of."""
        given: dict[str, float] = {}
        if (imu := equipment.sensors.get("imu")) is not None:
            bias = math.hypot(imu["accel_bias_std"], imu["accel_drift_std"], 9.8 * imu["accel_scale_std"])
            given |= {
                "acceleration_bias": bias,
                "acceleration_drift": imu["accel_drift_std"],
                "acceleration_drift_tau": imu["accel_drift_tau"],
                # the noise is given as a one-sided density
                "acceleration": math.hypot(imu["accel_noise"] / math.sqrt(2.0), 0.0015),
            }
        if (baro := equipment.sensors.get("baro")) is not None:
            # white noise is widened: gusts over the port are neither white nor in the numbers
            given |= {
                "baro": math.hypot(baro["noise"], 0.02),
                "baro_bias": math.hypot(baro["bias_std"], 0.1),
                "baro_drift": baro["drift_std"],
                "baro_drift_tau": baro["drift_tau"],
            }
        if (gps := equipment.sensors.get("gps")) is not None:
            given |= {
                "gps": gps["noise_up"],
                "gps_bias": math.hypot(gps["bias_std_up"], gps["wander_std_up"]),
                "gps_wander": gps["wander_std_up"],
                "gps_wander_tau": gps["wander_tau"],
                "climb": gps["velocity_noise"],
            }
        if (sonar := equipment.sensors.get("sonar")) is not None:
            top = sonar["greatest_range"]
            given |= {
                "reach_low": 2.7 / 3.05 * top,
                "reach_high": 3.0 / 3.05 * top,
                "sonar_scale": sonar["scale_std"],
            }
        return cls(**given)


def model(noise: AltitudeNoise) -> LinearModel:
    """The derivatives are h' = v, v' = a - b_a; the biases walk as far as their drift or wander.

    Walks, not Gauss-Markov processes: those forget a constant bias, and forgetting a bias of the acceleration shows as
    a climb rate that is off for as long as the flight lasts.
    """
    dynamics = np.zeros((7, 7))
    dynamics[H, V], dynamics[V, B_A] = 1.0, -1.0
    inputs = np.zeros((7, INPUTS))
    inputs[V, 2] = 1.0
    density = np.zeros((7, 7))
    density[B_A, B_A] = 2.0 * noise.acceleration_drift**2 / noise.acceleration_drift_tau
    density[B_Q, B_Q] = 2.0 * noise.baro_drift**2 / noise.baro_drift_tau
    density[B_G, B_G] = 2.0 * noise.gps_wander**2 / noise.gps_wander_tau
    driven = np.zeros((7, 7))
    driven[V, V] = noise.acceleration**2
    components = [
        Component(TOPIC_BARO, patience=50, jump=B_Q),
        Component(TOPIC_GPS, patience=10, jump=B_G),
        Component(TOPIC_GPS, patience=10),
        Component(TOPIC_VISION, patience=25, reference=True),
        Component(TOPIC_SONAR, patience=20, reference=True),
    ]
    return LinearModel(dynamics, inputs, density, driven, components)


def _row(*states: int) -> Floats:
    row = np.zeros(7)
    row[list(states)] = 1.0
    return row


class AltitudeFilter:
    """The filter and its choice of measurements. Heights are of the body origin above the pad's plane [m]."""

    AGREEING, OUT_OF = 4, 6  # so many of the ranger's last samples must agree with the filter, and
    TOGETHER = 0.15  # [m] with each other as closely; a filter that is unsure agrees with any echo
    INSISTING = 20  # so many echoes in a row that agree with each other outvote the filter
    SILENCE = 1.0  # [s] without an echo the ranger must convince anew
    FORLORN = 2.0  # [s] without another height the barometer is heard even near the ground
    DOWNWASH = 1.5  # [m] then its error may be this large

    def __init__(self, noise: AltitudeNoise, t: float, epochs: int = 160) -> None:
        """Starts at `t` [s], knowing nothing of the height; remembers so many epochs."""
        self.noise = noise
        start = [100.0, 3.0, noise.acceleration_bias, noise.baro_bias, noise.gps_bias, noise.scale, noise.sonar_scale]
        self.kalman = DelayedKalman(model(noise), t, np.zeros(7), np.diag(np.square(start)), epochs=epochs)
        self.mode = Mode.HIGH
        self.height = 0.0  # [m] as of the last report, for the choice of measurements
        self.deviation = 100.0  # [m] its standard deviation
        self.height_time = -math.inf  # [s] of the last height that was not the barometer's
        self._rows = (_row(H, B_Q), _row(H, B_G), _row(V), _row(H), _row(H))
        self._agreed: deque[float] = deque(maxlen=self.OUT_OF)  # misses [m] of the last samples, NaN beyond the gate
        self._believed = False
        self._misses: deque[float] = deque(maxlen=self.INSISTING)
        self._insisted = False
        self._last_echo = -math.inf

    def baro(self, t: float, height: float) -> bool:
        """Height by equation 8 [m]; False where it is not used."""
        variance = self.noise.baro**2
        if self.mode is Mode.NEAR:
            if t - self.height_time < self.FORLORN:
                return True  # shut out, which is no rejection
            variance += self.DOWNWASH**2
        return self.kalman.insert(t, BARO, self._rows[BARO], height, variance) == TAKEN

    def gps(self, t: float, height: float, climb: float, dilution: float) -> bool:
        """Height [m] and climb rate [m/s]; `dilution` multiplies their standard deviations."""
        noise, insert = self.noise, self.kalman.insert
        taken = insert(t, GPS, self._rows[GPS], height, (dilution * noise.gps) ** 2)
        if taken == TAKEN:
            insert(t, GPS_CLIMB, self._rows[GPS_CLIMB], climb, (dilution * noise.climb) ** 2)
        return taken == TAKEN

    def vision(self, t: float, height: float, variance: float) -> bool:
        """Height above the pad seen [m] and its variance [m^2]."""
        row = self._rows[VISION]
        row[S] = height
        return self.kalman.insert(t, VISION, row, height, variance) == TAKEN

    def sonar(self, t: float, height: float, variance: float, lever: float) -> bool:
        """Height [m] that an echo means, NaN without one; the ranger sits `lever` [m] above the body origin."""
        self.choose(lever)
        miss = height - self.height
        heard = math.isfinite(miss)
        if heard:
            self._last_echo = t
        elif t - self._last_echo > self.SILENCE:
            self._insisted = self._believed = False
        gate = max(0.15, 4.0 * math.sqrt(variance + self.deviation**2))
        self._agreed.append(miss if heard and abs(miss) <= gate else math.nan)
        self._misses.append(miss)
        if not self._believed:
            self._believed = self._insists(t, gate) or self._convinces()
        elif all(map(math.isnan, self._agreed)) and not self._insisted:
            self._believed = False
        if heard and self._believed and self.mode is Mode.NEAR:
            self._rows[SONAR][C] = height + lever
            return self.kalman.insert(t, SONAR, self._rows[SONAR], height, variance) == TAKEN
        return True

    def _convinces(self) -> bool:
        """Whether the last echoes agree with the filter and with each other."""
        agreed = [miss for miss in self._agreed if not math.isnan(miss)]
        return len(agreed) >= self.AGREEING and max(agreed) - min(agreed) <= self.TOGETHER

    def _insists(self, t: float, gate: float) -> bool:
        """Whether the last echoes agree with each other and not with the filter, which then has gone astray.

        Not while the GPS agrees with it: echoes from nowhere may agree with each other for seconds.
        """
        misses = self._misses
        if len(misses) < self.INSISTING or not all(map(math.isfinite, misses)):
            return False
        if t - float(self.kalman.last["accepted"][TOPIC_GPS]) < self.SILENCE:
            return False
        mean = sum(misses) / len(misses)
        self._insisted = abs(mean) > gate and max(abs(miss - mean) for miss in misses) < 2.0 * self.TOGETHER
        if self._insisted:
            self.mode = Mode.NEAR
        return self._insisted

    def choose(self, lever: float) -> None:
        """The set of measurements that fits the predicted height."""
        reach = self.height + lever
        if self.mode is Mode.HIGH:
            if reach < self.noise.reach_low and self.deviation < 1.0:
                self.mode = Mode.NEAR
        elif reach > self.noise.reach_high and not self._insisted:
            self.mode = Mode.HIGH
            self._believed = False
        if self._insisted and reach < self.noise.reach_low:
            self._insisted = False  # the filter has come round

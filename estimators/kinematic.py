"""Height and horizontal position without inertial samples: the acceleration is anything of a usual size.

The filters are those of the navigator with an acceleration of none, known only as white noise; so whatever measures
height or position is fused, weighed and gated as in flight, and a velocity comes out too. Attitude is not estimated:
where a log brings the vehicle's own, it turns the sensors' places and the ranger's beam.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from estimators import altitude, position
from estimators.altitude import AltitudeFilter, AltitudeNoise
from estimators.attitude_memory import ATTITUDE, INPUTS
from estimators.lever_arms import antenna, ranger
from estimators.position import PositionFilter, PositionNoise
from estimators.screens import BaroScreen, SonarScreen
from flightlog.equipment import Equipment
from flightlog.rotations import quaternion
from flightlog.signals import BaroSample, GpsSample, Measurement, SonarSample, StateEstimate

Floats = NDArray[np.float64]

LEVEL_STD = 0.03  # [rad] of a vehicle's own attitude
FORGETS = 1.0  # [s] an attitude older than this is none


@dataclass(frozen=True, eq=False)
class Angles:
    """An attitude that comes with the log: t (N,) [s], rising, and roll, pitch, heading (N,) [rad]."""

    t: Floats
    roll: Floats
    pitch: Floats
    heading: Floats

    def at(self, t: float) -> tuple[float, float, float]:
        """(roll, pitch, heading) [rad] of the last row before a time; NaN where it is too old or not there."""
        row = int(np.searchsorted(self.t, t, side="right")) - 1
        if row < 0 or t - self.t[row] > FORGETS:
            return math.nan, math.nan, math.nan
        return float(self.roll[row]), float(self.pitch[row]), float(self.heading[row])


class KinematicNavigator:
    """Measurements in, state out, for logs without inertial samples."""

    LATE = 1.0  # [s] a sample may be late
    DOWNWASH = 1.5  # [m] a barometer's error while the ranger sees the ground

    def __init__(
        self, equipment: Equipment, t: float, *, period: float, acceleration: float, attitude: Angles | None = None
    ) -> None:
        """Starts at `t` [s]; each update is one `period` [s] further.

        acceleration: density of what the vehicle may do [m/s^2/sqrt(Hz)].
        """
        epochs = max(160, math.ceil(2.0 * self.LATE / period))
        high = replace(AltitudeNoise.of(equipment), acceleration=acceleration, acceleration_bias=1e-3)
        side = replace(
            PositionNoise.of(equipment), acceleration=acceleration, accelerometer=1e-3, tilt_start=1e-4, tilt_walk=1e-6,
            gyro_bias=1e-8, gyro_drift=1e-9,
        )  # fmt: skip
        self._equipment, self._period, self._time, self._angles = equipment, period, t, attitude
        self._altitude = AltitudeFilter(high, t - self.LATE, epochs)
        self._position = PositionFilter(side, t - self.LATE, epochs)
        self._still = np.zeros(INPUTS)
        self._baro_row, self._sonar_row = np.zeros(altitude.C + 1), np.zeros(altitude.C + 1)
        self._baro_row[[altitude.H, altitude.B_Q]] = self._sonar_row[altitude.H] = 1.0
        self._alone = not {"baro", "gps"} & equipment.sensors.keys()
        # what the lever arms ask for: an attitude without a history
        self._memory = np.zeros(1, ATTITUDE)
        self._memory["q"] = [1.0, 0.0, 0.0, 0.0]
        self._memory["quaternions"], self._memory["samples"], self._memory["times"] = [1.0, 0.0, 0.0, 0.0], 1, t
        self._refused: Counter[str] = Counter()
        self._baro_screen, self._sonar_screen = BaroScreen(high.baro), SonarScreen(high.baro)
        self._echo = -math.inf  # [s] of the last that was heard
        self._seen = (math.nan, math.nan, math.nan)

    @property
    def detections(self) -> Sequence[Measurement]:
        """None: it has no eyes."""
        return ()

    @property
    def overlays(self) -> Mapping[str, Sequence[Floats]]:
        """None."""
        return MappingProxyType({})

    @property
    def rejected(self) -> Mapping[str, int]:
        """Samples by topic that were not used."""
        counts = Counter(self._refused)
        high, side = self._altitude.kalman.rejected, self._position.kalman.rejected
        counts["baro"] += int(high[altitude.BARO]) + self._baro_screen.rejected
        counts["sonar"] += int(high[altitude.SONAR])
        counts["gps"] += int(high[[altitude.GPS, altitude.GPS_CLIMB]].sum() + side[: position.VISION_1].sum())
        return MappingProxyType({topic: count for topic, count in counts.items() if count})

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """What has arrived in the period that ends now; the state now."""
        self._time += self._period
        self._turn()
        self._altitude.kalman.advance(self._time, self._still)
        self._position.kalman.advance(self._time, self._still)
        for sample in measurements:
            if isinstance(sample, BaroSample):
                self._take_baro(sample)
            elif isinstance(sample, GpsSample):
                self._take_gps(sample)
            elif isinstance(sample, SonarSample):
                self._take_sonar(sample)
        self._altitude.kalman.refresh()
        self._position.kalman.refresh()
        return self._estimate()

    def _turn(self) -> None:
        if self._angles is None:
            return
        self._seen = roll, pitch, heading = self._angles.at(self._time)
        roll, pitch = (value if math.isfinite(value) else 0.0 for value in (roll, pitch))
        q = quaternion(roll, pitch, heading if math.isfinite(heading) else 0.5 * math.pi)
        self._memory["q"] = self._memory["quaternions"] = q
        self._memory["times"] = self._time

    def _take_baro(self, s: BaroSample) -> None:
        device = self._equipment.sensors["baro"]
        # _turn keeps the attitude level where none is known
        port = ranger(self._memory, 0.0, device.position, 0.0)[1]
        if not math.isfinite(s.altitude):
            self._refused["baro"] += 1
            return
        self._sonar_screen.baro(s.altitude)
        for heard in self._baro_screen.pass_on(s._replace(altitude=s.altitude - port)):
            near = heard.t - self._echo < 1.0
            variance = self._altitude.noise.baro**2 + (self.DOWNWASH**2 if near else 0.0)
            t = heard.t - device["lag"]
            self._altitude.kalman.insert(t, altitude.BARO, self._baro_row, heard.altitude, variance)

    def _take_gps(self, s: GpsSample) -> None:
        device = self._equipment.sensors["gps"]
        if not s.valid or not math.isfinite(s.t + s.e + s.n + s.u):
            self._refused["gps"] += 1
            return
        dilution = s.hdop / device["hdop"] if math.isfinite(s.hdop) and s.hdop > 0.0 else 1.0
        e, n, u, ve, vn, vu = antenna(self._memory, s.t, s.e, s.n, s.u, s.ve, s.vn, s.vu, device.position)
        taken = self._position.gps(s.t, e, n, ve, vn, dilution)
        if not (self._altitude.gps(s.t, u, vu, dilution) and taken):
            self._refused["gps"] += 1

    def _take_sonar(self, s: SonarSample) -> None:
        device = self._equipment.sensors["sonar"]
        echo = s.valid and math.isfinite(s.range)
        height, lever = ranger(self._memory, s.range if echo else math.nan, device.position, device["beam_half_angle"])
        heard = echo and self._sonar_screen.passes(s.t, height)
        if echo and not heard:
            self._refused["sonar"] += 1
        distance, height = (s.range, height) if heard else (math.nan, math.nan)
        share = math.hypot(device["noise_share"], device["scale_std"])
        variance = (share * distance) ** 2 + device["resolution"] ** 2 if heard else 1.0
        if self._alone:  # the altitude filter hears a ranger only where another height says that it is in reach
            self._altitude.kalman.insert(s.t, altitude.SONAR, self._sonar_row, height, variance)
        elif not self._altitude.sonar(s.t, height, variance, lever):
            self._refused["sonar"] += 1
        self._echo = float(self._altitude.kalman.last["accepted"][altitude.TOPIC_SONAR])

    def _estimate(self) -> StateEstimate:
        high, side = self._altitude.kalman.last, self._position.kalman.last
        z, zz, x, p = high["x"], high["p"], side["x"], side["p"]
        deviations = np.sqrt([p[0, 0], p[1, 1], zz[0, 0], p[2, 2], p[3, 3], zz[1, 1]])
        accepted = high["accepted"]
        newest = float(max(accepted[altitude.TOPIC_GPS], accepted[altitude.TOPIC_SONAR]))
        self._altitude.height, self._altitude.deviation = float(z[0]), float(deviations[2])
        self._altitude.height_time = newest
        roll, pitch, heading = self._seen
        level = LEVEL_STD if math.isfinite(roll + pitch) else math.nan
        return StateEstimate(
            t=self._time,
            position=np.array([x[0], x[1], z[0]]),
            velocity=np.array([x[2], x[3], z[1]]),
            acceleration=np.full(3, math.nan),
            quaternion=self._memory["q"][0].copy(),
            roll=roll,
            pitch=pitch,
            heading=heading,
            rates=np.full(3, math.nan),
            rotor_speed=math.nan,
            std_position=deviations[:3],
            std_velocity=deviations[3:],
            std_attitude=np.array([level, level, math.nan]),
            pad_age=math.inf,
            height_age=self._time - newest,
        )

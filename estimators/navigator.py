"""All that arrives aboard in, one state out: the navigator of the loop and of a measured log alike.

The filters know nothing of each other's insides: attitude turns the force into the world, position and altitude
integrate it and correct it by what they measure, and what the position filter finds wrong with the horizontal
acceleration levels the attitude. A missing sensor makes standard deviations grow and nothing else.

Delays of what the pilot gets: position, velocity and angles none beyond the inertial sample's own; rates and
acceleration 5.2 ms, from the notches and the mean of two samples that take the rotors' vibration out.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimators import altitude, chain, position
from estimators.altitude import AltitudeFilter, AltitudeNoise
from estimators.attitude import AttitudeFilter, AttitudeGains
from estimators.eyes import Eyes, FlowEye, expect_pad
from estimators.flow_inertial import FlowFusion
from estimators.heading import correct_axis, correct_azimuth
from estimators.horizon_fusion import HorizonFusion
from estimators.lever_arms import antenna, pad_in_world, ranger
from estimators.position import A_E, D_E, PositionFilter, PositionNoise
from estimators.replay import AHEAD
from estimators.vision.sighting import PadPrediction
from flightlog.equipment import CameraSpec, Equipment
from flightlog.rotations import angles, from_vector, matrix, multiply
from flightlog.signals import (
    BaroSample,
    FlowSample,
    Frame,
    GpsSample,
    HorizonSample,
    ImuSample,
    MagSample,
    Measurement,
    PadSample,
    RotorSample,
    SonarSample,
    StateEstimate,
)

Floats = NDArray[np.float64]

BEFORE = 0.25  # [s] the filters begin so long before the first sample: late ones may be from before it
LEAST_EPOCHS, SPARE = 160, 0.4  # 0.64 s at 250 Hz; [s]
LONGEST_GAP = 60.0  # [s] an inertial sample farther ahead has a broken stamp
GRAIN = 3e-5  # [m] a picture is not better than this
CUT = 3e-3  # [m] nor one in which half of the mark is missing than this
JITTER = 5e-6  # [rad] the rotor's vibration in the attitude of a picture
SCALE = 1e-3  # [1] of the lateral distance: focal length
GROUND = 1e-3  # [m] grass and paint under the ranger
SAME_INSTANT = 1e-3  # [s]
FAULTY = 1.5e-3  # [rad/sqrt(s)] of the tilt
FAST = AttitudeGains(level=2.0, integral=0.3)  # flow or a horizon finds the tilt error within half a second
AT_REST = (0.0005, 0.005, 0.03)  # [m], [m/s], [m/s^2] a flight begins by flow alone, trimmed over its origin


def _memory_length(equipment: Equipment) -> int:
    """Epochs to remember: the latest sample, and as much again as jitter may add."""
    latencies = [sensor.latency for sensor in equipment.sensors.values()]
    latest = max(latencies + [camera.latency for camera in equipment.cameras.values()])
    needed = (latest + SPARE) * equipment.sensors["imu"].rate
    # few lengths, because each is compiled for itself
    return LEAST_EPOCHS * 2 ** max(0, math.ceil(math.log2(needed / LEAST_EPOCHS)))


class Navigator:
    """Built from the sensors as known aboard.

    What the horizons' eyes see is given out among the detections and drawn; the attitude uses it where it is told to.
    """

    def __init__(
        self, equipment: Equipment, eyes: Eyes | None = None, *, flow: bool = False, horizon: bool = False
    ) -> None:
        """Compiles what is not compiled yet, then waits for the first samples.

        `flow`: optical flow is used. It tells the way from somewhere: from where the flight begins, at rest, which is
        then the horizontal origin. `horizon`: what is seen of the horizon levels the attitude.
        """
        self._epochs = _memory_length(equipment)
        chain.compile_all(self._epochs)
        self._equipment = equipment
        self._eyes = eyes = eyes or Eyes()
        self._front_end = eyes.pad
        self._horizons = eyes.horizons
        self._gains = FAST if flow or horizon else AttitudeGains()
        self._attitude = AttitudeFilter(equipment, self._gains)
        self._period = 1.0 / equipment.sensors["imu"].rate
        self._altitude: AltitudeFilter
        self._position: PositionFilter
        self._started = False
        self._time = 0.0
        self._refused: Counter[str] = Counter()
        self._detections: list[PadSample | HorizonSample | FlowSample] = []
        self._overlays: dict[str, Sequence[Floats]] = {}
        self._correct = False  # whether something waits to act
        self._aligned = False  # whether there is an attitude
        self._waiting: list[Callable[[], None]] = []  # samples that need one
        self._moved = False  # whether an inertial sample came with this update
        sensors = equipment.sensors
        self._sonar = sensors.get("sonar")
        self._gps = sensors.get("gps")
        self._baro = sensors.get("baro")
        self._down = equipment.cameras.get("down")
        self._flow = FlowFusion(self._down) if flow and self._down is not None else None
        self._level = HorizonFusion(dips=equipment.horizon_dips) if horizon else None
        self._horizon_time = -math.inf  # [s] of the last picture with a horizon
        self._handlers: Mapping[type, Callable[[Any], None]] = {
            ImuSample: self._take_imu,
            MagSample: self._take_mag,
            BaroSample: self._take_baro,
            GpsSample: self._take_gps,
            SonarSample: self._take_sonar,
            RotorSample: self._take_rotor,
            PadSample: self._take_pad,
            HorizonSample: self._take_horizon,
            FlowSample: self._take_flow,
            Frame: self._take_frame,
        }

    @property
    def detections(self) -> Sequence[PadSample | HorizonSample | FlowSample]:
        """What the front ends saw in the pictures of the last update."""
        return self._detections

    @property
    def overlays(self) -> Mapping[str, Sequence[Floats]]:
        """By camera, lines (N, 2) [px] to draw over its last picture: the outline of the mark where it was found."""
        return self._overlays

    @property
    def rejected(self) -> Mapping[str, int]:
        """Samples by topic that were not used: not finite, too late, from the future, repeated, or beyond the gate."""
        counts = Counter(self._refused)
        if self._started:
            high, side = self._altitude.kalman.rejected, self._position.kalman.rejected
            counts["baro"] += int(high[altitude.BARO])
            counts["sonar"] += int(high[altitude.SONAR])
            counts["gps"] += int(high[[altitude.GPS, altitude.GPS_CLIMB]].sum() + side[: position.VISION_1].sum())
            counts["pad"] += int(high[altitude.VISION] + side[position.VISION_1 : position.FLOW_E].sum())
            counts["flow"] += int(side[position.FLOW_E : position.KEY_E].sum())
            counts["horizon"] += int(side[[position.HORIZON_AHEAD, position.HORIZON_ASIDE]].sum())
        return MappingProxyType({topic: count for topic, count in counts.items() if count})

    @property
    def filters(self) -> tuple[AttitudeFilter, AltitudeFilter, PositionFilter]:
        """The filters themselves, for whoever judges them; the last two exist from the first update on."""
        return self._attitude, self._altitude, self._position

    @property
    def aligned(self) -> bool:
        """Whether there is an attitude."""
        return self._aligned

    @property
    def mode(self) -> altitude.Mode:
        """Which set of height measurements is in use."""
        return self._altitude.mode

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """Take in what arrived since the last call, one period of the inertial sensor ago; the state now."""
        if not self._started:
            self._start(measurements)
        self._detections = []
        self._moved = False
        handlers = self._handlers
        for measurement in measurements:
            handlers[type(measurement)](measurement)
        if not self._aligned and self._attitude.memory["aligned"][0]:
            self._aligned = True
            if self._flow is not None:
                self._position.begin(self._time, *AT_REST)
                self._correct = True
            for action in self._waiting:
                action()
            self._waiting.clear()
        if not self._moved:
            self._time += self._period
            self._step(self._time, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)
        elif self._correct:
            self._altitude.kalman.refresh()
            self._position.kalman.refresh()
        self._correct = False
        return self._estimate()

    def _start(self, measurements: Sequence[Measurement]) -> None:
        stamps = [m.t for m in measurements if isinstance(m, ImuSample) and math.isfinite(m.t)]
        if not stamps:
            late = [getattr(m, "t_arrival", m.t) for m in measurements]
            stamps = [max([t for t in late if math.isfinite(t)], default=0.0)]
        t = stamps[0] - BEFORE
        self._altitude = AltitudeFilter(AltitudeNoise.of(self._equipment), t, self._epochs)
        noise, flow = PositionNoise.of(self._equipment), self._flow is not None
        if self._level is not None:  # what is held by the horizon may have gyroscopes far worse than theirs
            noise = replace(noise, tilt_walk=FAULTY)
        self._position = PositionFilter(noise, t, self._epochs, flow=flow, integral=self._gains.integral)
        self._time = stamps[0] - self._period
        self._attitude.memory["t"] = self._time
        self._started = True

    def _step(self, t: float, fx: float, fy: float, fz: float, wx: float, wy: float, wz: float, present: bool) -> None:
        memories = self._attitude.memory, self._altitude.kalman.memory, self._position.kalman.memory
        chain.step(*memories, t, fx, fy, fz, wx, wy, wz, present)

    def _estimate(self) -> StateEstimate:
        row = chain.report(self._attitude.memory, self._altitude.kalman.memory, self._position.kalman.memory)
        _, _, up, *_ = numbers = row.tolist()
        tail = numbers[25:]
        high = self._altitude
        high.height, high.deviation, high.height_time = up, numbers[18], tail[3] - tail[6]
        if self._flow is not None:
            # a hover by flow feels a milliradian: what is known of the tilt error is not waited for
            d_e, d_n = self._position.kalman.last["x"][D_E:A_E].tolist()
            row[9:13] = multiply(from_vector(np.array([d_n, -d_e, 0.0])), row[9:13])
            tail[0:3] = angles(row[9:13])
        return StateEstimate(
            tail[3], row[0:3], row[3:6], row[6:9], row[9:13], tail[0], tail[1], tail[2], row[13:16], tail[4],
            row[16:19], row[19:22], row[22:25], tail[5], tail[6],
        )  # fmt: skip

    def _waits(self, action: Callable[[], None]) -> bool:
        """Put off what needs an attitude until there is one; False when there is."""
        if self._aligned:
            return False
        self._waiting.append(action)
        return True

    def _refuse(self, topic: str) -> None:
        self._refused[topic] += 1

    def _take_imu(self, s: ImuSample) -> None:
        t, fx, fy, fz, wx, wy, wz = s
        ahead = t - self._time
        if not (math.isfinite(fx + fy + fz + wx + wy + wz) and 1e-6 < ahead < LONGEST_GAP):
            self._refuse("imu")
            return
        self._step(t, fx, fy, fz, wx, wy, wz, True)
        self._time = t
        self._moved = True

    def _take_mag(self, s: MagSample) -> None:
        t, mx, my, mz = s
        if not math.isfinite(t + mx + my + mz) or t > self._time + AHEAD:
            self._refuse("mag")
            return
        correct_azimuth(self._attitude.memory, t, mx, my, mz)

    def _take_rotor(self, s: RotorSample) -> None:
        if not math.isfinite(s.t + s.speed) or s.speed < 0.0:
            self._refuse("rotor")
            return
        self._attitude.memory["rotor_speed"] = s.speed

    def _take_baro(self, s: BaroSample) -> None:
        device = self._baro
        if device is None or not math.isfinite(s.altitude):
            self._refuse("baro")
            return
        x, y, z = device.position
        q0, q1, q2, q3 = self._attitude.memory["q"][0].tolist()
        port = 2.0 * (q1 * q3 - q0 * q2) * x + 2.0 * (q2 * q3 + q0 * q1) * y + (1.0 - 2.0 * (q1 * q1 + q2 * q2)) * z
        # a first-order lag shows what was `lag` ago
        if not self._altitude.baro(s.t - device["lag"], s.altitude - port):
            self._refuse("baro")
        self._correct = True

    def _take_gps(self, s: GpsSample) -> None:
        device = self._gps
        if device is None or not s.valid or not math.isfinite(s.t + s.e + s.n + s.u):
            self._refuse("gps")
            return
        if self._waits(lambda: self._take_gps(s)):
            return
        dilution = s.hdop / device["hdop"] if math.isfinite(s.hdop) and s.hdop > 0.0 else 1.0
        e, n, u, ve, vn, vu = antenna(
            self._attitude.memory, s.t, s.e, s.n, s.u, s.ve, s.vn, s.vu, device.position
        )  # fmt: skip
        taken = self._position.gps(s.t, e, n, ve, vn, dilution)
        if not (self._altitude.gps(s.t, u, vu, dilution) and taken):
            self._refuse("gps")
        self._correct = True

    def _take_sonar(self, s: SonarSample) -> None:
        device = self._sonar
        if device is None or not math.isfinite(s.t) or (s.valid and not math.isfinite(s.range)):
            self._refuse("sonar")
            return
        distance = s.range if s.valid else math.nan
        height, lever = ranger(self._attitude.memory, distance, device.position, device["beam_half_angle"])
        # rounding to its resolution is evenly distributed; the scale's error is a state of the filter
        variance = (device["noise_share"] * distance) ** 2 + device["resolution"] ** 2 / 12.0 + GROUND**2
        if not self._altitude.sonar(s.t, height, variance if s.valid else 1.0, lever):
            self._refuse("sonar")
        self._correct = True

    def _take_pad(self, s: PadSample) -> None:
        if not math.isfinite(s.std_x + s.std_y + s.std_z):
            self._refuse("pad")
            return
        self._see(s, np.diag([s.std_x**2, s.std_y**2, s.std_z**2]))

    def _take_horizon(self, s: HorizonSample) -> None:
        if self._level is None or self._waits(lambda: self._take_horizon(s)):
            return
        if s.t > self._time + AHEAD or not self._level.take(s, self._attitude, self._altitude, self._position):
            self._refuse("horizon")
        self._correct = True

    def _take_flow(self, s: FlowSample) -> None:
        if self._flow is None or self._waits(lambda: self._take_flow(s)):
            return
        if s.t > self._time + AHEAD or not self._flow.take(s, self._attitude, self._altitude, self._position):
            self._refuse("flow")
        self._correct = True

    def _take_frame(self, frame: Frame) -> None:
        if frame.camera in self._horizons:
            self._look_ahead(frame)
            return
        if frame.camera == "down" and self._eyes.flow is not None:
            self._look_down(frame, self._eyes.flow)
        front_end, camera = self._front_end, self._down
        if frame.camera != "down" or front_end is None or camera is None or not self._aligned:
            return
        if not math.isfinite(frame.t) or frame.t > self._time + AHEAD:
            self._refuse("frames")
            return
        q = self._attitude.at(frame.t)
        seen = front_end.see(frame.image, q, self._expect(frame.t, q, camera))
        self._overlays["down"] = () if seen is None else (seen.overlay,)
        if seen is None:
            return
        sample = seen.sample(frame)
        self._detections.append(sample)
        self._see(sample, np.ascontiguousarray(seen.covariance[:3, :3]))
        if seen.level is not None:
            # the pad is level: what its normal is off by in the world is the tilt error of the attitude
            turn = matrix(q) @ camera.mount.axes
            d_e, d_n, _ = (turn @ seen.level.up).tolist()
            c = turn @ seen.level.covariance @ turn.T
            self._position.tilt(frame.t, d_e, d_n, c[0, 0], c[0, 1], c[1, 1])

    def _look_down(self, frame: Frame, eye: FlowEye) -> None:
        """The ground's motion in the down camera's picture."""
        sample = eye.see(frame)
        self._overlays["down"] = eye.lines
        if sample is not None:
            self._detections.append(sample)
            self._take_flow(sample)

    def _look_ahead(self, frame: Frame) -> None:
        """The horizon in a forward camera's picture."""
        seen = self._horizons[frame.camera].see(frame.image, frame.t)
        self._overlays[frame.camera] = () if seen is None else (np.array(seen.line),)
        # one topic, one sample an instant: what another camera sees in the same instant is drawn only
        if seen is None or frame.t < self._horizon_time + SAME_INSTANT:
            return
        self._horizon_time = frame.t
        sample = HorizonSample(
            frame.t, frame.t_arrival, seen.roll, seen.pitch, seen.std_roll, seen.std_pitch, True
        )  # fmt: skip
        self._detections.append(sample)
        self._take_horizon(sample)

    def _see(self, s: PadSample, covariance: Floats) -> None:
        """One sighting with its covariance (3, 3) in camera axes [m^2]."""
        if self._waits(lambda: self._fuse(s, covariance)):
            return
        self._fuse(s, covariance)

    def _fuse(self, s: PadSample, covariance: Floats) -> None:
        camera = self._down
        if camera is None or not math.isfinite(s.t + s.x + s.y + s.z) or s.z <= 0.0 or s.t > self._time + AHEAD:
            self._refuse("pad")
            return
        memory = self._attitude.memory
        grain = math.hypot(GRAIN, CUT * min(1.0, 2.0 * max(0.0, 1.0 - s.quality)))
        e, n, u, c_ee, c_en, c_nn, c_uu = pad_in_world(
            memory, s.t, s.x, s.y, s.z, covariance, camera.mount.position, camera.mount.axes, grain, JITTER, SCALE
        )
        above = self._altitude.vision(s.t, u, c_uu)
        if not (self._position.vision(s.t, e, n, c_ee, c_en, c_nn, u) and above):
            self._refuse("pad")
        elif math.isfinite(s.angle + s.std_angle) and s.std_angle > 0.0:
            correct_axis(memory, s.t, s.angle, s.std_angle)
        self._correct = True

    def _expect(self, t: float, q: Floats, camera: CameraSpec) -> PadPrediction | None:
        std_heading = math.sqrt(float(self._attitude.memory["variance_heading"][0]))
        return expect_pad(t, q, std_heading, self._altitude, self._position, camera)

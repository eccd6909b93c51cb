"""The navigator of Zeng and Jiang as published: integer block matching between consecutive pictures, complementary
filters. What the paper leaves open, height and heading, comes from Helideck's own filters.
"""

import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimators.complementary import ComplementaryGains, FlowVelocity, PlumbLineAttitude
from estimators.eyes import Eyes
from estimators.navigator import Navigator
from estimators.replay import AHEAD
from flightlog.equipment import CameraSpec, Equipment
from flightlog.rotations import angles, matrix, quaternion
from flightlog.signals import FlowSample, Frame, GpsSample, ImuSample, Measurement, PadSample, StateEstimate

Floats = NDArray[np.float64]

MEMORY = 256  # inertial samples kept for late pictures: 1 s
SILENCE = 0.5  # [s] without flow the inertial sensors are alone


def velocity_over_ground(u: float, v: float, dt: float, rates: Floats, height: float) -> tuple[float, float]:
    """Velocity (x, y) [m/s] of a camera that looks down, in its axes: equations 2 and 3 in the picture's middle.

    u, v [rad]: image motion over `dt` [s]; rates (3,) [rad/s] of the camera, in its axes, mean of that time; height
    [m] above the ground. The signs are those of the perspective equations: the picture moves against the camera.
    """
    return -height * (u / dt + float(rates[1])), -height * (v / dt - float(rates[0]))


class ZengNavigator:
    """Attitude, horizontal position and velocity as published; the rest is `Navigator`'s."""

    def __init__(self, equipment: Equipment, eyes: Eyes, gains: ComplementaryGains | None = None) -> None:
        """Begins at rest over the origin."""
        self._rest = Navigator(equipment)
        self._eyes = eyes
        self._gains = gains = gains or ComplementaryGains()
        self._camera: CameraSpec | None = equipment.cameras.get("down")
        self._attitude: PlumbLineAttitude | None = None
        self._ground = FlowVelocity(gains)
        self.inertial = FlowVelocity(gains)  # the same without flow
        self._rates: deque[tuple[float, Floats]] = deque(maxlen=MEMORY)
        self._time = -math.inf  # [s] of the last inertial sample
        self._seen = -math.inf  # [s] arrival of the last flow
        self._last: FlowSample | None = None
        self._detections: list[FlowSample] = []
        self._refused: Counter[str] = Counter()
        self._height = self._heading = math.nan
        self._turn = np.array([1.0, 0.0, 0.0, 0.0])  # wxyz, roll and pitch as published

    @property
    def detections(self) -> Sequence[Measurement]:
        """Flow in the pictures of the last update."""
        return self._detections

    @property
    def overlays(self) -> Mapping[str, Sequence[Floats]]:
        """None."""
        return {}

    @property
    def rejected(self) -> Mapping[str, int]:
        """Samples by topic that were not used."""
        return Counter(self._rest.rejected) + self._refused

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """What has arrived since the last call; the state now."""
        self._detections = []
        mine = (FlowSample, Frame, GpsSample, PadSample)
        state = self._rest.update([m for m in measurements if not isinstance(m, mine)])
        self._height, self._heading = float(state.position[2]), state.heading
        if self._attitude is None and self._rest.aligned:
            self._attitude, self._time = PlumbLineAttitude(self._gains, state.quaternion), state.t
            self._turn = state.quaternion
        for m in measurements:
            if isinstance(m, ImuSample):
                self._take_imu(m)
            elif isinstance(m, FlowSample):
                self._take_flow(m)
            elif isinstance(m, Frame) and m.camera == "down" and self._eyes.flow is not None:
                sample = self._eyes.flow.see(m)
                if sample is not None:
                    self._detections.append(sample)
                    self._take_flow(sample)
        return self._estimate(state)

    def _take_imu(self, s: ImuSample) -> None:
        dt = s.t - self._time
        if self._attitude is None or not (dt > 1e-6 and math.isfinite(sum(s))):
            return
        force, rates = np.array([s.fx, s.fy, s.fz]), np.array([s.wx, s.wy, s.wz])
        self._attitude.step(force, rates, dt)
        self._rates.append((s.t, rates))
        self._time = s.t
        if s.t - self._seen > SILENCE:
            self._ground.lost()
        roll, pitch, _ = angles(self._attitude.quaternion)
        self._turn = quaternion(roll, pitch, self._heading)
        acceleration = (matrix(self._turn) @ force)[:2]
        self._ground.step(acceleration, dt)
        self.inertial.step(acceleration, dt)

    def _since_last(self, s: FlowSample) -> FlowSample:
        """Flow since a key frame, as a log may hold it, taken as flow since the sample before."""
        last, self._last = self._last, s
        if last is None or not last.t > s.t - s.dt + 1e-6 or abs((s.t - s.dt) - (last.t - last.dt)) > 1e-6:
            return s
        return s._replace(dt=s.t - last.t, u=s.u - last.u, v=s.v - last.v)

    def _take_flow(self, s: FlowSample) -> None:
        camera, s = self._camera, self._since_last(s)
        if camera is None or self._attitude is None:
            return
        turning = [w for t, w in self._rates if s.t - s.dt < t <= s.t]
        if not (s.dt > 0.0 and math.isfinite(s.u + s.v)) or not turning or s.t > self._time + AHEAD:
            self._refused["flow"] += 1
            return
        rates = camera.mount.axes.T @ np.mean(turning, axis=0)
        above = self._height + float(camera.mount.position[2])
        vx, vy = velocity_over_ground(s.u, s.v, s.dt, rates, above)
        turn = matrix(self._turn) @ camera.mount.axes
        self._ground.flow((turn @ np.array([vx, vy, 0.0]))[:2], s.dt)
        self._seen = self._time

    def _estimate(self, state: StateEstimate) -> StateEstimate:
        """Helideck's own state with what the paper covers replaced; what has no covariance says so."""
        roll, pitch, heading = angles(self._turn)
        unknown = np.array([math.nan, math.nan, 0.0])
        return replace(
            state,
            position=np.append(self._ground.position, state.position[2]),
            velocity=np.append(self._ground.velocity, state.velocity[2]),
            quaternion=self._turn,
            roll=roll,
            pitch=pitch,
            heading=heading,
            std_position=state.std_position + unknown,
            std_velocity=state.std_velocity + unknown,
            std_attitude=np.array([math.nan, math.nan, float(state.std_attitude[2])]),
        )

"""Wu 2019's estimator in flight: position, velocity and heading by its landmark and filter, the rest by Helideck's own.

Roll, pitch, rates and rotor speed are those of Helideck's navigator, which here sees no mark. As published, roll and
pitch are zero where a picture's position is turned into the world, and a picture is of the moment of its arrival.
`exact` uses the attitude of the picture's time, which is what the paper's own figures need (docs/papers.md).

The paper's filter has nothing to go on when the landmark is lost, and its Ts leave the picture 2.5 m above it. For
`COAST` seconds it integrates the acceleration; then Helideck's own movement is added to where it was.
"""

import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimators.eyes import Eyes
from estimators.navigator import Navigator
from estimators.wu_ekf import Reading, WuFilter, WuNoise
from flightlog.constants import GRAVITY
from flightlog.equipment import CameraSpec, Equipment
from flightlog.rotations import matrix, multiply, quaternion, turn, wrap
from flightlog.signals import Frame, ImuSample, Measurement, PadSample, StateEstimate

Floats = NDArray[np.float64]

COAST = 1.0  # [s] on the acceleration alone
HEADING_SHARE = 0.1  # of a picture's heading that is taken over: 0.4 s at 25 Hz
HISTORY = 400  # attitudes kept, of one update each
LONGEST_STEP = 0.1  # [s] an inertial gap beyond this is not integrated at once


class WuNavigator:
    """Built from the sensors as known aboard."""

    def __init__(
        self,
        equipment: Equipment,
        eyes: Eyes,
        *,
        exact: bool = False,
        reading: Reading = "corrected",
        noise: WuNoise | None = None,
    ) -> None:
        """eyes.pad: a `WuFrontEnd` of the same `exact`."""
        self._inner = Navigator(equipment, Eyes(horizons=eyes.horizons))
        self._front_end = eyes.pad
        self._camera: CameraSpec | None = equipment.cameras.get("down")
        self._exact, self._reading, self._noise = exact, reading, noise or WuNoise()
        self._filter: WuFilter | None = None
        self._clock = math.nan  # [s] of the last inertial sample
        self._seen = -math.inf  # [s] time of the last picture used
        self._turned = 0.0  # [rad] heading by vision less heading by the inner navigator
        self._moved: Floats | None = None  # (3,) [m] ours less the inner navigator's, while the landmark is lost
        self._attitudes: deque[tuple[float, Floats]] = deque(maxlen=HISTORY)
        self._refused: Counter[str] = Counter()
        self._detections: list[PadSample] = []
        self._overlays: dict[str, Sequence[Floats]] = {}

    @property
    def detections(self) -> Sequence[Measurement]:
        """What vision found in the pictures of the last update."""
        return [*self._inner.detections, *self._detections]

    @property
    def overlays(self) -> Mapping[str, Sequence[Floats]]:
        """By camera, lines (N, 2) [px] to draw over its last picture."""
        return {**self._inner.overlays, **self._overlays}

    @property
    def rejected(self) -> Mapping[str, int]:
        """Samples by topic that were not used."""
        return dict(Counter(self._inner.rejected) + self._refused)

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """Take in what arrived since the last call; the state now."""
        self._detections = []
        pads = [m for m in measurements if isinstance(m, PadSample) or (isinstance(m, Frame) and m.camera == "down")]
        state = self._inner.update([m for m in measurements if not any(m is pad for pad in pads)])
        self._attitudes.append((state.t, state.quaternion))
        for sample in measurements:
            if isinstance(sample, ImuSample):
                self._integrate(sample, state)
        for pad in pads:
            seen = self._look(pad, state) if isinstance(pad, Frame) else pad
            if seen is not None:
                self._fuse(seen, state)
        return self._answer(state)

    def _integrate(self, s: ImuSample, state: StateEstimate) -> None:
        dt = s.t - self._clock
        force = np.array([s.fx, s.fy, s.fz])
        if not (np.all(np.isfinite(force)) and (math.isnan(dt) or dt > 0.0)):
            return
        self._clock = s.t
        if self._filter is not None and dt < LONGEST_STEP:
            self._filter.predict(matrix(state.quaternion) @ force - [0.0, 0.0, GRAVITY], dt)

    def _look(self, frame: Frame, state: StateEstimate) -> PadSample | None:
        if self._front_end is None or not math.isfinite(state.heading):
            return None
        seen = self._front_end.see(frame.image, self._attitude_at(frame.t), None)
        self._overlays["down"] = () if seen is None else (seen.overlay,)
        if seen is None:
            return None
        sample = seen.sample(frame)
        self._detections.append(sample)
        return sample

    def _attitude_at(self, t: float) -> Floats:
        """The attitude (4,) remembered nearest to a time [s]."""
        return min(self._attitudes, key=lambda item: abs(item[0] - t))[1]

    def _fuse(self, s: PadSample, state: StateEstimate) -> None:
        camera = self._camera
        if camera is None or not math.isfinite(s.t + s.x + s.y + s.z) or s.z <= 0.0:
            self._refused["pad"] += 1
            return
        # the mark's axis points north, so the camera's heading is minus the angle; the H's way round is the inner's
        if math.isfinite(s.angle):
            error = wrap(-s.angle - state.heading - self._turned)
            if s.source != "model" or abs(error) < 0.5 * math.pi:
                self._turned = wrap(self._turned + HEADING_SHARE * error)
        heading = state.heading + self._turned
        attitude = quaternion(0.0, 0.0, heading)
        if self._exact:
            past = self._attitude_at(s.t)
            half = -0.5 * self._turned  # heading is clockwise
            about_up = np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
            attitude = multiply(about_up, past)
        there = -matrix(attitude) @ (camera.mount.position + camera.mount.axes @ [s.x, s.y, s.z])
        if self._filter is None or self._moved is not None:
            self._filter = WuFilter(there, state.velocity, noise=self._noise, reading=self._reading)
            self._moved = None
        self._filter.correct(there)
        self._seen = s.t

    def _answer(self, state: StateEstimate) -> StateEstimate:
        if self._filter is None:
            return state
        age = state.t - self._seen
        heading = turn(state.heading + self._turned)
        attitude = quaternion(state.roll, state.pitch, heading)
        if age > COAST and self._moved is None:
            self._moved = self._filter.x[:3] - state.position
        if self._moved is not None:
            return replace(
                state, position=state.position + self._moved, quaternion=attitude, heading=heading, pad_age=age
            )
        std = np.sqrt(np.diag(self._filter.p))
        return replace(
            state,
            position=self._filter.x[:3].copy(),
            velocity=self._filter.x[3:].copy(),
            quaternion=attitude,
            heading=heading,
            std_position=std[:3],
            std_velocity=std[3:],
            pad_age=age,
            height_age=min(age, state.height_age),
        )

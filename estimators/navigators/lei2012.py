"""Lei et al. 2012: height by adaptive Kalman filter from barometer, GPS, vision and ultrasound; the rest Helideck's.

Variant "published": the paper's front end sees the H, its filter makes the height. The paper says nothing of horizontal
position, attitude and climb rate: those are Helideck's own. Variant "helideck": its own filter with its own front end.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimators.eyes import Eyes
from estimators.lei_akf import AkfReading, LeiFilter
from estimators.lei_sensors import BARO, GPS, VISION, LeiSensors
from estimators.navigator import Navigator
from estimators.navigators import contract
from estimators.navigators.contract import Variant
from estimators.vertical_model import RAPTOR90, VerticalModel
from estimators.vision.front_ends import horizon_eyes, pad_eye
from flightlog.equipment import Equipment
from flightlog.rotations import matrix
from flightlog.signals import BaroSample, Controls, GpsSample, Measurement, PadSample, SonarSample, StateEstimate

Floats = NDArray[np.float64]

NEEDS = ("imu", "rotor")
# R is not printed: the deviations that the paper reports of its hover (section 4.2)
IN_FLIGHT = AkfReading(sensors=LeiSensors(baro=0.369, gps=0.253, vision=0.380))
PERIOD = 0.1  # [s] of the filter's cycle: as often as the paper's camera might see


def look(equipment: Equipment, variant: Variant) -> Eyes:
    """The pad below, by the variant's front end, and the horizon ahead."""
    return Eyes(pad=pad_eye(equipment, variant), horizons=horizon_eyes(equipment, variant))


def build(equipment: Equipment, eyes: Eyes, variant: Variant) -> contract.Navigator:
    """Lei's filter on top of Helideck's navigator, or that alone."""
    inner = Navigator(equipment, eyes)
    return inner if variant == "helideck" else LeiNavigator(equipment, inner)


class LeiNavigator:
    """Lei's height in Helideck's state."""

    def __init__(
        self,
        equipment: Equipment,
        inner: Navigator,
        reading: AkfReading | None = None,
        model: VerticalModel = RAPTOR90,
    ) -> None:
        """`inner` gives all but the height, and sees the pictures; `model` is the vehicle's equation 13."""
        self.inner = inner
        self.filter = LeiFilter(reading or IN_FLIGHT, model)
        self._equipment = equipment
        self._controls = Controls(math.nan, math.nan, math.nan, math.nan, math.nan)
        self._up: Floats = np.array([0.0, 0.0, 1.0])  # the world's up in body axes
        self._last = math.nan  # [s] of the last cycle

    @property
    def detections(self) -> Sequence[Measurement]:
        """What vision found in the pictures of the last update."""
        return self.inner.detections

    @property
    def overlays(self) -> Mapping[str, Sequence[Floats]]:
        """By camera, lines (N, 2) [px] to draw over its last picture."""
        return self.inner.overlays

    @property
    def rejected(self) -> Mapping[str, int]:
        """Samples by topic that Helideck's part did not use."""
        return self.inner.rejected

    def steer(self, controls: Controls) -> None:
        """The controls as sent from now on: the inputs of equation 13."""
        self._controls = controls

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """What has arrived since the last call; the height is Lei's as soon as a sensor has told one."""
        return self.listen(measurements, self.inner.update(measurements))

    def listen(self, measurements: Sequence[Measurement], state: StateEstimate) -> StateEstimate:
        """The same where `inner` has been asked already, and said `state`."""
        self._up = matrix(state.quaternion)[2]
        for sample in (*measurements, *self.inner.detections):
            self._hear(sample)
        if math.isnan(self._last):
            self._last = state.t
        if state.t - self._last >= PERIOD - 1e-6:
            sent = self._controls
            self.filter.cycle(state.t - self._last, sent.throttle, sent.collective, state.rotor_speed)
            self._last = state.t
        if not self.filter.begun:
            return state
        position, deviations = state.position.copy(), state.std_position.copy()
        # between cycles the height goes on as the prediction has it
        position[2] = self.filter.height + (state.t - self._last) * self.filter.climb
        deviations[2] = self.filter.deviation
        return replace(state, position=position, std_position=deviations)

    def _hear(self, sample: Measurement) -> None:
        """Hand the height that a sample means to the filter; from the sensor's mount to the body origin."""
        sensors = self._equipment.sensors
        if isinstance(sample, BaroSample) and "baro" in sensors:
            if math.isfinite(sample.altitude):
                self.filter.hear(BARO, sample.altitude - self._lever(sensors["baro"].position))
        elif isinstance(sample, GpsSample) and "gps" in sensors:
            if sample.valid and math.isfinite(sample.u):
                self.filter.hear(GPS, sample.u - self._lever(sensors["gps"].position))
        elif isinstance(sample, SonarSample) and "sonar" in sensors:
            distance = sample.range if sample.valid else math.nan
            self.filter.echo(distance, distance - self._lever(sensors["sonar"].position))
        elif isinstance(sample, PadSample) and (camera := self._equipment.cameras.get("down")) is not None:
            # equation 7 is the front end's; what it says is as far below as the mark's centre lies
            below = -self._lever(camera.mount.axes @ np.array([sample.x, sample.y, sample.z]))
            if math.isfinite(below):
                self.filter.hear(VISION, below - self._lever(camera.mount.position))

    def _lever(self, mount: Floats) -> float:
        """How far a place in body axes lies above the body origin [m]."""
        return float(self._up @ mount)

"""What a flight was like: the figures of `land --json`, from the truth that the estimators never saw."""

import math
from array import array
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.equipment import Equipment
from flightlog.replay_series import Series, heights
from flightlog.rotations import angles
from flightlog.signals import BaroSample, GpsSample, Measurement, PadSample, SonarSample, StateEstimate
from flightlog.tables import table
from sim.world import World

Floats = NDArray[np.float64]
LATE_HEIGHT = 2.0  # [m] below this the landing is late: Lei 2012 figure 10
DESCENT = "descend"  # the pilot's phase
_HEIGHTS: dict[type, str] = {BaroSample: "baro", GpsSample: "gps", SonarSample: "sonar", PadSample: "pad"}


@dataclass(frozen=True)
class Spread:
    """Absolute errors' mean and maximum, signed error's standard deviation [m]."""

    mean: float
    max: float
    std: float

    @classmethod
    def of(cls, errors: Floats) -> "Spread | None":
        """None where there is nothing to judge."""
        errors = errors[np.isfinite(errors)]
        if not len(errors):
            return None
        return cls(float(np.abs(errors).mean()), float(np.abs(errors).max()), float(errors.std()))


@dataclass(frozen=True)
class Touchdown:
    """First contact of the skids."""

    t: float
    east: float  # [m] body origin from the pad's centre
    north: float
    sink: float  # [m/s] down positive
    drift: float  # [m/s] horizontal


@dataclass(frozen=True)
class Summary:
    """All figures of a flight; None where there was nothing to measure."""

    success: bool
    landed: bool
    reason: str
    touchdown_offset_m: float | None
    touchdown_east_m: float | None
    touchdown_north_m: float | None
    touchdown_sink_m_s: float | None
    touchdown_drift_m_s: float | None
    late_speed_max_m_s: float | None
    max_roll_deg: float | None
    max_pitch_deg: float | None
    fused_height_mean_error_m: float | None
    fused_height_max_error_m: float | None
    fused_height_std_m: float | None
    sensor_height_error_m: dict[str, dict[str, float] | None]
    duration_s: float


class Observer:
    """Watches a flight and sums it up; keeps a row of truth per step of the loop, and the samples that tell heights."""

    def __init__(self, world: World, equipment: Equipment, hand_over: float) -> None:
        """hand_over [s]: when the pilot takes over; errors count from then on."""
        self._equipment = equipment
        self._hand_over = hand_over
        self._truth = array("d")  # rows of t, e, n, u, ve, vn, vu, roll, pitch
        self._fused = array("d")  # rows of t, u, roll, pitch, heading
        self._samples: dict[str, list[tuple[Any, ...]]] = {topic: [] for topic in _HEIGHTS.values()}
        self._left_point: float | None = None
        self.touchdown: Touchdown | None = None
        self._before = world.truth.velocity.tolist()

    def phase_changed(self, t: float, phase: str) -> None:
        """The pilot says what it does from now on; with the first descent it leaves P1."""
        if self._left_point is None and phase.startswith(DESCENT):
            self._left_point = t

    def strayed(self, point: Sequence[float]) -> float:
        """Largest distance [m] from a point, once the vehicle has been within half a metre of it."""
        if not self._truth:
            return math.inf
        distance = np.linalg.norm(np.array(self._truth).reshape(-1, 9)[:, 1:4] - np.asarray(point), axis=1)
        near = np.flatnonzero(distance < 0.5)
        return float(distance[near[0] :].max()) if len(near) else float(distance.min())

    def watch(
        self, world: World, state: StateEstimate, measurements: Sequence[Measurement], detections: Sequence[Measurement]
    ) -> None:
        """One step of the loop."""
        truth = world.truth
        e, n, u = truth.position.tolist()
        velocity = truth.velocity.tolist()
        roll, pitch, _ = angles(truth.quaternion)
        self._truth.extend((truth.t, e, n, u, *velocity, roll, pitch))
        self._fused.extend((state.t, float(state.position[2]), state.roll, state.pitch, state.heading))
        for sample in (*measurements, *detections):
            topic = _HEIGHTS.get(type(sample))
            if topic is not None:
                self._samples[topic].append(sample)  # type: ignore[arg-type]
        if self.touchdown is None and world.contact.count:
            # the velocity of the step before: contact has already taken this one's
            ve, vn, vu = self._before
            self.touchdown = Touchdown(truth.t, e, n, -vu, math.hypot(ve, vn))
        self._before = velocity

    def _sensor_heights(self) -> dict[str, Series]:
        """Height of the body origin by each sensor alone."""
        measured = {topic: table("measured", topic, rows) for topic, rows in self._samples.items() if rows}
        fused = np.array(self._fused).reshape(-1, 5).tolist()
        measured["estimate"] = table("measured", "estimate", fused, ("t", "u", "roll", "pitch", "heading"))
        return heights(measured, {}, self._equipment)

    def summary(self, *, landed: bool, success: bool, reason: str) -> Summary:
        """Sum up; judged from hand-over to first contact."""
        truth = np.array(self._truth).reshape(-1, 9)
        end = self.touchdown.t if self.touchdown else math.inf
        flown = (truth[:, 0] >= self._hand_over) & (truth[:, 0] < end)
        t, u = truth[flown, 0], truth[flown, 3]
        errors = np.array(self._fused).reshape(-1, 5)[flown, 1] - u
        descent = flown & (truth[:, 0] >= (self._left_point if self._left_point is not None else 0.0))
        late = descent & (truth[:, 3] - self._equipment.skid_height < LATE_HEIGHT)
        fused = Spread.of(errors)
        alone: dict[str, dict[str, float] | None] = {"baro": None, "gps": None, "vision": None, "sonar": None}
        found = self._sensor_heights()
        reach = self._equipment.sensors["sonar"]["greatest_range"] if "sonar" in self._equipment.sensors else math.inf
        for name in alone:
            if name not in found or not len(t):
                continue
            series = found[name]
            true = np.interp(series.t, t, u)
            counts = (series.t >= self._hand_over) & (series.t < end) & ((name != "sonar") | (true < reach))
            spread = Spread.of(series.values[counts] - true[counts])
            alone[name] = asdict(spread) if spread else None
        down = self.touchdown

        def largest(values: Floats) -> float | None:
            return float(values.max()) if len(values) else None

        return Summary(
            success=success,
            landed=landed,
            reason=reason,
            touchdown_offset_m=math.hypot(down.east, down.north) if down else None,
            touchdown_east_m=down.east if down else None,
            touchdown_north_m=down.north if down else None,
            touchdown_sink_m_s=down.sink if down else None,
            touchdown_drift_m_s=down.drift if down else None,
            late_speed_max_m_s=largest(np.hypot(truth[late, 4], truth[late, 5])),
            max_roll_deg=largest(np.degrees(np.abs(truth[descent, 7]))),
            max_pitch_deg=largest(np.degrees(np.abs(truth[descent, 8]))),
            fused_height_mean_error_m=fused.mean if fused else None,
            fused_height_max_error_m=fused.max if fused else None,
            fused_height_std_m=fused.std if fused else None,
            sensor_height_error_m=alone,
            duration_s=float(truth[-1, 0]) if len(truth) else 0.0,
        )

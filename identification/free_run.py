"""Free runs: the model along a log from its inputs alone, restarted from the measured state now and then."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from identification.course import Course, causal_states
from sim.rig import Rig
from sim.rig_motion import Moving

Floats = NDArray[np.float64]

SPAN = 0.3  # [s] of the measured past from which a run's first state is taken


@dataclass(frozen=True)
class Channel:
    """How far free runs went astray in one channel."""

    channel: str
    unit: str
    horizon_s: float
    rmse: float  # over all rows of all runs
    max: float
    runs: int
    hold_last_rmse: float  # of the measured value at the restart, kept


@dataclass(frozen=True, eq=False)
class Runs:
    """Free runs of one stretch."""

    rows: NDArray[np.int64]  # (K,) at which each starts
    predicted: Floats  # (K, T, J) [rad]
    measured: Floats  # (K, T, J) [rad]

    @property
    def errors(self) -> Floats:
        """Predicted less measured (K, T, J)."""
        return self.predicted - self.measured

    @property
    def held(self) -> Floats:
        """The same for the last measured value (K, T, J)."""
        return self.measured[:, :1] - self.measured


def starts(course: Course, horizon: float, every: float) -> tuple[NDArray[np.int64], int]:
    """Rows at which whole runs of `horizon` [s] begin, `every` [s]; rows of a run."""
    length = round(horizon / course.dt)
    return np.arange(0, len(course.angles) - length + 1, max(1, round(every / course.dt))), length


def rig_runs(
    rig: Rig, course: Course, horizon: float, every: float, changes: Mapping[str, float] | None = None
) -> Runs:
    """Free runs of a rig."""
    rows, length = starts(course, horizon, every)
    moving = Moving(rig, course.dt, changes)
    which = rows[:, None] + np.arange(length)
    states = moving.run(causal_states(course, SPAN)[rows], moving.torques(course.inputs)[which])
    return Runs(rows, states[:, :, : len(rig.joints)], course.angles[which])


def predict(rig: Rig, stretches: Sequence[Course], horizon: float, every: float) -> list[Channel]:
    """Errors of free runs over all stretches of a log; UserError where not one run fits."""
    if not horizon > 0.0 or not every > 0.0:
        raise UserError(f"--horizon and --every must be more than 0 s (got {horizon:g}, {every:g})")
    found = [rig_runs(rig, course, horizon, every) for course in stretches]
    if not sum(len(runs.rows) for runs in found):
        longest = max(len(course.angles) * course.dt for course in stretches)
        raise UserError(f"{stretches[0].name}: longest stretch is {longest:g} s; no run of {horizon:g} s fits")
    errors = np.concatenate([runs.errors for runs in found])
    held = np.concatenate([runs.held for runs in found])
    return [
        Channel(
            channel=f"joints.{joint}",
            unit="rad",
            horizon_s=horizon,
            rmse=_rms(errors[:, :, j]),
            max=float(np.abs(errors[:, :, j]).max()),
            runs=len(errors),
            hold_last_rmse=_rms(held[:, :, j]),
        )
        for j, joint in enumerate(rig.joints)
    ]


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))

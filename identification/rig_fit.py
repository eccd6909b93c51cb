"""A rig's numbers fitted to a log: many short free runs, each from the measured state, with priors.

Short runs (multiple shooting) rather than one long one: dry friction makes the end of a long run a matter of chance,
and a parameter that happens to hit it well is worth nothing on the next log. Numbers that cannot change sign are
fitted by their logarithm.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from identification.course import Course, causal_states
from identification.free_run import SPAN, starts
from sim.rig import Rig
from sim.rig_motion import Moving

Floats = NDArray[np.float64]

INDEPENDENT = 0.5  # [s] between rows of a run that count as one observation each
SAMPLED = 0.1  # [s] between rows that are looked at
ROUNDS = 20


@dataclass(frozen=True)
class Free:
    """A number to be fitted, with its prior: normal about `centre`, or in the logarithm where `log`."""

    key: str
    centre: float
    width: float  # one standard deviation; of the logarithm where `log`
    log: bool = False  # keeps the sign of `centre`

    def value(self, x: float) -> float:
        """The number at x, which is 0 at the prior's centre and counts in widths."""
        step = x * self.width
        return float(self.centre * np.exp(step)) if self.log else self.centre + step

    def slope(self, x: float) -> float:
        """Change of the number per x."""
        return self.width * (self.value(x) if self.log else 1.0)


@dataclass(frozen=True, eq=False)
class RigFit:
    """The most probable values, and what is known of them."""

    values: Mapping[str, float]
    std: Mapping[str, float]
    covariance: Floats  # in the order of `values`
    cost: float  # half the sum of squares, prior included


@dataclass(frozen=True)
class Weighing:
    """What free runs are compared with, and how hard."""

    horizon: float = 2.5  # [s]
    every: float = 1.25  # [s]
    spread: Mapping[str, float] | float = 0.2  # [rad] that a good model's runs may be off, by joint


def fit_rig(
    rig: Rig, stretches: Sequence[Course], free: Sequence[Free], weighing: Weighing | None = None,
    fixed: Mapping[str, float] | None = None, rounds: int = ROUNDS,
) -> RigFit:  # fmt: skip
    """The numbers `free` at their most probable values, those `fixed` put in as given, all others as in the file."""
    how = weighing or Weighing()
    spread = np.array([how.spread if isinstance(how.spread, float) else how.spread[joint] for joint in rig.joints])
    runs = []
    for course in stretches:
        rows, length = starts(course, how.horizon, how.every)
        if len(rows):
            runs.append((course, rows[:, None] + np.arange(length), causal_states(course, SPAN)[rows]))

    def residual(x: Floats) -> Floats:
        changes = dict(fixed or {}) | {f.key: f.value(float(at)) for f, at in zip(free, x, strict=True)}
        parts = [x]
        for course, which, first in runs:
            moving = Moving(rig, course.dt, changes)
            states = moving.run(first, moving.torques(course.inputs)[which])
            stride = max(1, round(SAMPLED / course.dt))
            off = (states[:, ::stride, : len(rig.joints)] - course.angles[which[:, ::stride]]) / spread
            # a run that went over the top is as wrong as one can be, not more
            parts.append((np.sqrt(stride * course.dt / INDEPENDENT) * np.clip(off, -50.0, 50.0)).ravel())
        return np.concatenate(parts)

    found = least_squares(residual, np.zeros(len(free)), diff_step=1e-3, x_scale=0.3, max_nfev=rounds)
    slopes = np.array([f.slope(float(at)) for f, at in zip(free, found.x, strict=True)])
    covariance = slopes[:, None] * np.linalg.inv(found.jac.T @ found.jac) * slopes
    return RigFit(
        values={f.key: f.value(float(at)) for f, at in zip(free, found.x, strict=True)},
        std={f.key: float(np.sqrt(covariance[i, i])) for i, f in enumerate(free)},
        covariance=covariance,
        cost=float(found.cost),
    )

"""The horizon in flight: magnetometer lost, gyroscopes wrong, GPS silent for a while, and the horizon holds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from estimators.navigators import Variant
from flightlog.rotations import matrix
from flightlog.signals import Measurement, StateEstimate
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Plot, Series
from scenarios.flight import fly
from scenarios.load import load
from sim.world import World

NAME = "horizon-hold"
SYSTEM = "huang"
TITLE = "Hover on the horizon: biased gyroscopes, no magnetometer, 8 s without GPS"
ABOUT = (
    "The paper ends at the angles and means them for the aircraft's stabilisation. Here the loop is closed on them: a "
    "hover at sea, nothing below to see, 3 m/s of wind. The magnetometer falls silent at 8 s, two gyroscopes are off "
    "by 0.003 rad/s from 10 s, GPS says nothing from 12 to 20 s. Flown with the horizon by ours, by the published "
    "pair of cameras, and with the same navigator without a horizon."
)

Who = tuple[str, Variant]
OURS: Who = ("huang", "helideck")
PAPER: Who = ("huang", "published")
NONE: Who = ("helideck", "helideck")
FLOWN: dict[Effort, tuple[Who, ...]] = {"full": (OURS, PAPER, NONE), "quick": (OURS, NONE)}
DURATION: dict[Effort, float] = {"full": 30.0, "quick": 20.0}  # [s]
TROUBLE = 12.0  # [s] from which all is gone
EVERY = 25  # steps: 10 Hz
LABELS = {OURS: "horizon, ours", PAPER: "horizon, published", NONE: "no horizon"}
SEED = 1


@dataclass
class Witness:
    """Looks at the truth and at what the navigator says."""

    rows: list[list[float]] = field(default_factory=list)
    _steps: int = 0

    def __call__(
        self, world: World, measurements: Sequence[Measurement], navigator: Any, state: StateEstimate
    ) -> None:
        """One step of the loop."""
        if self._steps % EVERY == 0:
            truth = world.truth
            # where the estimated attitude puts the true up: its horizontal part is the tilt error
            up = truth.rotation[2]
            east, north, _ = matrix(state.quaternion) @ up
            away = truth.position[:2] - state.position[:2]
            self.rows.append([truth.t, east, north, float(state.std_attitude[0]), *truth.position[:2], *away])
        self._steps += 1


def hold(navigator: str, variant: Variant, duration: float) -> Floats:
    """Fly once: t, tilt error east and north [rad], its stated deviation, position and position error [m] (N, 8)."""
    scenario = load("horizon_hold", {"navigator": navigator, "variant": variant, "duration_s": duration})
    witness = Witness()
    fly(scenario, seed=SEED, onlooker=witness, name="horizon_hold")
    return np.array(witness.rows)


def jobs(effort: Effort) -> Sequence[Job]:
    """One a navigator."""
    duration = DURATION[effort]
    return [
        Job(hold, (*who, duration), f"hover on the horizon: {LABELS[who]}", 4.0 + duration) for who in FLOWN[effort]
    ]


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Tilt error and distance from the point, with the horizon and without."""
    flown: dict[Who, Floats] = dict(zip(FLOWN[effort], answers, strict=True))
    tilt, away, series, table = {}, {}, [], []
    for who, rows in flown.items():
        after = rows[:, 0] >= TROUBLE
        error = np.degrees(np.hypot(rows[:, 1], rows[:, 2]))
        tilt[who] = float(np.sqrt(np.mean(error[after] ** 2)))
        away[who] = float(np.hypot(rows[after, 4], rows[after, 5]).max())
        distance = np.hypot(rows[:, 4], rows[:, 5])
        series.append((Series(LABELS[who], rows[:, 0], error), Series(LABELS[who], rows[:, 0], distance)))
        score = np.mean((rows[after, 1] ** 2 + rows[after, 2] ** 2) / (2.0 * rows[after, 3] ** 2))
        table.append({
            "navigator": LABELS[who], "tilt error [deg RMS]": tilt[who], "largest [deg]": float(error[after].max()),
            "stated [deg]": math.degrees(float(rows[after, 3].mean())), "error over stated, squared": float(score),
            "farthest from the point [m]": away[who],
        })  # fmt: skip
    figures = [
        Figure("tilt error after the failures, RMS", "deg", None, tilt.get(PAPER), tilt[OURS],
               note=f"without a horizon {tilt[NONE]:.2f}"),
        Figure("farthest from the point", "m", None, away.get(PAPER), away[OURS], 1.0,
               note=f"without a horizon {away[NONE]:.1f}"),
    ]  # fmt: skip
    plots = [
        Plot("Tilt error", "The failures come at 8, 10 and 12 s; GPS is back at 20 s.", "time [s]", "tilt error [deg]",
             [s[0] for s in series]),
        Plot("Distance from the point", "The same flights.", "time [s]", "distance [m]", [s[1] for s in series]),
    ]  # fmt: skip
    notes = ["A step of 0.003 rad/s is ten of the inertial sensor's own standard deviations and is learnt in 20 s."]
    return Outcome(figures, plots, notes=notes, tables=[("Hover on the horizon", table)])

"""Zeng and Jiang: two minutes at 1 m on optical flow and inertial sensors alone."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from estimators.navigator import Navigator
from estimators.navigators import Variant
from estimators.zeng_navigator import ZengNavigator
from flightlog.signals import Frame, Measurement, StateEstimate
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Picture, Plot, Series
from scenarios.flight import fly
from scenarios.load import load
from sim.world import World

NAME = "zeng-hover"
SYSTEM = "zeng"
TITLE = "Hover at 1 m for two minutes without GPS, by optical flow"
ABOUT = (
    "The paper hovers a rotorcraft 1 m over the floor of a well-lit room for two minutes and shows three things: the "
    "velocity by inertial sensors alone runs away, the fused one does not, and the position stays within 0.5 m of the "
    "target. Here the helicopter holds (0, 0, 1) over the paving of a walled yard, no wind, GPS silent from the start, "
    "no mark to see; height by sonar, heading by magnetometer. The loop is closed on the flow of rendered pictures; "
    "further flights of ours on that flow's error model show how much depends on the draw of the sensors' errors."
)

SETTLED = 2.0  # [s] after the start; from then on it counts
EVERY = 25  # steps: 10 Hz
JUDGED = 5.0  # [s] between two looks at the normalised error
FLOWN = {"full": (120.0, 12), "quick": (20.0, 4)}  # [s] of a flight; flights on the error model
AT_A_TIME = 4  # of those, in one process
SEED = 1
STATES = 4  # e, n, ve, vn


@dataclass
class Witness:
    """Looks at the truth, at what the navigator says, and at the last picture."""

    rows: list[list[float]] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    picture: NDArray[np.uint8] | None = None
    lines: Sequence[Floats] = ()
    _steps: int = 0
    _next: float = 10.0

    def __call__(
        self, world: World, measurements: Sequence[Measurement], navigator: Any, state: StateEstimate
    ) -> None:
        """One step of the loop."""
        truth = world.truth
        for item in measurements:
            if isinstance(item, Frame) and item.camera == "down":
                self.picture, self.lines = item.image, navigator.overlays.get("down", ())
        if self._steps % EVERY == 0:
            alone = navigator.inertial if isinstance(navigator, ZengNavigator) else None
            blind = [*alone.position, *alone.velocity] if alone is not None else [np.nan] * 4
            self.rows.append(
                [truth.t, *truth.position, *truth.velocity, *state.position, *state.velocity, *map(float, blind)]
            )
        if isinstance(navigator, Navigator) and truth.t >= self._next:
            self._next += JUDGED
            last = navigator.filters[2].kalman.last
            error = last["x"][:STATES] - [*truth.position[:2], *truth.velocity[:2]]
            self.nees.append(float(error @ np.linalg.solve(last["p"][:STATES, :STATES], error)))
        self._steps += 1


@dataclass(frozen=True, eq=False)
class Course:
    """One flight, ten rows a second."""

    t: Floats  # (N,) [s]
    position: Floats  # (N, 3) [m] true, from the target
    velocity: Floats  # (N, 3) [m/s] true
    position_error: Floats  # (N, 3) [m] estimated less true
    velocity_error: Floats  # (N, 3) [m/s]
    inertial_position: Floats  # (N, 2) [m] error of the inertial sensors alone; NaN where not kept
    inertial_velocity: Floats  # (N, 2) [m/s]
    nees: Floats  # (K,) of e, n, ve, vn every few seconds; empty where there is no covariance
    picture: NDArray[np.uint8] | None  # the last, with what was matched

    @property
    def away(self) -> Floats:
        """Horizontal distance [m] from the target (N,)."""
        return np.hypot(self.position[:, 0], self.position[:, 1])

    @property
    def lost(self) -> Floats:
        """Horizontal error [m] of the estimated position (N,)."""
        return np.hypot(self.position_error[:, 0], self.position_error[:, 1])


def hover(variant: Variant, seed: int, duration: float, rendered: bool) -> Course:
    """Fly once."""
    settings = {"variant": variant, "duration_s": duration}
    if rendered:  # nobody looks ahead
        settings |= {"cameras.forward_a.rate_hz": 1.0, "cameras.forward_b.rate_hz": 1.0}
    scenario = load("gps_denied_hover", settings)
    witness = Witness()
    fly(scenario, seed=seed, cameras=rendered, onlooker=witness, name="gps_denied_hover")
    rows = np.array(witness.rows)
    true, said, blind = rows[:, 1:7], rows[:, 7:13], rows[:, 13:17]
    picture = None
    if witness.picture is not None:
        picture = np.asarray(cv2.cvtColor(witness.picture, cv2.COLOR_GRAY2RGB), np.uint8)
        for line in witness.lines:
            cv2.polylines(picture, [np.rint(line).astype(np.int32)], False, (255, 200, 0), 1, cv2.LINE_AA)
    return Course(
        t=rows[:, 0],
        position=true[:, :3] - scenario.plan.point_m,
        velocity=true[:, 3:],
        position_error=said[:, :3] - true[:, :3],
        velocity_error=said[:, 3:] - true[:, 3:],
        inertial_position=blind[:, :2] - true[:, :2],
        inertial_velocity=blind[:, 2:] - true[:, 3:5],
        nees=np.array(witness.nees),
        picture=picture,
    )


def hovers(seeds: Sequence[int], duration: float) -> list[Course]:
    """Ours several times, on the flow's error model."""
    return [hover("helideck", seed, duration, False) for seed in seeds]


def jobs(effort: Effort) -> Sequence[Job]:
    """Both variants rendered, and ours often without pictures."""
    duration, many = FLOWN[effort]
    wanted: list[Job] = [
        Job(hover, ("helideck", SEED, duration, True), "flow hover", cost=duration),
        Job(hover, ("published", SEED, duration, True), "flow hover, published", cost=duration),
    ]
    seeds = range(300, 300 + many)
    wanted += [
        Job(hovers, (tuple(seeds[k : k + AT_A_TIME]), duration), "flow hovers without pictures", cost=0.25 * duration)
        for k in range(0, many, AT_A_TIME)
    ]
    return wanted


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Figures, curves and a picture."""
    duration, many = FLOWN[effort]
    ours: Course
    theirs: Course
    ours, theirs, *groups = answers
    blind: list[Course] = [course for group in groups for course in group]
    settled = ours.t >= SETTLED

    def worst(values: Floats) -> float:
        return float(np.max(values[settled]))

    def rms(course: Course) -> float:
        return float(np.sqrt(np.mean(course.velocity_error[settled, :2] ** 2)))

    away = np.array([worst(course.away) for course in blind])
    lost = np.array([worst(course.lost) for course in blind])
    slow = np.array([rms(course) for course in blind])
    figures = [
        Figure("farthest from the target", "m", 0.5, worst(theirs.away), worst(ours.away), 0.05, expected=(0.0, 0.5),
               note=f"horizontal, true position, {duration:g} s; the paper says within 0.5 m"),
        Figure("largest error of the estimated position", "m", None, worst(theirs.lost), worst(ours.lost), 0.05,
               note="horizontal, MEMS gyroscopes"),
        Figure("RMS error of the estimated velocity", "m/s", None, rms(theirs), rms(ours), 0.01,
               note="of one horizontal axis"),
        Figure(f"farthest from the target, worst of {many} flights", "m", 0.5, None, float(away.max()), 0.05,
               note=f"on the flow's error model; median {np.median(away):.3f} m"),
        Figure(f"largest error of the estimated position, worst of {many} flights", "m", None, None,
               float(lost.max()), 0.05),
        Figure(f"RMS error of the estimated velocity, worst of {many} flights", "m/s", None, None, float(slow.max()),
               0.01),
        Figure("largest error of the position by inertial sensors alone", "m", None,
               float(np.hypot(*theirs.inertial_position.T).max()), None, note="the paper: diverges"),
        Figure("largest error of the velocity by inertial sensors alone", "m/s", None,
               float(np.hypot(*theirs.inertial_velocity.T).max()), None, note="the paper: diverges"),
    ]  # fmt: skip
    nees = np.concatenate([course.nees for course in blind]) if blind else np.empty(0)
    notes = [
        "MEMS inertial unit as in the vehicle file (gyroscopes 0.05 deg/s of unknown bias, accelerometers 0.03 m/s^2, "
        "rotor vibration on both); pictures 768 x 494 at 25 Hz, 60 ms late, read noise 1.2 and shot noise 2.2 grey "
        "levels, 2 ms exposure.",
        "Flow never observes the position: it counts from the start, where the error is none by definition.",
    ]
    if len(nees):
        # errors of one flight stay alike, so a flight counts once
        means = np.array([course.nees.mean() for course in blind])
        low, high = (float(chi2.ppf(p, STATES * many)) / many for p in (0.0005, 0.9995))
        notes.append(
            f"Normalised error squared of e, n, ve, vn over {many} flights: {means.mean():.2f}; 99.9 % band of "
            f"{STATES} degrees of freedom {low:.2f} to {high:.2f}. Below it the filter is more careful than need be: "
            "it allows for motion and vibration that a calm hover does not have."
        )
    plots = [
        Plot(
            "Distance from the target", "Where the helicopter really was, horizontally.", "time [s]", "distance [m]",
            [Series("published", theirs.t, theirs.away), Series("ours", ours.t, ours.away)],
            bands=[("ours must stay within", 0.0, 0.05)],
        ),
        Plot(
            "Error of the estimated position",
            "Published, whole pixels between consecutive pictures add up; ours counts from one key frame.",
            "time [s]", "error [m]", [Series("published", theirs.t, theirs.lost), Series("ours", ours.t, ours.lost)],
        ),
        Plot(
            "Error of the velocity east", "The inertial sensors alone run away.", "time [s]", "error [m/s]",
            [
                Series("inertial alone", theirs.t, theirs.inertial_velocity[:, 0]),
                Series("published", theirs.t, theirs.velocity_error[:, 0]),
                Series("ours", ours.t, ours.velocity_error[:, 0]),
            ],
        ),
    ]  # fmt: skip
    pictures = []
    if ours.picture is not None:
        pictures.append(
            Picture("What the down camera sees", "Each line: a block's way since the key frame.", ours.picture)
        )
    return Outcome(figures, plots, pictures, notes)

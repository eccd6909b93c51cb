"""Huang, Li, Fan, figure 9: the dive at -10.0 degrees, by two cameras and by one."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from estimators.vision.horizon import HorizonFrontEnd
from estimators.vision.huang_horizon import HuangPair, exact_angles
from estimators.vision.huang_line import find_line
from flightlog.constants import EARTH_RADIUS
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Plot, Series
from scenarios.experiments.forward_pictures import Pose, forward_cameras, rendered

NAME = "horizon-dive"
SYSTEM = "huang"
TITLE = "The dive at -10.0 degrees"
ABOUT = (
    "Frame 1 of the paper's dive is level and gives the shares of ground from which the pitch counts; in frame 3 the "
    "inertial unit says -10.0 deg and the two cameras -10.3. Here: the same over the simulator's sea, the level "
    "pictures rendered too, the frame taken many times with new noise; again with the wings up to 3 deg off level; a "
    "sweep of the pitch, which shows the method's own error; and the dive from 100 m above a round sea, whose horizon "
    "dips."
)

DIVE = math.radians(-10.0)
HEADING = math.radians(90.0)  # open sea
FRAMES = {"full": 30, "quick": 8}
SWEEP = {"full": 1.0, "quick": 2.5}  # [deg] between pitches
HEIGHT = 100.0  # [m]
SEED = 12


def dive(poses: Sequence[Pose], dip: bool, seed: int) -> Floats:
    """Pitch [rad] at each pose: truth, as published by the pair, by the published line alone, ours, its deviation."""
    cameras = forward_cameras()
    a, b = cameras["forward_a"], cameras["forward_b"]
    eye, pair = HorizonFrontEnd(a.model, a.mount), HuangPair((a.model, a.mount), (b.model, b.mount))
    rows = np.full((len(poses), 5), np.nan)
    level = Pose(0.0, 0.0, HEADING)
    for k, view in enumerate(rendered("sea", [level, *poses], seed, height=HEIGHT, dip=dip)):
        line_a, line_b = find_line(view["forward_a"]), find_line(view["forward_b"])
        if k == 0:
            if line_a is None or line_b is None:
                raise RuntimeError("no horizon in the level pictures")
            for name, line, camera in (("a", line_a, a.model), ("b", line_b, b.model)):
                pair.levels[name] = line.ground_share(camera.width, camera.height)
            continue
        rows[k - 1, 0] = poses[k - 1].pitch
        seen = eye.see(view["forward_a"])
        if line_a is not None:
            rows[k - 1, 2] = exact_angles(line_a, a.model, a.mount)[1]
            if line_b is not None:
                rows[k - 1, 1] = pair.measure(line_a, line_b).pitch
        if seen is not None:
            rows[k - 1, 3:] = seen.pitch, seen.std_pitch
    return rows


def jobs(effort: Effort) -> Sequence[Job]:
    """The frame many times, the sweep, and the round earth."""
    rng = np.random.default_rng(SEED)
    many = [Pose(0.0, DIVE, HEADING)] * FRAMES[effort]
    rolled = [Pose(math.radians(rng.uniform(-3.0, 3.0)), DIVE, HEADING) for _ in many]
    sweep = [Pose(0.0, math.radians(p), HEADING) for p in np.arange(-15.0, 12.6, SWEEP[effort])]
    return [
        Job(dive, (many, False, SEED), "horizon, dive", 1.5 + 0.04 * len(many)),
        Job(dive, (rolled, False, SEED + 3), "horizon, rolled dive", 1.5 + 0.04 * len(many)),
        Job(dive, (sweep, False, SEED + 1), "horizon, pitch sweep", 1.5 + 0.04 * len(sweep)),
        Job(dive, (rolled, True, SEED + 2), "horizon, dive above a round sea", 1.5 + 0.04 * len(many)),
    ]


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """The pitch of the dive, its spread, and the method's own error over the pitch."""
    many, rolled, sweep, dipped = (np.degrees(rows) for rows in answers)
    dip = math.degrees(math.sqrt(2.0 * HEIGHT / EARTH_RADIUS))
    truth = math.degrees(DIVE)
    ours, ours_dipped = many[:, 3], dipped[:, 3] - dip
    figures = [
        Figure("dive: pitch", "deg", -10.3, float(np.mean(many[:, 1])), float(np.mean(ours)), expected=(-10.5, -10.1)),
        Figure("dive: largest error of one frame", "deg", 0.3, float(np.max(np.abs(many[:, 1] - truth))),
               float(np.max(np.abs(ours - truth))), 0.02, expected=(0.1, 0.6)),
        Figure("dive: the same, the published line in the exact single-camera form", "deg", None,
               float(np.max(np.abs(many[:, 2] - truth))), None),
        Figure("dive with the wings up to 3 deg off level: deviation of the pitch", "deg", None,
               float(np.std(rolled[:, 1] - truth)), float(np.std(rolled[:, 3] - truth)), 0.02),
        Figure("dive from 100 m above a round sea: pitch, dip taken off", "deg", None, float(np.mean(dipped[:, 1])),
               float(np.mean(ours_dipped)), note=f"the dip is {dip:.3f} deg; the paper knows none, but counts from "
               "level pictures, which hold it"),
        Figure("the same: largest error of one frame", "deg", None, float(np.max(np.abs(dipped[:, 1] - truth))),
               float(np.max(np.abs(ours_dipped - truth))), 0.02),
    ]  # fmt: skip
    plot = Plot(
        "Pitch error over the pitch",
        "The pair takes the ground's share for linear in the pitch, but it goes with the tangent: it reads too much in "
        "a dive. The steps are Hough's cells of 1 px and 1 deg.",
        "pitch [deg]", "error [deg]",
        [Series("published, two cameras", sweep[:, 0], sweep[:, 1] - sweep[:, 0]),
         Series("published line, exact single-camera form", sweep[:, 0], sweep[:, 2] - sweep[:, 0]),
         Series("ours", sweep[:, 0], sweep[:, 3] - sweep[:, 0])],
    )  # fmt: skip
    score = (many[:, 3] - many[:, 0]) / many[:, 4]
    notes = [
        f"Ours states a standard deviation of {np.mean(many[:, 4]):.4f} deg; its errors are "
        f"{np.sqrt(np.mean(score**2)):.2f} of it (RMS).",
        "Beyond +12 deg the first camera loses the horizon upward, beyond -13 deg the second one does.",
    ]
    return Outcome(figures, [plot], notes=notes)

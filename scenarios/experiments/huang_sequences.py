"""Huang, Li, Fan, figures 8 and 10: roll and pitch of 50 frames over land and sea."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.horizon import HorizonFrontEnd
from estimators.vision.huang_horizon import HuangPair, exact_angles
from estimators.vision.huang_line import find_line
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Picture, Plot, Series
from scenarios.experiments.forward_pictures import Pose, drawn, forward_cameras, rendered

NAME = "horizon-sequences"
SYSTEM = "huang"
TITLE = "Roll and pitch from the horizon: 50 frames over sea, over land with hills, over rough land"
ABOUT = (
    "The paper takes 50 frames each of land and sea and finds its curves of roll and pitch nearly on those of a laser "
    "inertial unit. Here: both forward cameras (640x480, focal length 560 px, the second 10 deg lower), roll within "
    "30 deg and pitch within 8 deg, drawn at random, headings all round. Sea with clouds and islands and land with "
    "hills up to 1.9 deg high are rendered from the simulator's scenes; rough land is drawn, its skyline 0.3 deg "
    "(1 sigma) high hills of the ground's own colour with plains between, so that nothing marks the hills' feet. "
    "Frames without a horizon, the nose 60 deg up or down, must be refused."
)

FRAMES = {"full": 50, "quick": 12}
REFUSALS = {"full": 10, "quick": 4}
ROLL, PITCH = math.radians(30.0), math.radians(8.0)
AWAY = math.radians(60.0)
HILLS = math.radians(0.3)
SEED = 11


@dataclass(frozen=True, eq=False)
class Sequence50:
    """What was seen of one sequence; NaN where there was nothing."""

    truth: Floats  # (N, 2) [rad] roll, pitch
    pair: Floats  # (N, 2) as published, two cameras
    single: Floats  # (N, 2) the published line, exact single-camera form
    ours: Floats  # (N, 2)
    std: Floats  # (N, 2) [rad] as ours states it
    wrong: tuple[int, int]  # horizons found, by ours and as published, where there is none
    refused: int  # pictures without a horizon
    picture: NDArray[np.uint8]


def sequence(where: str, count: int, refusals: int) -> Sequence50:
    """One sequence by its name."""
    rng = np.random.default_rng([SEED, *where.encode()])
    poses = [
        Pose(rng.uniform(-ROLL, ROLL), rng.uniform(-PITCH, PITCH), rng.uniform(0.0, 2.0 * math.pi))
        for _ in range(count)
    ]
    away = [Pose(rng.uniform(-ROLL, ROLL), AWAY * (-1) ** k, rng.uniform(0.0, 2.0 * math.pi)) for k in range(refusals)]
    cameras = forward_cameras()
    a, b = cameras["forward_a"], cameras["forward_b"]
    eye, pair = HorizonFrontEnd(a.model, a.mount), HuangPair((a.model, a.mount), (b.model, b.mount))
    source = {"rough": lambda p: drawn(p, SEED, HILLS, sunk=False), "sunk": lambda p: drawn(p, SEED, HILLS, sunk=True)}
    views = source[where](poses + away) if where in source else rendered(where, poses + away, SEED)
    rows = np.full((count, 8), np.nan)
    wrong, shown = [0, 0], np.zeros((1, 1, 3), np.uint8)
    for k, view in enumerate(views):
        seen, lines = eye.see(view["forward_a"]), [find_line(view[name]) for name in ("forward_a", "forward_b")]
        if k >= count:
            wrong[0] += seen is not None
            wrong[1] += lines[0] is not None
            continue
        if seen is not None:
            rows[k, 4:] = seen.roll, seen.pitch, seen.std_roll, seen.std_pitch
        if lines[0] is not None:
            rows[k, 2:4] = exact_angles(lines[0], a.model, a.mount)
        if lines[0] is not None and lines[1] is not None:
            both = pair.measure(lines[0], lines[1])
            rows[k, :2] = both.roll, both.pitch
        if k == 0:
            shown = view["forward_a"].copy()
            if seen is not None:
                ends = np.rint(np.array(seen.line)).astype(int)
                cv2.line(shown, tuple(ends[0]), tuple(ends[1]), (255, 60, 0), 1, cv2.LINE_AA)
    truth = np.array([(pose.roll, pose.pitch) for pose in poses])
    return Sequence50(
        truth, rows[:, :2], rows[:, 2:4], rows[:, 4:6], rows[:, 6:], (wrong[0], wrong[1]), refusals, shown
    )


PLACES = {"sea": "sea", "field": "land", "rough": "rough land", "sunk": "land whose skyline also sinks"}
RENDERED = ("sea", "field")
BARS = {"sea": 0.02, "field": 0.25, "rough": 0.25, "sunk": None}
EXPECTED = {"sea": ((0.3, 0.5), (0.2, 0.45)), "field": ((0.3, 0.6), (0.2, 0.5))}


def jobs(effort: Effort) -> Sequence[Job]:
    """One a sequence."""
    count, refusals = FRAMES[effort], REFUSALS[effort]
    seconds = {where: 0.05 if where in RENDERED else 0.25 for where in PLACES}  # a frame
    return [
        Job(sequence, (where, count, refusals), f"horizon, {name}", 2.0 + seconds[where] * count)
        for where, name in PLACES.items()
    ]


def rms(errors: Floats) -> Floats:
    """RMS by column [deg]; NaN are left out."""
    return np.asarray(np.degrees(np.sqrt(np.nanmean(errors**2, axis=0))))


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """RMS errors, shares found, and whether the stated deviations are true."""
    found: dict[str, Sequence50] = dict(zip(PLACES, answers, strict=True))
    figures, plots, table = [], [], []
    for where, s in found.items():
        name, bar = PLACES[where], BARS[where]
        faithful, single, ours = rms(s.pair - s.truth), rms(s.single - s.truth), rms(s.ours - s.truth)
        score = (s.ours - s.truth) / s.std
        for axis, angle in enumerate(("roll", "pitch")):
            figures.append(Figure(
                f"{name}: {angle}, RMS", "deg", None, float(faithful[axis]), float(ours[axis]), bar,
                expected=EXPECTED[where][axis] if where in EXPECTED else None,
                note="published: the curves nearly coincide" if where in RENDERED else "",
            ))  # fmt: skip
        figures.append(Figure(
            f"{name}: frames found", "%", 100.0, 100.0 * float(np.isfinite(s.pair[:, 0]).mean()),
            100.0 * float(np.isfinite(s.ours[:, 0]).mean()), 100.0, at_most=False,
        ))  # fmt: skip
        figures.append(Figure(
            f"{name}: horizons found where there is none", "%", None, 100.0 * s.wrong[1] / s.refused,
            100.0 * s.wrong[0] / s.refused, 0.0,
        ))  # fmt: skip
        table.append({
            "sequence": name, "ours: worst roll [deg]": float(np.degrees(np.nanmax(np.abs(s.ours - s.truth)[:, 0]))),
            "ours: worst pitch [deg]": float(np.degrees(np.nanmax(np.abs(s.ours - s.truth)[:, 1]))),
            "error over stated deviation, roll": float(np.sqrt(np.nanmean(score[:, 0] ** 2))),
            "error over stated deviation, pitch": float(np.sqrt(np.nanmean(score[:, 1] ** 2))),
            "published line, one camera: roll [deg RMS]": float(single[0]),
            "published line, one camera: pitch [deg RMS]": float(single[1]),
        })  # fmt: skip
        number = np.arange(1.0, len(s.truth) + 1)
        for axis, angle in enumerate(("roll", "pitch")):
            plots.append(Plot(
                f"{angle.capitalize()} errors, {name}",
                "The published method's cells of 1 deg and 1 px show; ours is the line at zero.",
                "frame", f"{angle} error [deg]",
                [Series("published", number, np.degrees(s.pair - s.truth)[:, axis], "points"),
                 Series("ours", number, np.degrees(s.ours - s.truth)[:, axis], "points")],
            ))  # fmt: skip
    notes = [
        "Noise of the pictures: 1.2 grey levels in the dark, 2.2 more at white, defocus 0.4 px.",
        "Where a hill's foot can be seen against the ground, ours takes the foot. On rough land there is none, and the "
        "plains between the hills serve; on land whose skyline sinks as far as it rises what is left is the terrain.",
    ]
    pictures = [
        Picture(PLACES[where].capitalize(), "Frame 1 of camera A with our line.", s.picture)
        for where, s in found.items() if where != "sunk"
    ]  # fmt: skip
    return Outcome(figures, plots, pictures, notes, [("Horizon by sequence", table)])

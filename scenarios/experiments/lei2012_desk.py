"""Lei 2012, figure 5: distance to a 20 cm H on a desk, from pictures alone."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.lei_mark import LeiFrontEnd, LeiReading, Threshold
from estimators.vision.pose import level_axes
from flightlog.marks import HMark
from scenarios.experiments.contract import Effort, Figure, Job, Outcome, Picture, Plot, Series
from scenarios.experiments.lei_readings import PUBLISHED, heights, table
from scenarios.experiments.still_camera import CAMERA, MOUNT, StillCamera, edge_noise, height_bound, stand, still_camera
from sim.cameras.exposure import Exposure
from sim.cameras.imaging import Imaging
from sim.cameras.noise import Noise

NAME = "desk"
SYSTEM = "lei2012"
TITLE = "Desk: distance to a 20 cm H"
ABOUT = (
    "The paper measured the distance to a 20 cm H indoors, three times, at distances that it does not give. Here: a "
    "paved floor in diffuse light, the paper's camera, set up by hand at any heading (tilt to 1 deg, known; the mark "
    "1 % of the distance off the axis at most), from the nearest distance that holds the whole H. In each run the "
    "focal length of each published reading is calibrated from one picture at 0.8 m."
)

MARK = HMark(leg=0.2, width=0.2, stroke=0.04)
SCENE = "courtyard"
INDOORS = Imaging(colour=False, exposure=Exposure(gain=2.1), noise=Noise(read=2.0, shot=3.5))
RUNS = 3
NEAR = np.arange(0.5, 1.51, 0.1)  # [m]
FAR = np.arange(1.75, 3.01, 0.25)  # [m] ours alone is judged there
CALIBRATED_AT = 0.8  # [m]
TILT, STRAY, TURN = np.radians(1.0), 0.01, np.pi
THRESHOLDS: tuple[Threshold, ...] = ("printed", "open", "otsu")


def jobs(effort: Effort) -> Sequence[Job]:
    """One for each of the three runs."""
    pictures = 8 if effort == "full" else 1
    cost = 2.0 + 0.05 * pictures * (len(NEAR) + len(FAR))
    return [Job(measure, (run, pictures), f"desk, run {run + 1}", cost) for run in range(RUNS)]


def measure(run: int, pictures: int) -> dict[str, Any]:
    """One run: at each distance what every reading and ours say, and which thresholds show the mark."""
    published, ours = LeiFrontEnd(CAMERA, MOUNT, MARK), HMarkFrontEnd(CAMERA, MOUNT, MARK)
    alone = [LeiFrontEnd(CAMERA, MOUNT, MARK, LeiReading(thresholds=(kind,))) for kind in THRESHOLDS]
    with still_camera(MARK, SCENE, INDOORS, seed=run) as camera:
        rng = np.random.default_rng([20120432, run])
        factors = calibrate(camera, published, rng)
        rows: list[dict[str, Any]] = []
        for distance in np.concatenate([NEAR, FAR]):
            where = stand(rng, float(distance), tilt=TILT, stray=STRAY, turn=TURN)
            for _ in range(pictures):
                image = camera.picture(where, len(rows))
                sighting = ours.see(image, where.attitude)
                down = level_axes(where.attitude, MOUNT).up
                rows.append(
                    {
                        "distance": float(distance),
                        "published": factors * heights(published, image, where.attitude) - distance,
                        "ours": np.nan if sighting is None else float(-sighting.position @ down - distance),
                        "seen": [eye.find(image) is not None for eye in alone],
                        "bound": height_bound(MARK, where, edge_noise(INDOORS)),
                    }
                )
    answer = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return {**answer, "picture": annotated(published, image)}


def annotated(front_end: LeiFrontEnd, image: Any) -> Any:
    """The last picture's middle with the contour that the published reading measures, threefold."""
    middle = np.s_[148:346, 264:504]
    large = cv2.resize(image[middle], None, fx=3, fy=3, interpolation=cv2.INTER_NEAREST)
    large = cv2.cvtColor(large, cv2.COLOR_GRAY2RGB)
    found = front_end.find(image)
    if found is not None:
        points = (found[0].contour - [264, 148]) * 3 + 1
        cv2.polylines(large, [points.reshape(-1, 1, 2).astype(np.int32)], True, (255, 80, 0), 1)
    return large


def calibrate(camera: StillCamera, front_end: LeiFrontEnd, rng: np.random.Generator) -> Any:
    """What each of READINGS has to multiply f by, from one picture set up like any other."""
    where = stand(rng, CALIBRATED_AT, tilt=TILT, stray=STRAY, turn=TURN)
    return CALIBRATED_AT / heights(front_end, camera.picture(where, 100_000), where.attitude)


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Errors of all runs together."""
    rows = {name: np.concatenate([answer[name] for answer in answers]) for name in answers[0] if name != "picture"}
    near = rows["distance"] < NEAR[-1] + 0.01
    published = np.abs(rows["published"])
    faithful = published[near][:, PUBLISHED]
    ours = np.abs(rows["ours"])
    found = [
        {
            "threshold": kind,
            "to 1.5 m [%]": round(100 * float(np.mean(rows["seen"][near, i])), 1),
            "beyond [%]": round(100 * float(np.mean(rows["seen"][~near, i])), 1),
        }
        for i, kind in enumerate(THRESHOLDS)
    ]
    note = "0.5 to 1.5 m published (side of the smallest rectangle, one f), 0.5 to 3 m ours"
    return Outcome(
        figures=[
            Figure("mean |error|", "cm", 1.80, 100 * float(np.nanmean(faithful)), 100 * float(np.nanmean(ours)),
                   bar=0.1, bound=100 * float(np.sqrt(2 / np.pi) * np.mean(rows["bound"])), expected=(1.0, 4.0),
                   note=note),
            Figure("largest |error|", "cm", 5.0, 100 * float(np.nanmax(faithful)), 100 * float(np.nanmax(ours)),
                   bar=0.4, expected=(4.0, 10.0), note="the paper: not above 5 cm"),
            Figure("pictures in which the H was found", "%", None, 100 * float(np.mean(np.isfinite(faithful))),
                   100 * float(np.mean(np.isfinite(ours))), bar=100.0, at_most=False),
        ],
        plots=[
            Plot(
                "Errors on the desk", "Each picture's error, published reading and ours; the paper's lie within 5 cm.",
                "distance [m]", "error [cm]",
                [
                    Series("published reading", rows["distance"],
                           100 * rows["published"][:, PUBLISHED], "points"),
                    Series("ours", rows["distance"], 100 * rows["ours"], "points"),
                ],
                bands=[("the paper's largest", -5.0, 5.0)],
            ),
            Plot(
                "Ours alone", "Error, and the Cramer-Rao bound of one picture with this noise, attitude known.",
                "distance [m]", "error [mm]",
                [
                    Series("ours", rows["distance"], 1e3 * rows["ours"], "points"),
                    Series("bound, one sigma", *bound_curve(rows)),
                ],
            ),
        ],
        pictures=[
            Picture("The H at 3 m", "The contour that the published front end measures; one pixel of it is 4.7 cm of "
                    "distance.", answers[0]["picture"]),
        ],
        notes=[
            "Camera: read noise 2.0, shot noise 3.5 grey levels at 255; defocus 0.4 px; 8 bits.",
            "Nearer than 0.5 m an H turned by 45 deg is larger than the picture of a 1/2-inch chip behind 8 mm.",
            "The published error is that of one f for pixels of 8.4 x 9.8 um: the side of the rectangle changes by 7 % "
            "with the heading, and the calibration takes up what it happened to be in one picture.",
        ],
        tables=[
            ("Every reading of 'length', to 1.5 m", table(rows["published"][near], 0.01, "cm")),
            ("Pictures in which a threshold alone shows the H", found),
        ],
    )  # fmt: skip


def bound_curve(rows: dict[str, Any]) -> tuple[Any, Any]:
    """Distance and bound [mm], mean of all pictures at a distance."""
    distances = np.unique(rows["distance"])
    return distances, np.array([1e3 * rows["bound"][rows["distance"] == d].mean() for d in distances])

"""What the H's front ends do with pictures that are wrong in some way: found, how well, and whether they say so.

python benchmarks/robustness.py [pictures of each kind, default 60] [--any]

--any: the front end for an H of unknown proportions instead of the one that flies.
"""

import math
import sys
from collections.abc import Callable

import cv2
import numpy as np
from drawing import MOUNT, Shot, drawn, h_ink, photographed, shot
from numpy.typing import NDArray

from estimators.vision.any_h import AnyHFrontEnd
from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.pose import place, wrap_axis
from estimators.vision.sighting import PadPrediction
from flightlog.camera import CameraModel
from flightlog.marks import HMark

Floats = NDArray[np.float64]
Rng = np.random.Generator
Make = Callable[[Shot, Rng], NDArray[np.uint8]]

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)
MARK, SIDE = HMark(), 1.5
INK = h_ink(MARK, SIDE)
WRONG = 10.0  # standard deviations


def plain(one: Shot, rng: Rng) -> NDArray[np.uint8]:
    return photographed(drawn(one, INK, SIDE), rng)


def clutter(one: Shot, rng: Rng) -> NDArray[np.uint8]:
    """Lines, boxes and letters as light as the mark on a grained ground."""
    grain = cv2.GaussianBlur(rng.standard_normal((CAMERA.height, CAMERA.width)), (0, 0), 4.0)
    ground = 110.0 + 25.0 * grain / grain.std()
    for _ in range(40):
        a, grey = rng.uniform(0, 1, 2) * [CAMERA.width, CAMERA.height], float(rng.uniform(40, 220))
        size, kind = rng.uniform(10, 120, 2), rng.integers(3)
        p, q = tuple(map(int, a)), tuple(map(int, a + size))
        if kind == 0:
            cv2.rectangle(ground, p, q, grey, int(rng.choice([-1, 6, 12])))
        elif kind == 1:
            cv2.line(ground, p, q, grey, int(rng.integers(2, 14)))
        else:
            text = np.zeros(ground.shape, np.uint8)
            cv2.putText(text, str(rng.choice(list("ETUINMZ4AKX"))), p, cv2.FONT_HERSHEY_SIMPLEX, size[0] / 20, 255,
                        int(size[0] / 6) + 1)  # fmt: skip
            ground[text > 0] = grey
    return photographed(drawn(one, INK, SIDE, ground), rng)


def glare(one: Shot, rng: Rng) -> NDArray[np.uint8]:
    """A saturated spot on the mark, up to half its size, with a wide halo."""
    grey = drawn(one, INK, SIDE)
    centre, leg = _pixel(one, rng.uniform(-0.5, 0.5, 2)), _leg(one)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    away = np.hypot(u - centre[0], v - centre[1]) / leg
    size = rng.uniform(0.1, 0.25)
    return photographed(grey + 60.0 * np.exp(-away) + 400.0 * np.exp(-0.5 * (away / size) ** 4), rng)


def occlusion(share: float) -> Make:
    def make(one: Shot, rng: Rng) -> NDArray[np.uint8]:
        """A patch over a share of the H, from one side."""
        grey = drawn(one, INK, SIDE)
        angle = rng.uniform(0.0, 2.0 * math.pi)
        towards = np.array([math.cos(angle), math.sin(angle)])
        at = rng.uniform(-0.5, 0.5, (4000, 2))
        on = ((np.abs(at[:, 0]) > 0.3) | (np.abs(at[:, 1]) < 0.1))
        edge = np.quantile(at[on] @ towards, 1.0 - share)
        across = np.array([-towards[1], towards[0]])
        patch = np.array([edge * towards + s * across + d * towards for s, d in ((-2, 0), (2, 0), (2, 1.5), (-2, 1.5))])
        pixels = CAMERA.project(place(patch, one.pose, one.level))
        cv2.fillConvexPoly(grey, np.rint(pixels * 16).astype(np.int32), float(rng.uniform(60, 200)), cv2.LINE_AA, 4)
        return photographed(grey, rng)

    return make


def shadow(one: Shot, rng: Rng) -> NDArray[np.uint8]:
    """A hard edge of shadow across the mark; beyond it 30 to 60 % of the light."""
    grey = drawn(one, INK, SIDE)
    angle, at = rng.uniform(0.0, 2.0 * math.pi), _pixel(one, rng.uniform(-0.35, 0.35, 2))
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    beyond = np.clip((u - at[0]) * math.cos(angle) + (v - at[1]) * math.sin(angle) + 0.5, 0.0, 1.0)
    return photographed(grey * (1.0 - beyond * rng.uniform(0.4, 0.7)), rng)


def motion(strokes: float) -> Make:
    def make(one: Shot, rng: Rng) -> NDArray[np.uint8]:
        angle = rng.uniform(0.0, math.pi)
        sweep = strokes * MARK.stroke * _leg(one) * np.array([math.cos(angle), math.sin(angle)])
        return photographed(drawn(one, INK, SIDE), rng, sweep=sweep)

    return make


def nothing(one: Shot, rng: Rng) -> NDArray[np.uint8]:
    """Clutter without the mark."""
    return clutter(Shot(CAMERA, one.attitude, one.level, type(one.pose)(np.array([0.0, 0.0, 1e4]), 0.0)), rng)


def _pixel(one: Shot, at: Floats) -> Floats:
    return CAMERA.project(place(np.atleast_2d(at), one.pose, one.level))[0]


def _leg(one: Shot) -> float:
    return MARK.leg * CAMERA.fy / float(one.pose.position[2])


KINDS: dict[str, tuple[Make, float]] = {  # with the largest tilt [deg]
    "plain": (plain, 5.0), "tilt to 15 deg": (plain, 15.0), "clutter": (clutter, 5.0), "glare": (glare, 5.0),
    "hidden 10 %": (occlusion(0.1), 5.0), "hidden 20 %": (occlusion(0.2), 5.0), "hidden 40 %": (occlusion(0.4), 5.0),
    "shadow edge": (shadow, 5.0), "motion 0.5 strokes": (motion(0.5), 5.0), "motion 1 stroke": (motion(1.0), 5.0),
    "motion 2 strokes": (motion(2.0), 5.0), "no mark": (nothing, 5.0),
}  # fmt: skip


def main(number: int, unknown: bool) -> None:
    eye = AnyHFrontEnd(CAMERA, MOUNT, MARK.leg) if unknown else HMarkFrontEnd(CAMERA, MOUNT, MARK)
    answers = wrong = 0
    print(f"{type(eye).__name__}, {number} pictures of each kind, 3 to 15 m, attitude known")
    print("kind                 how       found   lateral_mm_rms  vertical_mm_rms  angle_deg_rms  beyond_10_sigma")
    for kind, (make, tilt) in KINDS.items():
        rng = np.random.default_rng(sum(map(ord, kind)))
        for how in ("found",) if unknown or kind == "no mark" else ("found", "followed"):
            errors, far = [], 0
            for _ in range(number):
                one = shot(CAMERA, float(rng.uniform(3.0, 15.0)), rng, tilt=math.radians(tilt), stray=0.3)
                guess = PadPrediction(one.pose.position + rng.normal(0, 0.02, 3), one.pose.angle + rng.normal(0, 0.01),
                                      np.full(3, 0.02), 0.01)  # fmt: skip
                seen = eye.see(make(one, rng), one.attitude, guess if how == "followed" else None)
                if seen is None:
                    continue
                error = np.append(seen.position - one.pose.position, wrap_axis(seen.angle - one.pose.angle))
                errors.append(error)
                beyond = np.abs(error) > WRONG * np.append(seen.std_position, seen.std_angle)
                far += bool(kind == "no mark" or beyond.any())
            answers, wrong = answers + len(errors), wrong + far
            rms = np.sqrt(np.mean(np.square(errors), axis=0)) if errors else np.full(4, np.nan)
            print(f"{kind:20s} {how:8s} {len(errors):4d}/{number}  {1e3 * np.hypot(rms[0], rms[1]):13.2f}"
                  f"  {1e3 * rms[2]:15.2f}  {math.degrees(rms[3]):13.3f}  {far:15d}", flush=True)  # fmt: skip
    print(f"{wrong} of {answers} answers wrong by more than {WRONG:.0f} of their own standard deviations")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    words = [word for word in sys.argv[1:] if not word.startswith("-")]
    main(int(words[0]) if words else 60, "--any" in sys.argv)

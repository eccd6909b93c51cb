"""The H beside ArUco and AprilTag: plates of the same size at the same places in the same camera, same light and noise.

python benchmarks/rivals.py [pictures at each height, default 15]

1 m plates: an H of 1 m; tag36h11 of 0.8 m with its white margin, read by cv2.aruco (corners refined two ways, then
IPPE_SQUARE) and by pupil-apriltags. Only the H's front end is told the attitude; height is along the optical axis.
AprilTag's code counts pixels from their corners: its half pixel is taken off.
"""

import math
import sys
import time
from collections.abc import Callable

import cv2
import numpy as np
from drawing import MOUNT, drawn, h_ink, photographed, shot, tag_ink
from numpy.typing import NDArray

from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.sighting import PadPrediction
from flightlog.camera import CameraModel
from flightlog.marks import HMark

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

CAMERA = CameraModel.centred(768, 494, 952.4, 816.3)
HEIGHTS = (1.0, 2.0, 3.0, 5.12, 7.5, 10.0, 13.52, 18.0)
PLATE, TAG, CELLS = 1.0, 0.8, 8


def aruco(refinement: int, offset: float) -> Callable[[Image], Floats | None]:
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = refinement
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(family, settings)
    square = TAG / 2 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]], np.float32)

    def see(image: Image) -> Floats | None:
        corners, ids, _ = detector.detectMarkers(image)
        if ids is None or 0 not in ids.ravel():
            return None
        at = corners[list(ids.ravel()).index(0)].astype(np.float32) - np.float32(offset)
        _, _, position = cv2.solvePnP(square, at, CAMERA.matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        return np.asarray(position, float).ravel()

    return see


def april(decimate: float) -> Callable[[Image], Floats | None]:
    from pupil_apriltags import Detector

    detector = Detector(families="tag36h11", nthreads=1, quad_decimate=decimate)

    def see(image: Image) -> Floats | None:
        lens = (CAMERA.fx, CAMERA.fy, CAMERA.cx + 0.5, CAMERA.cy + 0.5)
        found = [one for one in detector.detect(image, True, lens, TAG) if one.tag_id == 0]
        return np.asarray(found[0].pose_t, float).ravel() if found else None

    return see


def main(number: int) -> None:
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    tag = tag_ink(cv2.aruco.generateImageMarker(family, 0, CELLS, borderBits=1), TAG, PLATE)
    rivals = {
        "ArUco SUBPIX": aruco(cv2.aruco.CORNER_REFINE_SUBPIX, 0.0),
        "ArUco APRILTAG": aruco(cv2.aruco.CORNER_REFINE_APRILTAG, 0.5),
        "pupil-apriltags /1": april(1.0),
        "pupil-apriltags /2": april(2.0),
    }
    eye = HMarkFrontEnd(CAMERA, MOUNT, HMark())
    print(f"{number} pictures at each height, tilt to 5 deg, blur 0.7 px, noise 5 grey levels; median ms of one thread")
    print("height_m  how                  found   bias_mm    std_mm    max_mm  lateral_mm      ms")
    for height in HEIGHTS:
        answers: dict[str, list[tuple[Floats | None, float]]] = {}
        for i in range(number + 1):  # the first warms up
            rng = np.random.default_rng([i, int(100 * height)])
            one = shot(CAMERA, height, rng, tilt=math.radians(5.0), stray=0.25 if height > 2.5 else 0.02)
            truth = one.pose.position
            h = photographed(drawn(one, h_ink(HMark(), 1.5), 1.5), np.random.default_rng(i))
            code = photographed(drawn(one, tag, PLATE), np.random.default_rng(i))
            guess = PadPrediction(truth + rng.normal(0, 0.01, 3), one.pose.angle + 0.01, np.full(3, 0.01), 0.01)

            for name in ("H found", "H followed", *rivals):
                begun = time.thread_time()
                if name in rivals:
                    position = rivals[name](code)
                else:
                    seen = eye.see(h, one.attitude, guess if name == "H followed" else None)
                    position = None if seen is None else seen.position
                took = 1e3 * (time.thread_time() - begun)
                if i:
                    answers.setdefault(name, []).append((None if position is None else position - truth, took))
        for name, rows in answers.items():
            errors = np.array([error for error, _ in rows if error is not None]).reshape(-1, 3)
            ms = float(np.median([took for _, took in rows]))
            if len(errors):
                z = 1e3 * errors[:, 2]
                lateral = 1e3 * math.sqrt(float(np.mean(np.sum(errors[:, :2] ** 2, axis=1))))
                figures = f"{z.mean():8.2f}  {z.std():8.2f}  {np.abs(z).max():8.2f}  {lateral:10.2f}"
            else:
                figures = f"{'-':>8s}  {'-':>8s}  {'-':>8s}  {'-':>10s}"
            print(f"{height:8.2f}  {name:18s} {len(errors):3d}/{number}  {figures}  {ms:6.1f}", flush=True)


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 15)

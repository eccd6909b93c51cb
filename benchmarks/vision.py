"""The front ends on rendered pictures: errors against truth, what the covariance says, time a picture; and beside
ArUco and AprilTag (`rivals.py`).

python benchmarks/vision.py [pictures at each height, default 20]
"""

import math
import sys
import time

import cv2
import numpy as np
import rivals

import assets
from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.horizon import HorizonFrontEnd
from estimators.vision.pose import level_axes, wrap_axis
from estimators.vision.sighting import PadPrediction
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion
from sim.cameras.imaging import Imaging
from sim.cameras.renderer import Renderer
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import compose

DOWN = CameraModel.centred(768, 494, 952.4, 816.3)
FORWARD = CameraModel.centred(640, 480, 560.0)
MARK = HMark()


def pose(renderer: Renderer, position: np.ndarray, q: np.ndarray) -> np.ndarray:
    qpos = renderer.model.qpos0.copy()
    qpos[:3], qpos[3:7] = position, q
    return qpos


def pad(number: int) -> None:
    mount = CameraMount.downward(np.zeros(3))
    spec = {"down": CameraSpec(25.0, 0.04, DOWN, mount)}
    scene = compose(assets.path("vehicles", "raptor90.xml"), "field", MARK, spec, Light())
    front_end, rng = HMarkFrontEnd(DOWN, mount, MARK), np.random.default_rng(0)
    print(f"pad, {number} pictures at each height, attitude known; std as found / as stated; CPU ms of one thread")
    print("height_m  how       seen   lateral_mm    vertical_mm (mean, std)     angle_deg   median_ms  worst_ms")
    with Renderer(scene, {"down": Imaging(colour=False)}, seed=1) as renderer:
        for height in (15.0, 10.0, 6.0, 4.0, 2.5, 1.5, 1.0, 0.7):
            for known in (True, False):
                if not known and height < 2.5:
                    continue
                errors, stated, times = [], [], []
                for i in range(number + 1):
                    q = quaternion(*rng.uniform(-0.06, 0.06, 2), rng.uniform(0, 2 * math.pi))
                    at = np.append(rng.uniform(-0.04, 0.04, 2) * height, height)
                    qvel = np.zeros(renderer.model.nv)
                    qvel[:3], qvel[3:6] = rng.normal(0, 0.3, 3), rng.normal(0, 0.1, 3)
                    image = renderer.frame(FrameRequest("down", 0.0, i, pose(renderer, at, q), qvel, Light()))
                    axes, level = matrix(q) @ mount.axes, level_axes(q, mount)
                    north = axes.T @ np.array([0.0, 1.0, 0.0])
                    truth, angle = -axes.T @ at, math.atan2(north @ level.right, north @ level.forward)
                    guess = PadPrediction(truth + rng.normal(0, 0.01, 3), angle + 0.01, np.full(3, 0.01), 0.01)
                    start = time.thread_time()
                    seen = front_end.see(image, q, guess if known else None)
                    if i == 0:
                        continue  # compiles
                    times.append(1e3 * (time.thread_time() - start))
                    if seen is not None:
                        errors.append([*(seen.position - truth), wrap_axis(seen.angle - angle)])
                        stated.append([*seen.std_position, seen.std_angle])
                if not errors:
                    print(f"{height:8.1f}  {'followed' if known else 'found':8s} {0:3d}/{number}")
                    continue
                e, s = np.array(errors), np.median(stated, axis=0)
                lateral = 1e3 * np.sqrt(np.mean(e[:, :2] ** 2))
                print(
                    f"{height:8.1f}  {'followed' if known else 'found':8s} {len(e):3d}/{number}"
                    f"  {lateral:5.2f} / {1e3 * s[:2].max():7.2f}"
                    f"  {1e3 * e[:, 2].mean():6.2f} {1e3 * e[:, 2].std():6.2f} / {1e3 * s[2]:7.2f}"
                    f"  {np.degrees(e[:, 3].std()):6.3f} / {np.degrees(s[3]):5.3f}"
                    f"  {np.median(times):7.2f}  {max(times):8.2f}"
                )


def horizon(number: int) -> None:
    print("\nhorizon: RMS error / stated std [deg]; CPU ms of one thread")
    print("scene  seen     roll              pitch             median_ms  worst_ms")
    mount = CameraMount.forward(np.array([0.42, 0.0, 0.0]))
    front_end = HorizonFrontEnd(FORWARD, mount)
    for place in ("field", "sea"):
        spec = {"forward": CameraSpec(10.0, 0.04, FORWARD, mount)}
        scene = compose(assets.path("vehicles", "raptor90.xml"), place, MARK, spec, Light())
        rng = np.random.default_rng(1)
        errors, stated, times = [], [], []
        with Renderer(scene, seed=1) as renderer:
            for i in range(number + 1):
                roll, pitch = rng.uniform(-0.4, 0.4), rng.uniform(-0.12, 0.12)
                q = quaternion(roll, pitch, rng.uniform(0, 2 * math.pi))
                qpos = pose(renderer, np.array([0.0, 0.0, rng.uniform(2, 15)]), q)
                image = renderer.frame(FrameRequest("forward", 0.0, i, qpos, np.zeros(renderer.model.nv), Light()))
                start = time.thread_time()
                seen = front_end.see(image)
                times.append(1e3 * (time.thread_time() - start))
                if seen is not None:
                    errors.append([seen.roll - roll, seen.pitch - pitch])
                    stated.append([seen.std_roll, seen.std_pitch])
        rms, s = np.degrees(np.sqrt(np.mean(np.square(errors), axis=0))), np.degrees(np.median(stated, axis=0))
        print(
            f"{place:6s} {len(errors)}/{number + 1}  {rms[0]:6.3f} / {s[0]:6.3f}   {rms[1]:6.3f} / {s[1]:6.3f}"
            f"   {np.median(times[1:]):7.2f}  {max(times[1:]):8.2f}"
        )


if __name__ == "__main__":
    cv2.setNumThreads(1)
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    pad(count)
    horizon(count)
    print()
    rivals.main(count)

"""The pad camera's error model beside the front end on rendered pictures: what its numbers are fitted to.

python benchmarks/pad_camera.py [pictures a height, default 60] [seed]

Each picture: a random attitude, heading, motion and place over the mark; the front end gets the attitude with the
error that the model assumes, and a prediction that is off by its own deviations.
"""

import math
import os
import sys
from dataclasses import dataclass

os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from numpy.typing import NDArray

from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.sighting import PadPrediction
from flightlog.constants import GRAVITY
from flightlog.marks import HMark
from flightlog.rotations import from_vector, matrix, multiply, quaternion
from sim import vehicle
from sim.cameras.imaging import Imaging
from sim.cameras.renderer import Renderer
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import compose
from sim.sensors.contract import Truth
from sim.sensors.pad_camera import PadCamera

Floats = NDArray[np.float64]

HEIGHTS = (16.0, 13.0, 10.0, 7.0, 5.0, 3.5, 2.5, 2.0, 1.6, 1.3, 1.0, 0.8, 0.65, 0.55)  # [m] of the camera
SPREAD = math.radians(2.5)  # [rad] of roll and pitch
AIM = 0.12  # [1] how far from the picture's centre the mark lies, over the height


@dataclass(frozen=True, eq=False)
class Pose:
    """One instant."""

    position: Floats  # (3,) body origin
    attitude: Floats  # (4,)
    velocity: Floats  # (6,) as MuJoCo's free joint has it


def poses(rng: np.random.Generator, height: float, mount: Floats, count: int) -> list[Pose]:
    found = []
    for _ in range(count):
        roll, pitch = SPREAD * rng.standard_normal(2)
        attitude = quaternion(roll, pitch, rng.uniform(0.0, 2.0 * math.pi))
        aside = rng.uniform(-AIM, AIM, 2) * height
        position = np.array([*aside, height]) - matrix(attitude) @ mount
        # under the level camera lies what a tilted one sees elsewhere
        position[:2] += (matrix(attitude)[:2, 2]) * height
        velocity = rng.standard_normal(6) * np.repeat([0.3, 0.1], 3)
        found.append(Pose(position, attitude, velocity))
    return found


def truth(pose: Pose) -> Truth:
    rotation = matrix(pose.attitude)
    zero = np.zeros(3)
    return Truth(
        0.0, pose.position, zero, pose.attitude, rotation, zero, zero, rotation.T @ [0, 0, GRAVITY], 157.0, 49.0, 3.4,
        zero, 101325.0, 288.15,
    )  # fmt: skip


def main(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    raptor, mark = vehicle.load("raptor90"), HMark()
    camera = raptor.cameras["down"]
    site = raptor.site(101325.0, 288.15, np.array([0.0, 22.0, -42.0]))
    numbers = dict(raptor.sensors["pad"].numbers)
    perfect = {"edge_noise": 1e-3, "centre_noise": 0, "size_noise": 0, "angle_noise": 0, "tilt_std": 1e-5,
               "bleed_std": 1e-3, "scale_std": 0, "detection_share": 1, "cut_detection_share": 1}  # fmt: skip

    def model(given: dict[str, float], seed: int) -> PadCamera:
        return PadCamera(given, camera.mount.position, site, np.random.default_rng(seed), camera=camera.model,
                         mount=camera.mount, mark=mark)  # fmt: skip

    exact, front_end = model({**numbers, **perfect}, 0), HMarkFrontEnd(camera.model, camera.mount, mark)
    light = Light()
    compiled = compose(raptor.model, "field", mark, {"down": camera}, light)
    physics = mujoco.MjModel.from_xml_string(compiled.xml, dict(compiled.assets))
    print("errors: RMS of the rendered front end | of the model (deviation that each states)")
    columns = "  ".join(f"{name:>35}" for name in ("x [mm]", "y [mm]", "z [mm]", "angle [mrad]"))
    print(f"{'height':>7} {'found':>10}  {columns}")
    with Renderer(compiled, {"down": Imaging(colour=False)}, seed=seed) as renderer:
        for height in HEIGHTS:
            seen: list[list[Floats]] = [[], []]
            says: list[list[Floats]] = [[], []]
            asked = 0
            for k, pose in enumerate(poses(rng, height, camera.mount.position, count)):
                right = exact.sample(truth(pose))
                if right is None:
                    continue
                asked += 1
                true = np.array([right.x, right.y, right.z, right.angle]) - exact.errors()[:4]
                qpos, qvel = np.zeros(physics.nq), np.zeros(physics.nv)
                qpos[:3], qpos[3:7], qvel[:6] = pose.position, pose.attitude, pose.velocity
                image = renderer.frame(FrameRequest("down", 0.0, k, qpos, qvel, light))
                tilt = np.append(numbers["tilt_std"] * rng.standard_normal(2), 0.0)
                off = np.array([0.02, 0.02, 0.03, 0.01]) * rng.standard_normal(4)
                prediction = PadPrediction(true[:3] + off[:3], true[3] + off[3], np.array([0.02, 0.02, 0.03]), 0.01)
                sighting = front_end.see(image, multiply(pose.attitude, from_vector(tilt)), prediction)
                if sighting is not None:
                    error = np.append(sighting.position, sighting.angle) - true
                    error[3] = math.remainder(error[3], math.pi)
                    seen[0].append(error)
                    says[0].append(np.append(sighting.std_position, sighting.std_angle))
                sensor = model({**numbers, "scale_std": 0.0}, seed + k)
                sample = sensor.sample(truth(pose))
                if sample is not None:
                    seen[1].append(np.array(sensor.errors()[:4]))
                    says[1].append(np.array([sample.std_x, sample.std_y, sample.std_z, sample.std_angle]))
            cells = []
            for axis in range(4):
                cell = []
                for errors, stated in zip(seen, says, strict=True):
                    if errors:
                        rms = 1e3 * math.sqrt(np.mean(np.array(errors)[:, axis] ** 2))
                        cell.append(f"{rms:7.2f} ({1e3 * np.median(np.array(stated)[:, axis]):6.2f})")
                cells.append(" |".join(cell))
            found = f"{len(seen[0]):3d}|{len(seen[1]):3d}/{asked:3d}"
            print(f"{height:6.2f}m {found}  " + "  ".join(f"{cell:>35}" for cell in cells))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 60, int(sys.argv[2]) if len(sys.argv) > 2 else 0)

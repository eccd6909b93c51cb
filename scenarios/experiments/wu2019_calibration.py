"""Calibration of the landing camera from rendered chessboards (Wu 2019, section 2.1), against the true lens."""

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimators.vision.calibration import Calibration, Chessboard, calibrate, find_board
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec
from scenarios.experiments.contract import Effort, Figure, Floats, Job, Outcome, Picture, Plot, Series
from sim.cameras.imaging import Imaging
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import FAR, SHADOW, SUN, VEHICLE, CompiledScene

NAME = "calibration"
SYSTEM = "wu2019"
TITLE = "Calibration from chessboards"
ABOUT = (
    "The paper calibrates its camera with a chessboard, the usual way, and gives no figures. Here the world's own "
    "camera, with a lens that bends lines by some ten pixels at the corners and with blur and noise, looks at a "
    "chessboard from some twenty sides; what OpenCV's calibration makes of the pictures is compared with the camera."
)

# the half-inch camera of the landing, with a lens as its makers sell them
TRUE = CameraModel(768, 494, 952.4, 816.3, 389.2, 241.7, (-0.21, 0.11, 6e-4, -4e-4, 0.0))
BOARD = Chessboard()
MARGIN = 0.05  # [m] white around the squares
PICTURES = {"full": 24, "quick": 12}
SETS = {"full": 4, "quick": 1}
NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")


def _scene() -> CompiledScene:
    """A chessboard upright at the world's origin, and a camera free to fly about it."""
    across, up = (BOARD.columns + 1) * BOARD.square / 2, (BOARD.rows + 1) * BOARD.square / 2
    spec = CameraSpec(1.0, 0.0, TRUE, CameraMount(np.zeros(3), np.eye(3)), colour=False)
    scene = CompiledScene("", {}, None, Light(), False, {"board": spec})
    seen = scene.rendered("board")
    pixel = 1e-5
    intrinsics = (
        f'resolution="{seen.width} {seen.height}" sensorsize="{seen.width * pixel} {seen.height * pixel}" '
        f'focalpixel="{seen.fx} {seen.fy}" '
        f'principalpixel="{(seen.width - 1) / 2 - seen.cx} {(seen.height - 1) / 2 - seen.cy}"'
    )
    xml = f"""
    <mujoco>
      <visual>
        <global offwidth="{max(seen.width, 640)}" offheight="{max(seen.height, 480)}"/>
        <map znear="0.01"/>
      </visual>
      <asset>
        <texture name="squares" type="2d" builtin="checker" rgb1="0.9 0.9 0.9" rgb2="0.05 0.05 0.05"
          width="512" height="512"/>
        <material name="board" texture="squares" texrepeat="{(BOARD.columns + 1) / 2} {(BOARD.rows + 1) / 2}"
          specular="0" shininess="0"/>
        <material name="{FAR}" rgba="0.5 0.5 0.5 1"/>
      </asset>
      <worldbody>
        <light name="{SUN}" directional="true" castshadow="false"/>
        <geom type="plane" size="{across} {up} 1" material="board"/>
        <geom type="plane" size="{across + MARGIN} {up + MARGIN} 1" pos="0 0 -0.002" rgba="0.9 0.9 0.9 1"/>
        <geom type="plane" size="20 20 1" pos="0 0 -1" rgba="0.35 0.37 0.36 1"/>
        <body name="{SHADOW}" mocap="true" pos="0 0 -5"/>
        <body name="{VEHICLE}">
          <joint name="{VEHICLE}" type="free"/>
          <inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>
          <camera name="board" xyaxes="1 0 0 0 -1 0" {intrinsics}/>
        </body>
      </worldbody>
    </mujoco>"""
    return CompiledScene(xml, scene.assets, scene.mark, scene.light, scene.dip, scene.cameras)


def _views(rng: np.random.Generator, count: int) -> list[tuple[Floats, Floats]]:
    """Positions (3,) and rotations (3, 3) (columns: the camera's axes) from which the whole board is in the picture."""
    across, up = (BOARD.columns + 1) * BOARD.square / 2, (BOARD.rows + 1) * BOARD.square / 2
    ends = np.array([(-across, -up, 0.0), (across, -up, 0.0), (across, up, 0.0), (-across, up, 0.0)])
    views: list[tuple[Floats, Floats]] = []
    while len(views) < count:
        away = rng.uniform(1.3, 2.3)
        # from which side: the farther aslant, the better focal length and distance are told apart
        slant, around = math.radians(rng.uniform(5.0, 45.0)), rng.uniform(0.0, 2.0 * math.pi)
        side = np.array([math.sin(slant) * math.cos(around), math.sin(slant) * math.sin(around), math.cos(slant)])
        place, aim = away * side, np.array([*rng.uniform(-0.35, 0.35, 2), 0.0])
        z = (aim - place) / np.linalg.norm(aim - place)
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        # turned every way about the optical axis: a principal point and a tilt look alike from one side only
        turn = cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-math.pi, math.pi)]))[0]
        axes = np.asarray(np.column_stack([x, np.cross(z, x), z]) @ turn, float)
        if TRUE.contains(TRUE.project((ends - place) @ axes), 8.0).all():
            views.append((place, axes))
    return views


def take(seed: int, pictures: int) -> tuple[Calibration, list[Floats], int, NDArray[np.uint8]]:
    """One calibration, the corners (N, 2) [px] by picture, the number of pictures without board, the first picture."""
    from sim.cameras.renderer import Renderer

    rng = np.random.default_rng(seed)
    light = Light(sun_elevation=math.radians(60.0))
    seen, first = [], None
    with Renderer(_scene(), {"board": Imaging(colour=False)}, seed=seed) as renderer:
        for number, (place, axes) in enumerate(_views(rng, pictures)):
            qpos = np.concatenate([place, Rotation.from_matrix(axes).as_quat(scalar_first=True)])
            image = renderer.frame(FrameRequest("board", 0.0, number, qpos, np.zeros(6), light))
            corners = find_board(image, BOARD)
            if corners is not None:
                seen.append(corners)
            if first is None:
                first = image
    assert first is not None
    return calibrate(seen, BOARD, TRUE.width, TRUE.height), seen, pictures - len(seen), first


def _numbers(camera: CameraModel) -> Floats:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy, *camera.distortion[:4]])


def bent(camera: CameraModel, truth: CameraModel = TRUE) -> Floats:
    """By how much a camera's rays are wrong (H, W) [px of the true camera], everywhere in the picture."""
    y, x = np.mgrid[: truth.height : 8, : truth.width : 8]
    pixels = np.stack([x, y], axis=-1).reshape(-1, 2).astype(float)
    wrong = truth.project(camera.rays(pixels)) - pixels
    return np.asarray(np.linalg.norm(wrong, axis=1).reshape(x.shape))


def jobs(effort: Effort) -> Sequence[Job]:
    """One calibration each."""
    count = PICTURES[effort]
    return [Job(take, (20190826 + k, count), f"chessboards {k + 1}", 0.5 * count) for k in range(SETS[effort])]


def conclude(effort: Effort, answers: Sequence[Any]) -> Outcome:
    """Errors of the intrinsics, and what they cost ten metres up."""
    found: list[Calibration] = [answer[0] for answer in answers]
    truth = _numbers(TRUE)
    errors = np.array([_numbers(item.camera) - truth for item in found])
    stated = np.array([item.std[:8] for item in found])
    rms = np.sqrt(np.mean(errors**2, axis=0))
    wrong = [bent(item.camera) for item in found]
    uncalibrated = bent(CameraModel.centred(TRUE.width, TRUE.height, TRUE.fx, TRUE.fy))
    figures = [
        Figure("focal length, worst error", "%", None, None, float(100 * np.max(np.abs(errors[:, :2] / truth[:2]))),
               bar=0.1, bound=float(100 * np.mean(stated[:, :2] / truth[:2]))),
        Figure("principal point, worst error", "px", None, None, float(np.max(np.abs(errors[:, 2:4]))), bar=1.0,
               bound=float(np.mean(stated[:, 2:4]))),
        Figure("k1, worst error", "1", None, None, float(np.max(np.abs(errors[:, 4]))), bar=0.01,
               bound=float(np.mean(stated[:, 4]))),
        Figure("rays over the whole picture, RMS error", "px", None, None,
               float(np.sqrt(np.mean(np.square(wrong)))), bar=0.3,
               note=f"without calibration {np.sqrt(np.mean(uncalibrated**2)):.1f}"),
        Figure("corners, RMS residual", "px", None, None, float(np.mean([item.residual for item in found])), bar=0.1),
    ]  # fmt: skip
    rows = [
        {"number": name, "true": float(t), "found": float(v), "stated std": float(s), "RMS error": float(r)}
        for name, t, v, s, r in zip(NAMES, truth, _numbers(found[0].camera), stated[0], rms, strict=True)
    ]
    diagonal = np.hypot(*np.meshgrid(
        np.arange(0, TRUE.width, 8) - TRUE.cx, np.arange(0, TRUE.height, 8) - TRUE.cy
    )).ravel()  # fmt: skip
    order = np.argsort(diagonal)
    lines = [Series("not calibrated", diagonal[order][::20], uncalibrated.ravel()[order][::20], "points")]
    lines += [
        Series(f"calibration {k + 1}", diagonal[order][::20], np.maximum(item.ravel()[order][::20], 1e-4), "points")
        for k, item in enumerate(wrong)
    ]
    image = cv2.cvtColor(answers[0][3], cv2.COLOR_GRAY2RGB)
    board = find_board(answers[0][3], BOARD)
    if board is not None:
        cv2.drawChessboardCorners(image, (BOARD.columns, BOARD.rows), board.astype(np.float32), True)
    blind = sum(answer[2] for answer in answers)
    normalised = float(np.sqrt(np.mean((errors / stated) ** 2)))
    notes = [
        f"{len(found)} calibrations of {PICTURES[effort]} pictures each; the board was missed in {blind}.",
        f"Errors over their stated standard deviations: RMS {normalised:.2f} (1 where the corners' errors are white).",
        f"A focal length wrong by {100 * rms[1] / truth[1]:.3f} % is a height wrong by "
        f"{10e3 * rms[1] / truth[1]:.1f} mm at 10 m.",
    ]
    return Outcome(
        figures,
        plots=[Plot("Error of the rays", "Distance between where a ray is and where the calibrated camera has it.",
                    "distance from the principal point [px]", "error [px]", lines, log_y=True)],
        pictures=[Picture("A chessboard as the world's camera shows it", "With the corners found.", np.asarray(image))],
        notes=notes,
        tables=[("Intrinsics of the first calibration", rows)],
    )  # fmt: skip

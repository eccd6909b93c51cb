"""Makes docs/landing.jpg: a landing seen from beside the pad, and what the down camera sees with the mark found in it.

python docs/pictures.py
"""

import tempfile
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.h_mark import HMarkFrontEnd
from flightlog.marks import HMark
from flightlog.readers.folder import read_flight
from flightlog.rotations import quaternion
from scenarios.cameras import imaging
from scenarios.flight import fly
from scenarios.load import load
from sim import vehicle as vehicles
from sim.cameras.renderer import Renderer
from sim.cameras.request import FrameRequest
from sim.scene import compose

WIDTH, HEIGHT = 1200, 620
HEIGHTS = (4.3, 2.75, 1.2)  # [m] at which the helicopter is shown
GREEN = (140, 255, 90)  # BGR

Picture = NDArray[np.uint8]


def poses(folder: Path) -> list[NDArray[np.float64]]:
    """Free joint positions (7,) at HEIGHTS on the way down."""
    state = read_flight(folder).truth["state"]
    start = int(np.flatnonzero(state["u"] > 9.0)[-1])
    rows = [start + int(np.argmin(np.abs(state["u"][start:] - height))) for height in HEIGHTS]
    return [
        np.concatenate([state.stack("e", "n", "u")[k], quaternion(*state.stack("roll", "pitch", "heading")[k])])
        for k in rows
    ]


def main() -> None:
    """Fly, render, and put the pictures together."""
    scenario = load("landing")
    vehicle = vehicles.load(scenario.vehicle)
    with tempfile.TemporaryDirectory() as place:
        fly(scenario, seed=1, cameras=False, folder=Path(place) / "flight")
        way = poses(Path(place) / "flight")
    light = scenario.light.light()
    scene = compose(vehicle.model, scenario.scene, HMark(), vehicle.cameras, light)
    with Renderer(scene, imaging(vehicle.cameras, scenario.cameras), samples=4) as renderer:

        def qpos(pose: NDArray[np.float64], turned: float) -> NDArray[np.float64]:
            return np.concatenate([pose, [turned], np.zeros(renderer.model.nq - 8)])

        views = [
            renderer.picture(
                qpos(pose, 0.4 + k), light, look_at=np.array([0.0, 0.0, 2.1]), azimuth_deg=142.0, elevation_deg=-11.0,
                distance=7.2, width=WIDTH, height=HEIGHT,
            )
            for k, pose in enumerate(way)
        ]  # fmt: skip
        # where the helicopter is, each picture differs from the others: the lowest one's picture carries all of them
        picture = views[-1].copy()
        empty = np.median(np.stack(views), axis=0)
        for view in views[:-1]:
            changed = np.abs(view.astype(float) - empty).max(axis=2) > 10
            picture[changed] = view[changed]
        close = qpos(way[1], 0.3)
        frame = renderer.frame(FrameRequest("down", 0.0, 0, close, np.zeros(renderer.model.nv), light))
    camera = vehicle.cameras["down"]
    seen = HMarkFrontEnd(camera.model, camera.mount, HMark()).see(frame, way[1][3:7])
    inset = cv2.cvtColor(frame, cv2.COLOR_GRAY2BGR)
    if seen is not None:
        cv2.polylines(inset, [np.rint(seen.outline * 16).astype(np.int32)], True, GREEN, 2, cv2.LINE_AA, 4)
    inset = cv2.resize(inset, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    out = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
    h, w = inset.shape[:2]
    out[20 : 20 + h, WIDTH - 20 - w : WIDTH - 20] = inset
    cv2.rectangle(out, (WIDTH - 21 - w, 19), (WIDTH - 20, 20 + h), (255, 255, 255), 1)
    cv2.imwrite(str(Path(__file__).with_name("landing.jpg")), out, [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()

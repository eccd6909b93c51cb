"""Runs the loop once before the clock starts, so that compiling never happens in flight.

Kernels are compiled at their first call, once on a machine; later processes still load them from the cache. The
rehearsal flies half a second in a world of its own and shows the front end one drawn picture: nothing of it stays.
"""

from functools import cache

import cv2
import numpy as np

from estimators.vision.flow import KeyFrameFlowEye
from estimators.vision.h_mark import HMarkFrontEnd
from estimators.vision.horizon import HorizonFrontEnd
from estimators.vision.sighting import PadPrediction
from flightlog.equipment import Equipment
from flightlog.marks import HMark
from flightlog.rotations import quaternion
from flightlog.signals import Frame
from scenarios.crew import make_navigator, make_pilot
from scenarios.schema import Scenario
from scenarios.staging import make_equipment, make_world
from sim import vehicle as vehicles
from sim.world import STEP

STEPS = 150  # 0.6 s: every sensor has spoken, the slowest with its latency
HEIGHT = 8.0  # [m] from which the drawn mark is seen


@cache
def rehearse(*, sees: bool) -> None:
    """Call everything that compiles; once a process. `sees`: vision too."""
    scenario = Scenario(vehicle="raptor90")
    vehicle = vehicles.load(scenario.vehicle)
    with make_world(scenario, np.random.SeedSequence(0), vehicle, cameras=False) as world:
        equipment = make_equipment(scenario, vehicle, world)
        navigator = make_navigator(equipment, scenario, False)
        pilot = make_pilot(vehicle, world.site, scenario, 0.0)
        controls = world.trim.controls
        for _ in range(STEPS):
            world.step(controls)
            state = navigator.update(world.measure())
            if world.t > STEPS / 2 * STEP:
                controls = pilot.update(state)
    if sees:
        _look(equipment)


def _look(equipment: Equipment) -> None:
    """Find a drawn mark, then follow it; find a drawn horizon; see the ground stand still."""
    camera = equipment.cameras["down"]
    mark = HMark()
    front_end = HMarkFrontEnd(camera.model, camera.mount, mark)
    outline = mark.outline()
    # north up in the picture of a camera that looks down heading north: y of the camera is south
    points = np.column_stack([outline[:, 0], -outline[:, 1], np.full(len(outline), HEIGHT)])
    image = np.full((camera.model.height, camera.model.width), 60, np.uint8)
    cv2.fillPoly(image, [np.rint(camera.model.project(points)).astype(np.int32)], 200)
    attitude = quaternion(0.0, 0.0, 0.0)
    for height in (HEIGHT, HEIGHT + 0.05):
        prediction = PadPrediction(np.array([0.0, 0.0, height]), 0.0, np.full(3, 0.05), 0.02)
        front_end.see(image, attitude, prediction)
    front_end.see(cv2.GaussianBlur(image, (3, 3), 0.8).astype(np.uint8), attitude, None)
    ahead = equipment.cameras["forward_a"]
    land = np.full((ahead.model.height, ahead.model.width, 3), 200, np.uint8)
    land[ahead.model.height // 2 :] = 60
    HorizonFrontEnd(ahead.model, ahead.mount).see(land)
    down = KeyFrameFlowEye(camera.model)
    ground = np.random.default_rng(0).integers(60, 180, image.shape, np.uint8)
    for k in range(2):
        down.see(Frame(0.04 * k, 0.04 * k, "down", ground))

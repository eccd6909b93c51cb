"""When the world's devices look, and when what they saw arrives."""

from collections import deque

import numpy as np
import pytest

from flightlog.marks import HMark
from flightlog.signals import Frame
from sim import vehicle
from sim.cameras.request import FrameRequest
from sim.schedule import TICK
from sim.world import STEP, World


def test_the_imu_misses_none_of_the_force_whoever_else_looks_in_between():
    """Means over the time since the IMU's last sample add up to the change of velocity, to rounding."""
    raptor = vehicle.load("raptor90")
    odd = {"sonar": {"rate": 20.0}, "baro": {"rate": 100.0}}  # every 25 and 5 ticks: between two of the IMU's
    with World(raptor, seeds=np.random.SeedSequence(3), mark=HMark(), sensor_numbers=odd) as world:
        forces = []
        imu = world._sensors["imu"]
        sample = imu.sample

        def look(truth):
            forces.append(truth.rotation @ truth.specific_force - [0.0, 0.0, 9.80665])
            return sample(truth)

        imu.sample = look
        controls = world.controls._replace(collective=world.controls.collective + 0.01, lateral=0.01)
        for _ in range(250):
            world.step(controls)
        gained = world._qvel[:3].copy()
    assert np.linalg.norm(gained) > 0.5
    np.testing.assert_allclose(np.sum(forces, axis=0) * STEP, gained, atol=1e-9)


class Dark:
    """Eyes that hand out black pictures in the order of exposure."""

    def __init__(self, scene):
        self.waiting = deque()

    def submit(self, request: FrameRequest) -> None:
        self.waiting.append(request)

    def collect(self):
        return self.waiting.popleft(), np.zeros((2, 2), np.uint8)

    def close(self):
        pass


def test_pictures_are_of_their_exposure_and_arrive_after_their_latency():
    raptor = vehicle.load("raptor90")
    with World(raptor, seeds=np.random.SeedSequence(3), mark=HMark(), eyes=Dark) as world:
        seen = []
        for _ in range(150):
            world.step(world.controls)
            seen += [(world.t, frame) for frame in world.measure() if isinstance(frame, Frame)]
    assert {frame.camera for _, frame in seen} == {"down", "forward_a", "forward_b"}
    for now, frame in seen:
        spec = raptor.cameras[frame.camera]
        assert frame.t * spec.rate == pytest.approx(round(frame.t * spec.rate), abs=1e-9)
        assert frame.t_arrival == pytest.approx(frame.t + spec.latency, abs=1e-12)
        assert frame.t_arrival - TICK / 2 < now < frame.t_arrival + STEP + TICK / 2

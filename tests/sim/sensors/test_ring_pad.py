"""The pad camera's error model over the ring mark."""

import math

import numpy as np
import pytest

from flightlog.marks import RingMark
from sim.sensors.pad_camera import PadCamera

SILENT = {
    "edge_noise": 1e-3, "centre_noise": 0.0, "size_noise": 0.0, "angle_noise": 0.0, "tilt_std": 1e-5, "bleed_std": 1e-3,
    "scale_std": 0.0, "detection_share": 1.0, "cut_detection_share": 1.0, "least_distance": 0.1, "least_visible": 0.005,
}  # fmt: skip


def over_ring(bench, **changed):
    camera = bench.vehicle.cameras["down"]
    numbers = {**bench.numbers("pad"), **SILENT, **changed}
    rng = np.random.default_rng(0)
    return PadCamera(numbers, camera.mount.position, bench.site, rng, camera=camera.model, mount=camera.mount,
                     mark=RingMark())  # fmt: skip


def look(bench, sensor, height, heading=0.0):
    mount = bench.vehicle.cameras["down"].mount.position
    return next(bench.rest(sensor, 1, position=(0.0, 0.0, height - mount[2]), heading=heading))


@pytest.mark.parametrize("heading", [0.0, 1.0, 2.5, 4.0, 6.0])
def test_the_ring_s_angle_is_known_all_around(bench, heading):
    sample = look(bench, over_ring(bench), 5.0, heading)
    assert math.remainder(sample.angle + heading, 2 * math.pi) == pytest.approx(0.0, abs=1e-3)
    assert -math.pi < sample.angle <= math.pi


@pytest.mark.parametrize("height", [10.0, 3.0, 1.0, 0.4, 0.15])
def test_something_of_the_ring_mark_is_seen_down_to_the_ground(bench, height):
    sample = look(bench, over_ring(bench, edge_noise=0.1), height)
    assert sample is not None
    assert sample.z == pytest.approx(height, abs=5 * sample.std_z)
    assert sample.std_x < 1e-3 * height


def test_small_parts_count_only_where_they_can_be_told_apart(bench):
    """High up the grid's holes are grey; near the ground they are what is left."""
    high, low = (look(bench, over_ring(bench, edge_noise=0.1), height) for height in (6.0, 0.3))
    assert low.quality < 0.2 < high.quality
    assert math.degrees(low.std_angle) < 0.2

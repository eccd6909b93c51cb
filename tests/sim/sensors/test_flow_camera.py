"""Flow without pictures: the projection is exact, the errors are those declared."""

import math

import numpy as np
import pytest

from flightlog.rotations import matrix, quaternion
from flightlog.signals import FlowSample

QUIET = {"noise": 0.0, "slow_noise": 0.0, "key_noise": 0.0, "detection_share": 1.0}


def test_it_sees_where_the_key_frames_middle_has_gone(bench, truth):
    sensor = bench.build("flow", **QUIET)
    camera = bench.vehicle.cameras["down"]
    poses = [((0.0, 0.0, 1.0), (0.02, -0.03, 0.5)), ((0.04, -0.02, 1.01), (0.05, 0.01, 0.52))]
    samples = []
    for k, (place, (roll, pitch, heading)) in enumerate(poses):
        samples.append(sensor.sample(truth(0.04 * k, position=place, roll=roll, pitch=pitch, heading=heading)))
    assert samples[0] is None
    (p, a), (p_2, a_2) = [(np.array(place), quaternion(*angles)) for place, angles in poses]
    eye, eye_2 = p + matrix(a) @ camera.mount.position, p_2 + matrix(a_2) @ camera.mount.position
    ahead = (matrix(a) @ camera.mount.axes)[:, 2]
    seen = (matrix(a_2) @ camera.mount.axes).T @ (eye - ahead * eye[2] / ahead[2] - eye_2)
    assert samples[1].u == pytest.approx(seen[0] / seen[2], abs=1e-12)
    assert samples[1].v == pytest.approx(seen[1] / seen[2], abs=1e-12)
    assert samples[1].dt == pytest.approx(0.04)


def test_moving_east_the_picture_moves_left_and_a_new_key_frame_follows(bench, truth):
    sensor = bench.build("flow", **QUIET)
    samples = [sensor.sample(truth(0.04 * k, position=(0.02 * k, 0.0, 1.0))) for k in range(60)]
    moving = [s for s in samples if s is not None]
    assert all(s.u < 0.0 for s in moving)
    keys = {round(s.t - s.dt, 6) for s in moving}
    assert 2 <= len(keys) <= 6
    assert min(s.quality for s in moving) > 0.3


def test_errors_are_as_large_as_declared(bench, truth):
    """At rest: white and slow together within a picture, white alone from one to the next."""
    sensor = bench.build("flow", detection_share=1.0, noise=0.1, slow_noise=0.2, slow_tau=0.4, key_noise=0.0)
    still = truth(position=(0.0, 0.0, 1.0))
    values = []
    for k in range(20_000):
        still.t = 0.04 * k
        sample = sensor.sample(still)
        if isinstance(sample, FlowSample):
            values.append(sample.u * bench.vehicle.cameras["down"].model.fx)
    assert np.std(values) == pytest.approx(math.hypot(0.1, 0.2), rel=0.05)
    steps = np.diff(values)
    slow = 2.0 * 0.2**2 * (1.0 - math.exp(-0.04 / 0.4))
    assert np.std(steps) == pytest.approx(math.sqrt(2.0 * 0.1**2 + slow), rel=0.03)


def test_what_a_key_frame_has_wrong_stays_until_the_next(bench, truth):
    sensor = bench.build("flow", **{**QUIET, "key_noise": 0.5})
    still = truth(position=(0.0, 0.0, 1.0))
    values = []
    for k in range(50):
        still.t = 0.04 * k
        sample = sensor.sample(still)
        values += [] if sample is None else [sample.u]
    assert np.ptp(values) < 1e-12
    assert abs(values[0]) > 1e-6


def test_on_the_ground_upside_down_or_too_high_there_is_nothing(bench, truth):
    for given in ({"position": (0.0, 0.0, 0.2)}, {"roll": 2.0}, {"position": (0.0, 0.0, 500.0)}):
        sensor = bench.build("flow", **QUIET)
        assert all(sensor.sample(truth(0.04 * k, **given)) is None for k in range(3))

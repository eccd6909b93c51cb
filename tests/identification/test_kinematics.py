"""What the filter of the motion expects of sensors, against motions in closed form."""

import numpy as np
import pytest
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from identification import kinematics as k
from sim.world import MAGNETIC_FIELD

Floats = NDArray[np.float64]

RATE, STEP, SPAN = 250.0, 0.04, 4.0
ARM = np.array([-0.6, 0.0, 0.1])  # [m] of the receiver's antenna


def heading(t: Floats) -> Floats:
    return 0.8 * np.sin(4.0 * t)


def turned(v: Floats, t: Floats) -> Floats:
    """(M, 3) body to world."""
    c, s = np.cos(heading(t)), np.sin(heading(t))
    return np.column_stack([c * v[0] - s * v[1], s * v[0] + c * v[1], np.full(len(t), v[2])])


def east(t: Floats) -> Floats:
    return np.sin(3.0 * t)


def innovations(kinds: NDArray[np.int64], times: Floats, values: Floats) -> Floats:
    """(M,) of measurements at any times, along a swing that yaws, begun as it is."""
    imu_t = np.arange(0.0, SPAN, 1.0 / RATE)
    middle = imu_t - 0.5 / RATE  # force is a mean over its sample, rate an instant's
    force = -9.0 * np.sin(3.0 * middle)
    c, s = np.cos(heading(middle)), np.sin(heading(middle))
    imu = np.column_stack([
        c * force, -s * force, np.full(len(imu_t), GRAVITY), 0.0 * imu_t, 0.0 * imu_t, 3.2 * np.cos(4.0 * imu_t)
    ])  # fmt: skip
    edges = np.arange(0, len(imu_t) + 1, round(STEP * RATE))
    ends = imu_t[edges[1:] - 1]
    node = np.searchsorted(ends, times - 1e-9)
    first = np.searchsorted(node, np.arange(len(ends) + 1))
    start = np.array([0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    setup = np.zeros((6, 3))
    setup[0] = ARM
    m, n = len(times), len(ends)
    answers = np.zeros((m, 3))
    prior, nothing, decay = np.full(k.STATES, 1e-12), np.zeros(k.STATES), np.ones(k.STATES)
    k.track(
        imu_t, imu, edges, first, kinds, times, values, np.ones(m), np.zeros(m), np.zeros(m), start, setup,
        MAGNETIC_FIELD, prior, nothing, decay, np.zeros((n, 15)), np.zeros((len(imu_t), 10)), np.zeros((m, k.STATES)),
        np.zeros((m, k.STATES)), answers,
    )  # fmt: skip
    return answers[:, 0]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_receiver_is_expected_to_say_what_held_between_two_nodes(axis: int) -> None:
    """Swings of 9 m/s^2 and 13 rad/s^2: 20 ms are 0.2 m/s of the antenna's velocity."""
    times = np.sort(np.random.default_rng(1).uniform(0.1, SPAN - 0.1, 60))
    antenna = turned(ARM, times)
    rate = 3.2 * np.cos(4.0 * times)
    around = np.column_stack([-rate * antenna[:, 1], rate * antenna[:, 0]])
    velocity = np.column_stack([3.0 * np.cos(3.0 * times), np.zeros(len(times))]) + around
    place = np.column_stack([east(times), np.zeros(len(times))]) + antenna[:, :2]
    of = np.full(len(times), k.GPS_V + axis)
    assert np.abs(innovations(of, times, velocity[:, axis])).max() < 0.01
    assert np.abs(innovations(np.full(len(times), k.GPS + axis), times, place[:, axis])).max() < 0.005
    # the test can fail: a fix that is stamped a node later
    assert np.abs(innovations(of, times + STEP, velocity[:, axis])).max() > 0.2


def test_a_magnetometer_is_expected_to_say_what_held_between_two_nodes() -> None:
    times = np.sort(np.random.default_rng(2).uniform(0.1, SPAN - 0.1, 60))
    c, s = np.cos(heading(times)), np.sin(heading(times))
    field = c * MAGNETIC_FIELD[0] + s * MAGNETIC_FIELD[1]
    of = np.full(len(times), k.FIELD)
    assert np.abs(innovations(of, times, field)).max() < 0.1
    assert np.abs(innovations(of, times + STEP, field)).max() > 1.0

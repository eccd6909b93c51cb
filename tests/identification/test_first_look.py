"""Echoes that stand alone are left out; a receiver far off the mark is found, a usual or drifting one is left alone."""

import numpy as np
import pytest

from flightlog.rotations import matrix, quaternion
from identification import kinematics as k
from identification.first_look import displaced, lonely


@pytest.mark.parametrize("seed", range(5))
def test_echoes_from_nowhere_are_left_out_and_the_ground_is_kept(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0, 0.05)
    ground = 4.0 + 3.0 * np.cos(0.3 * t)  # sinks at 0.9 m/s
    reach = ground < 3.05
    heard = np.where(reach, rng.random(len(t)) > 0.02, rng.random(len(t)) < 0.05)
    value = np.where(reach, ground, rng.uniform(0.15, 3.05, len(t)))
    alone = lonely(heard, value)
    assert np.mean(alone[heard & reach]) < 0.02
    assert np.mean(alone[heard & ~reach]) > 0.95


def look(error: np.ndarray, drift: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 30.0, 0.02)
    place = np.column_stack([2.0 * np.sin(0.2 * t), np.cos(0.2 * t), 5.0 + 0.0 * t])
    attitude = np.array([quaternion(0.1, -0.05, 0.2 * x) for x in t])
    samples = np.column_stack([place, 0.0 * place, attitude])
    setup = np.zeros((6, 3))
    setup[0], setup[3] = (-0.6, 0.0, 0.1), (0.0, 0.0, -0.1)
    fixes = np.arange(0.0, 30.0, 0.2)
    sight = np.arange(6.0, 28.0, 0.04)
    turns = [matrix(quaternion(0.1, -0.05, 0.2 * x)) for x in np.concatenate([fixes, sight])]
    there = np.column_stack([np.interp(np.concatenate([fixes, sight]), t, c) for c in place.T])
    count = len(fixes)
    gps = there[:count] + [r @ setup[0] for r in turns[:count]] + error + np.outer(fixes, drift)
    gps += 0.05 * rng.standard_normal(gps.shape)
    down = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    mark = np.array([down.T @ (r.T @ -p - setup[3]) for r, p in zip(turns[count:], there[count:], strict=True)])
    kinds = np.repeat([k.GPS, k.GPS + 1, k.GPS + 2, k.PAD, k.PAD + 1, k.PAD + 2], [count] * 3 + [len(sight)] * 3)
    times = np.concatenate([np.tile(fixes, 3), np.tile(sight, 3)])
    return displaced(t, samples, kinds, times, np.concatenate([gps.T.ravel(), mark.T.ravel()]), setup, np.full(3, 0.6))


def test_a_receiver_far_off_the_mark_is_found() -> None:
    found = look(np.array([5.5, 0.3, -0.2]), np.zeros(3))
    assert found is not None
    assert found[0] == pytest.approx([5.5, 0.3, -0.2], abs=0.05)
    assert np.all(found[1] < 0.5)


def test_a_usual_error_and_a_drift_are_left_to_the_filter() -> None:
    assert look(np.array([1.0, -1.2, 0.5]), np.zeros(3)) is None
    assert look(np.zeros(3), np.array([0.2, 0.0, 0.0])) is None

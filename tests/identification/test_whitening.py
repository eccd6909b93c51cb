"""What is linear about the filters: signatures against the filters run again, tick means, and the shake taken out."""

import numpy as np
from numpy.typing import NDArray

from identification.drive import Noise
from identification.dynamics import innovations
from identification.grid import smooth
from identification.vibration import calm
from identification.whitening import drive_signatures

Floats = NDArray[np.float64]

NODES = 80
STEP = 0.04


def _filter(answer: Floats, measured: Floats, gust: Floats, noise: Noise) -> tuple[Floats, Floats, Floats]:
    gains, spreads, out = np.zeros((NODES, 7, 7)), np.zeros((NODES, 7)), np.zeros((NODES, 7))
    innovations(
        answer, measured, gust, STEP, noise.keep(STEP), np.array(noise.gust_std), np.array(noise.process),
        np.array(noise.noise), gains, spreads, out,
    )  # fmt: skip
    return gains, spreads, out / spreads


def test_the_signature_of_a_changed_model_is_what_the_filter_makes_of_it() -> None:
    rng = np.random.default_rng(3)
    noise = Noise()
    answer, measured = rng.normal(size=(2, NODES, 7))
    gust = 0.3 * rng.normal(size=(NODES, 7, 3))
    gains, spreads, before = _filter(answer, measured, gust, noise)
    change = rng.normal(size=(NODES, 7))
    _, _, after = _filter(answer + change, measured, gust, noise)
    found = drive_signatures(gust, gains, spreads, STEP, noise.keep(STEP), change[:, :, None], np.zeros((NODES, 7, 1)))
    assert np.allclose(found[:, :, 0], after - before, atol=1e-9)


def test_the_signature_of_a_changed_measurement_is_what_the_filter_makes_of_it() -> None:
    rng = np.random.default_rng(4)
    noise = Noise()
    answer, measured = rng.normal(size=(2, NODES, 7))
    gust = 0.3 * rng.normal(size=(NODES, 7, 3))
    gains, spreads, before = _filter(answer, measured, gust, noise)
    change = rng.normal(size=(NODES, 7))
    change[0, 3:] = 0.0  # a first reading is where the count begins
    _, _, after = _filter(answer, measured + change, gust, noise)
    found = drive_signatures(gust, gains, spreads, STEP, noise.keep(STEP), np.zeros((NODES, 7, 1)), change[:, :, None])
    assert np.allclose(found[:, :, 0], after - before, atol=1e-9)


def test_the_shake_is_taken_out_and_the_motion_left() -> None:
    t = 0.004 * np.arange(5000)
    rotor = 157.0 - 6.0 * np.sin(0.3 * t)
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (rotor[1:] + rotor[:-1]) * np.diff(t))])
    motion = np.sin(2.0 * np.pi * 0.7 * t)[:, None] * np.ones(6)
    shake = np.column_stack(
        [a * np.cos(phase) + b * np.cos(2.0 * phase + 1.0) + c * np.sin(4.6 * phase) for a, b, c in np.ones((6, 3))]
    )
    left = calm(t, motion + shake, rotor, 4.66) - motion
    assert np.abs(left[500:-500]).max() < 0.02


def test_smoothing_keeps_what_is_slow_and_removes_a_turn() -> None:
    t = 0.004 * np.arange(1000)
    slow, turn = np.sin(2.0 * np.pi * 2.0 * t), np.cos(2.0 * np.pi * 25.0 * t)
    kept = smooth(slow + turn, 10)[50:-50]
    assert np.abs(kept - slow[50:-50]).max() < 1e-3

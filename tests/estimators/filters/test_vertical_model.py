"""Equation 13: Pallett's numbers, the misprint, and a fit that finds what made the data."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from estimators.vertical_fit import STEP, VerticalLog, errors, fit_vertical_model
from estimators.vertical_model import PALLETT, RAPTOR90, THETA, VerticalModel


def trim(model: VerticalModel, pitch: float) -> tuple[float, float, float]:
    """Rotor speed and the two inputs at which nothing moves, with the blades at `pitch`."""
    speed = brentq(lambda w: float(model.climb(0.0, w, pitch)), 50.0, 300.0)
    still = model.derivative(np.array([0.0, 0.0, speed, pitch, 0.0]), np.zeros(2))
    return speed, -float(still[2]) / model.throttle_gain, -float(still[4]) / model.collective_gain


@pytest.mark.parametrize(("pitch", "expected"), [(0.125, (138.0, 175.7, -97.4)), (0.2, (101.3, 123.8, -70.9))])
def test_pallett_s_trims(pitch: float, expected: tuple[float, float, float]) -> None:
    """Reference values of the X-Cell 50 on its stand."""
    np.testing.assert_allclose(trim(PALLETT, pitch), expected, rtol=2e-3)


def test_pallett_s_coefficients_are_his_constants_expanded() -> None:
    k1, c1, c2 = 0.25, 0.03259, 0.061456
    thrust = k1 * (-c1 + np.sqrt(c1**2 + c2 * 0.15)) ** 2 * 130.0**2 - 9.81 - 7.86
    assert float(PALLETT.climb(0.0, 130.0, 0.15)) == pytest.approx(thrust, abs=0.02)


def test_as_printed_there_is_no_lift_at_rest() -> None:
    assert float(PALLETT.climb(0.0, 138.0, 0.125, lift="climb")) == pytest.approx(-17.67)
    assert float(PALLETT.climb(0.0, 138.0, 0.125)) == pytest.approx(0.0, abs=0.05)


def test_a_step_is_the_integral() -> None:
    x, u = np.array([0.0, 0.3, 150.0, 0.10, 0.2]), np.array([0.5, 0.12])
    exact = solve_ivp(lambda _, y: RAPTOR90.derivative(y, u), (0.0, 0.1), x, rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(RAPTOR90.step(x, u, 0.1), exact, rtol=3e-3, atol=1e-4)


def test_many_models_at_once_are_each_of_them() -> None:
    many = VerticalModel(np.stack([RAPTOR90.a, 1.01 * RAPTOR90.a], axis=1)[:, :, None], 183.0, 1100.0)
    x, u = np.tile([0.0, 0.1, 155.0, 0.1, 0.0], (2, 3, 1)), np.tile([0.4, 0.11], (3, 1))
    both = many.step(x, u, 0.02)
    for k, a in enumerate((RAPTOR90.a, 1.01 * RAPTOR90.a)):
        alone = VerticalModel(a, 183.0, 1100.0).step(x[k], u, 0.02)
        np.testing.assert_allclose(both[k], alone, rtol=1e-12)


def test_the_raptor_s_servo_settles_where_it_is_sent() -> None:
    x = RAPTOR90.settled(0.09, 157.0)
    for _ in range(50):
        x[2] = 157.0
        x = RAPTOR90.step(x, np.array([0.5, 0.09]), 0.02)
    assert x[THETA] == pytest.approx(RAPTOR90.settled(0.09, 157.0)[THETA], abs=1e-3)


def flown(seed: int, noise: float = 0.01) -> VerticalLog:
    """Twelve seconds of RAPTOR90 itself, shaken, held near hover by the climb rate."""
    rng = np.random.default_rng(seed)
    omega, phase = 2 * np.pi / np.geomspace(0.5, 6.0, 5), rng.uniform(0, 2 * np.pi, (2, 5))
    hover = brentq(lambda c: float(RAPTOR90.climb(0.0, 157.0, c)), 0.02, 0.2)
    x = RAPTOR90.settled(hover, 157.0)
    throttle = -float(RAPTOR90.derivative(x, np.array([0.0, hover]))[2]) / RAPTOR90.throttle_gain
    rows, sent = [], []
    for k in range(round(12.0 / STEP)):
        waves = np.sin(omega * k * STEP + phase).sum(axis=1)
        u = np.array([throttle + 0.02 * waves[0] - 0.02 * (x[2] - 157.0), hover + 0.006 * waves[1] - 0.02 * x[1]])
        rows.append(x)
        sent.append(u)
        x = RAPTOR90.step(x, u, STEP)
    states = np.array(rows)
    shaken = noise * rng.standard_normal(len(states))
    return VerticalLog(states[:, 1] + shaken, states[:, 2] + 10 * shaken, np.array(sent))


def test_a_fit_predicts_a_flight_that_it_has_not_seen() -> None:
    """Few generations and windows: not the best, but far better than holding the last value."""
    fit = fit_vertical_model([flown(0)], seed=1, generations=8, searched=3)
    other = flown(1)
    climb, _ = errors(fit.model, [other])
    held = float(np.sqrt(np.mean((other.climb[150:] - other.climb[:-150]) ** 2)))
    assert climb < 0.35 * held
    assert np.isfinite(fit.model.a).all()


def test_a_log_shorter_than_a_window_is_refused() -> None:
    log = flown(0)
    with pytest.raises(ValueError, match="window"):
        fit_vertical_model([VerticalLog(log.climb[:20], log.speed[:20], log.inputs[:20])], seed=0)

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.plant import sample
from controllers.regulator import bryson, dlqr, lqr, residualise


@given(st.integers(0, 10_000))
def test_gains_are_those_of_the_control_package(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((4, 4)), rng.standard_normal((4, 2))
    q, r = bryson(*rng.uniform(0.5, 2.0, 4)), bryson(*rng.uniform(0.5, 2.0, 2))
    assert lqr(a, b, q, r) == pytest.approx(control.lqr(a, b, q, r)[0], rel=1e-9, abs=1e-9)
    full, drive = sample(0.1 * a, b, 0.006)
    weights = np.diag([*np.diag(q), *np.zeros(len(full) - 4)])
    expected = control.dlqr(full, drive, weights, r)[0]
    assert dlqr(full, drive, weights, r) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_double_integrator_gets_its_textbook_gain() -> None:
    a, b = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    assert lqr(a, b, bryson(1.0, np.inf), bryson(1.0)) == pytest.approx(np.array([[1.0, np.sqrt(2.0)]]))


def test_residualising_keeps_the_steady_answer() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((5, 5)) - 4.0 * np.eye(5), rng.standard_normal((5, 2))
    small_a, small_b = residualise(a, b, [1, 3], [0, 2, 4])
    assert np.linalg.solve(small_a, small_b) == pytest.approx(np.linalg.solve(a, b)[[1, 3]])
    kept_a, kept_b = residualise(a, b, [1, 3], [])
    assert np.array_equal(kept_a, a[np.ix_([1, 3], [1, 3])])
    assert np.array_equal(kept_b, b[[1, 3]])

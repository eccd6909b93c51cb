import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from controllers.plant import sample

PERIOD = 0.004
A = np.array([[-3.0, 20.0, 0.0], [-20.0, -2.0, 1.0], [0.0, 0.0, -30.0]])
B = np.array([[0.0, 1.0], [0.0, 0.0], [30.0, 0.0]])


@given(delay=st.floats(0.0, 0.05), seed=st.integers(0, 100))
def test_the_sampled_plant_is_the_delayed_plant_under_held_inputs(delay: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    sent = rng.standard_normal((25, 2))
    full, drive = sample(A, B, delay, PERIOD)
    z = np.zeros(len(full))
    for u in sent:
        z = full @ z + drive @ u

    # the same by steps from one change of the late input to the next, each by the matrix exponential's own integral
    end = len(sent) * PERIOD
    edges = sorted({0.0, end, *(k * PERIOD + delay for k in range(len(sent)) if k * PERIOD + delay < end)})
    x = np.zeros(3)
    for start, stop in itertools.pairwise(edges):
        k = int(np.floor(((start + stop) / 2 - delay) / PERIOD))
        u = sent[k] if k >= 0 else np.zeros(2)
        x = solve_ivp(lambda t, x, u=u: A @ x + B @ u, (start, stop), x, rtol=1e-10, atol=1e-12).y[:, -1]
    assert z[:3] == pytest.approx(x, rel=1e-6, abs=1e-8)


def test_states_and_inputs_are_found_by_name(plant) -> None:
    assert plant.states("wx", "no.such", "roll") == [3, 0]
    assert plant.inputs("tail") == [3]

"""The compiled replay against batches in order of time, by two other implementations."""

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.linalg import expm

from estimators.delayed_kalman import Component, DelayedKalman, LinearModel
from estimators.replay import DUPLICATE, FUTURE, HARD_GATE, NOT_FINITE, SOFT_GATE, STALE, TAKEN

Floats = NDArray[np.float64]
DT = 0.004

# height, climb rate, error of the acceleration, bias of the second sensor
A = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, -0.1, 0.0], [0.0, 0.0, 0.0, 0.0]])
B = np.array([[0.0], [1.0], [0.0], [0.0]])
Q = np.diag([0.0, 0.0, 1e-3, 1e-2])
W = np.diag([0.0, 2e-3, 0.0, 0.0])
ROWS = np.array([[1.0, 0, 0, 0], [1.0, 0, 0, 1.0], [0, 1.0, 0, 0]])
VARIANCES = np.array([0.02, 0.05, 0.01]) ** 2
COMPONENTS = (
    Component(0, patience=10, reference=True),
    Component(1, patience=10, jump=3),
    Component(2, patience=10),
)
P0 = np.diag([1.0, 1.0, 0.1, 0.5])

Event = tuple[float, int, float]  # time of validity, component, value


def make(components: tuple[Component, ...] = COMPONENTS) -> DelayedKalman:
    return DelayedKalman(LinearModel(A, B, Q, W, components), 0.0, np.zeros(4), P0)


def course(rng: np.random.Generator, steps: int, sigmas: float) -> tuple[Floats, list[Event]]:
    """Inputs (steps, 1) and measurements of a made-up climb; noise within so many standard deviations."""
    t = DT * np.arange(1, steps + 1)
    u = np.sin(t)[:, None]
    events = []
    for component, every in ((0, 10), (1, 50), (2, 12)):
        # between two epochs, as a real sensor's clock is
        for at in t[every::every] - rng.uniform(0, DT):
            truth = ROWS[component] @ [at - math.sin(at), 1 - math.cos(at), 0.0, 0.3]
            noise = np.clip(rng.standard_normal(), -sigmas, sigmas) * math.sqrt(VARIANCES[component])
            events.append((float(at), component, float(truth + noise)))
    return u, sorted(events)


def online(u: Floats, events: list[Event], arrivals: Floats, filter_: DelayedKalman | None = None) -> DelayedKalman:
    """Measurements come in at their arrival, in whatever order."""
    filter_ = filter_ or make()
    queue = sorted(zip(arrivals.tolist(), events, strict=True))
    for k, value in enumerate(u, 1):
        filter_.advance(k * DT, value)
        while queue and queue[0][0] <= k * DT:
            _, (t, component, z) = queue.pop(0)
            assert filter_.insert(t, component, ROWS[component], z, VARIANCES[component]) == TAKEN
        filter_.refresh()
    return filter_


@lru_cache(maxsize=4096)
def transition(dt: float) -> tuple[Floats, Floats, Floats]:
    """Phi, Gamma and Q of a step by the matrix exponential; Q by Van Loan's method."""
    n = len(A)
    both = expm(np.block([[A, B], [np.zeros((1, n + 1))]]) * dt)
    loan = expm(np.block([[-A, Q + W], [np.zeros((n, n)), A.T]]) * dt)
    phi = loan[n:, n:].T
    return phi, both[:n, n:], phi @ loan[:n, n:]


def batch(
    u: Floats, events: list[Event], step: Callable[[float, Floats], None], update: Callable[[Event], None]
) -> None:
    """All in order of time."""
    t, i = 0.0, 0
    for k, value in enumerate(u, 1):
        while i < len(events) and events[i][0] <= k * DT:
            step(round(events[i][0] - t, 12), value)
            t = events[i][0]
            update(events[i])
            i += 1
        step(round(k * DT - t, 12), value)
        t = k * DT


def plain(u: Floats, events: list[Event]) -> tuple[Floats, Floats]:
    """The same filter, equation 27 included, in numpy: Joseph's form as it stands in books."""
    x, p = np.zeros(4), P0.copy()

    def step(dt: float, value: Floats) -> None:
        nonlocal x, p
        phi, gamma, noise = transition(dt)
        x, p = phi @ x + gamma @ value, phi @ p @ phi.T + noise

    def update(event: Event) -> None:
        nonlocal x, p
        _, component, z = event
        row, variance = ROWS[component], VARIANCES[component]
        spread = row @ p @ row + variance
        residual = z - row @ x
        ratio = abs(residual) / math.sqrt(spread)
        weight = 1.0 if ratio <= SOFT_GATE else SOFT_GATE / ratio if ratio <= HARD_GATE else 0.0
        gain = weight * p @ row / spread
        joseph = np.eye(4) - np.outer(gain, row)
        x, p = x + gain * residual, joseph @ p @ joseph.T + variance * np.outer(gain, gain)

    batch(u, events, step, update)
    return x, p


def test_late_measurements_give_what_a_batch_in_order_of_time_gives() -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        u, events = course(rng, 400, sigmas=9.0)
        events = [(t, c, z + (0.2 if rng.random() < 0.05 else 0.0)) for t, c, z in events]  # some beyond the gates
        events = [event for event in events if event[0] < 1.4]
        late = online(u, events, np.array([t for t, _, _ in events]) + rng.uniform(0, 0.19, len(events))).last
        x, p = plain(u, events)
        np.testing.assert_allclose(late["x"], x, rtol=0, atol=1e-9)
        np.testing.assert_allclose(late["p"], p, rtol=0, atol=1e-9)


def test_filterpy_agrees_where_no_residual_is_large() -> None:
    rng = np.random.default_rng(7)
    u, events = course(rng, 400, sigmas=0.5)
    events = [event for event in events if event[0] < 1.4]
    oracle = KalmanFilter(dim_x=4, dim_z=1, dim_u=1)
    oracle.x, oracle.P = np.zeros((4, 1)), P0.copy()

    def step(dt: float, value: Floats) -> None:
        phi, gamma, noise = transition(dt)
        oracle.predict(u=value[:, None], B=gamma, F=phi, Q=noise)

    def update(event: Event) -> None:
        _, component, z = event
        oracle.update(np.array([[z]]), R=np.array([[VARIANCES[component]]]), H=ROWS[component][None])
        assert abs(oracle.y.item()) < SOFT_GATE * math.sqrt(oracle.S.item()), "the test wants no gate at work"

    batch(u, events, step, update)
    late = online(u, events, np.array([t for t, _, _ in events]) + rng.uniform(0, 0.19, len(events))).last
    np.testing.assert_allclose(late["x"], oracle.x[:, 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(late["p"], oracle.P, rtol=0, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_order_of_arrival_changes_no_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, events = course(rng, 120, sigmas=9.0)
    events = [(round(t / DT) * DT, c, z) for t, c, z in events if t < 0.3]  # ties in time too
    order = [online(u, events, 0.3 + 0.15 * rng.random(len(events))).last for _ in range(2)]
    for name in ("x", "p", "rejections", "accepted"):
        np.testing.assert_array_equal(order[0][name], order[1][name])


def test_the_discretisation_is_that_of_the_matrix_exponential() -> None:
    for dt in (0.001, 0.004, 0.05, 0.7):
        phi, gamma, noise = transition(dt)
        kalman = make()
        kalman.advance(dt, np.array([2.0]))
        np.testing.assert_allclose(kalman.last["x"], gamma[:, 0] * 2.0, atol=1e-6 * dt)
        np.testing.assert_allclose(kalman.last["p"], phi @ P0 @ phi.T + noise, atol=1e-6 * dt)


def test_what_cannot_be_used_is_named() -> None:
    kalman = make()
    for k in range(1, 400):
        kalman.advance(k * DT, np.zeros(1))
    now = 399 * DT
    row = ROWS[0]
    assert kalman.insert(now - 0.1, 0, row, 1.0, 1.0) == TAKEN
    assert kalman.insert(now - 0.1, 0, row, 1.0, 1.0) == DUPLICATE
    assert kalman.insert(now - 0.1, 1, row, 1.0, 1.0) == TAKEN
    assert kalman.insert(now - 0.8, 0, row, 1.0, 1.0) == STALE
    assert kalman.insert(now + 0.05, 0, row, 1.0, 1.0) == FUTURE
    for bad in (math.nan, math.inf):
        assert kalman.insert(bad, 0, row, 1.0, 1.0) == NOT_FINITE
        assert kalman.insert(now, 0, row, bad, 1.0) == NOT_FINITE
        assert kalman.insert(now, 0, row, 1.0, bad) == NOT_FINITE
    assert kalman.insert(now, 0, row, 1.0, 0.0) == NOT_FINITE
    assert not kalman.advance(now, np.zeros(1)), "time does not stand still"
    assert not kalman.advance(math.nan, np.zeros(1))


def test_a_stamp_just_ahead_waits_for_its_epoch() -> None:
    early, late = make(), make()
    for kalman in (early, late):
        kalman.advance(DT, np.ones(1))
    early.insert(DT + 0.001, 0, ROWS[0], 1.0, 0.01)
    early.refresh()
    np.testing.assert_array_equal(early.last["x"], late.last["x"])
    for kalman in (early, late):
        kalman.advance(2 * DT, np.ones(1))
    late.insert(DT + 0.001, 0, ROWS[0], 1.0, 0.01)
    late.refresh()
    np.testing.assert_array_equal(early.last["x"], late.last["x"])
    assert early.last["x"][0] > 0.5


def settled(components: tuple[Component, ...] = COMPONENTS) -> tuple[DelayedKalman, Callable[..., None]]:
    """A filter that knows its state well, and a function that goes on with given values of the components."""
    kalman = make(components)
    now = [0.0]

    def go_on(steps: int, **values: float) -> None:
        for _ in range(steps):
            now[0] += 0.04
            kalman.advance(now[0], np.zeros(1))
            for name, z in values.items():
                c = int(name[1:])
                kalman.insert(now[0], c, ROWS[c], z, VARIANCES[c])
            kalman.refresh()

    go_on(200, z0=0.0, z1=0.3, z2=0.0)
    return kalman, go_on


def test_one_outlier_has_no_weight() -> None:
    kalman, go_on = settled()
    before = kalman.last["x"].copy()
    go_on(1, z0=5.0)
    assert kalman.rejected[0] == 1
    np.testing.assert_allclose(kalman.last["x"], before, atol=5e-3)


def test_a_reference_that_insists_is_believed_in_the_end() -> None:
    kalman, go_on = settled()
    go_on(COMPONENTS[0].patience - 1, z0=5.0)
    assert abs(kalman.last["x"][0]) < 0.1
    go_on(30, z0=5.0)
    assert kalman.last["resets"][0] == 1
    assert abs(kalman.last["x"][0] - 5.0) < 0.1


def test_a_sensor_that_another_reference_contradicts_stays_out() -> None:
    kalman, go_on = settled()
    go_on(100, z0=0.0, z2=3.0)
    assert kalman.rejected[2] == 100
    assert kalman.last["resets"][2] == 0
    assert abs(kalman.last["x"][1]) < 0.1


def test_a_jump_goes_into_the_bias_that_can_jump() -> None:
    kalman, go_on = settled()
    go_on(60, z0=0.0, z1=2.3)
    assert kalman.last["resets"][1] == 1
    assert abs(kalman.last["x"][3] - 2.3) < 0.05
    assert abs(kalman.last["x"][0]) < 0.02


@pytest.mark.parametrize("std", [1e-4, 0.02])  # as the filter is told, and so wrong that it resets again and again
def test_the_covariance_stays_one_for_ever(std: float) -> None:
    kalman = make()
    rng = np.random.default_rng(0)
    for k in range(1, 50_001):
        kalman.advance(k * DT, np.zeros(1))
        if k % 10 == 0:
            kalman.insert(k * DT - 0.05, 0, ROWS[0], std * rng.standard_normal(), 1e-8)
    p = kalman.last["p"]
    np.testing.assert_array_equal(p, p.T)
    assert np.linalg.eigvalsh(p).min() > 0.0


def test_without_inputs_more_noise_comes_in() -> None:
    quiet, loud = make(), make()
    for kalman, noise in ((quiet, 1.0), (loud, 100.0)):
        for k in range(1, 100):
            kalman.advance(k * DT, np.zeros(1), noise)
    assert loud.last["p"][1, 1] - P0[1, 1] == pytest.approx(
        100 * W[1, 1] * 99 * DT + (quiet.last["p"][1, 1] - P0[1, 1] - W[1, 1] * 99 * DT), rel=1e-6
    )


def test_the_past_state_is_the_one_that_was() -> None:
    kalman = make()
    states = {}
    for k in range(1, 100):
        kalman.advance(k * DT, np.array([math.sin(k)]))
        states[k] = kalman.last["x"].copy()
    for k in (20, 50, 99):
        np.testing.assert_allclose(kalman.state_at(k * DT + 1e-12)[0], states[k], atol=1e-12)
    between, _ = kalman.state_at(50.5 * DT)
    assert min(states[50][0], states[51][0]) < between[0] < max(states[50][0], states[51][0])

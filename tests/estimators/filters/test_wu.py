"""Wu 2019's filter against filterpy and its own print; its navigator flown blind."""

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.stats import chi2

from estimators import navigators
from estimators.wu_ekf import H, WuFilter, WuNoise, transition
from flightlog.errors import UserError
from flightlog.marks import HMark, RingMark
from scenarios.flight import fly
from scenarios.load import build

NOISE = WuNoise(acceleration=0.2, vision=0.05)
DT, EVERY = 0.004, 10  # inertial sampling; samples to a picture


def test_the_transition_is_that_of_constant_acceleration():
    f, b = transition(0.3)
    position, velocity, acceleration = np.array([1.0, 2, 3]), np.array([-1.0, 0.5, 2]), np.array([0.2, -0.3, 9.0])
    moved = f @ np.concatenate([position, velocity]) + b @ acceleration
    np.testing.assert_allclose(moved[:3], position + 0.3 * velocity + 0.045 * acceleration)
    np.testing.assert_allclose(moved[3:], velocity + 0.3 * acceleration)


def test_corrected_it_is_the_plain_kalman_filter():
    rng = np.random.default_rng(0)
    ours = WuFilter(np.array([1.0, 2.0, 3.0]), np.zeros(3), noise=NOISE)
    theirs = KalmanFilter(dim_x=6, dim_z=3, dim_u=3)
    theirs.x, theirs.P, theirs.H, theirs.R = ours.x.copy(), ours.p.copy(), H, NOISE.vision**2 * np.eye(3)
    f, b = transition(DT)
    cube = np.kron([[DT**3 / 3, DT**2 / 2], [DT**2 / 2, DT]], np.eye(3))
    for k in range(300):
        u = rng.normal(0, 1, 3)
        ours.predict(u, DT)
        theirs.predict(u=u, B=b, F=f, Q=NOISE.acceleration**2 * cube)
        if k % EVERY == 0:
            z = rng.normal(0, 1, 3)
            innovation, s = ours.correct(z)
            theirs.update(z)
            np.testing.assert_allclose(innovation, theirs.y, atol=1e-9)
            np.testing.assert_allclose(s, theirs.S, atol=1e-12)
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-9)
    np.testing.assert_allclose(ours.p, theirs.P, atol=1e-12)


def test_printed_it_never_corrects_its_velocity():
    """F P F' is what ties velocity to position; without it P stays diagonal, and the gain of the velocity zero."""
    rng = np.random.default_rng(1)
    printed = WuFilter(np.zeros(3), np.array([0.5, 0.0, -0.2]), noise=NOISE, reading="printed")
    mixed = WuFilter(np.zeros(3), np.array([0.5, 0.0, -0.2]), noise=NOISE, reading="mixed")
    for _ in range(500):
        for item in (printed, mixed):
            item.predict(rng.normal(0, 3, 3), 0.04)
            item.correct(rng.normal(0, 0.05, 3))
    np.testing.assert_array_equal(printed.x[3:], [0.5, 0.0, -0.2])
    np.testing.assert_array_equal(printed.p, np.diag(np.diag(printed.p)))
    assert np.linalg.norm(mixed.x[3:]) < 0.3
    # where it settles: pulled back by the gain as fast as carried off by the velocity
    gain = printed.p[0, 0] / NOISE.vision**2
    assert printed.x[0] == pytest.approx(0.5 * 0.04 * (1 - gain) / gain, rel=0.4)


def flown(reading, seed):
    """NEES at the end of 6 s of a random flight with its model's own noise."""
    rng = np.random.default_rng(seed)
    step = 0.01
    f, b = transition(step)
    state = np.concatenate([rng.normal(0, NOISE.vision, 3), rng.normal(0, NOISE.start_velocity, 3)])
    item = WuFilter(np.zeros(3), np.zeros(3), noise=NOISE, reading=reading)
    for k in range(600):
        u = np.array([math.sin(0.005 * k), math.cos(0.007 * k), 0.5])
        state = f @ state + b @ (u + rng.normal(0, NOISE.acceleration / math.sqrt(step), 3))
        item.predict(u, step)
        if k % 4 == 3:
            item.correct(state[:3] + rng.normal(0, NOISE.vision, 3))
    error = item.x - state
    return float(error @ np.linalg.solve(item.p, error))


def test_only_the_corrected_filter_is_as_sure_as_it_may_be():
    runs = 24
    low, high = chi2.ppf([0.0005, 0.9995], 6 * runs) / runs
    sums = {reading: np.mean([flown(reading, seed) for seed in range(runs)]) for reading in ("corrected", "mixed")}
    print(f"NEES of {runs} flights, 99.9 % band {low:.2f}..{high:.2f}: {sums}")
    assert low < sums["corrected"] < high
    assert sums["mixed"] > high


def test_an_unknown_reading_is_refused():
    with pytest.raises(ValueError, match="mixed"):
        WuFilter(np.zeros(3), np.zeros(3), reading="typed")


def test_the_published_navigator_holds_the_hover_without_pictures(tmp_path):
    """From sightings of the pad camera's model: within the paper's 0.1 m when settled."""
    from flightlog.readers.folder import read_flight

    scenario = build(
        pad="ring", navigator="wu2019", variant="published", duration_s=14.0, start={"position_m": [0.5, -0.4, 4.0]},
        plan={"goal": "hover", "point_m": [0.0, 0.0, 4.0]},
    )  # fmt: skip
    flight = fly(scenario, seed=2, cameras=False, folder=tmp_path / "flight")
    assert flight.summary.success
    log = read_flight(tmp_path / "flight")
    state, estimate = log.truth["state"], log.measured["estimate"]
    late = estimate["t"] > 5.0
    for name in "enu":
        error = estimate[name][late] - np.interp(estimate["t"][late], state["t"], state[name])
        assert np.max(np.abs(error)) < 0.1


def test_when_the_mark_is_lost_it_moves_on_with_the_rest_and_nothing_jumps(tmp_path):
    from flightlog.readers.folder import read_flight

    scenario = build(
        pad="ring", navigator="wu2019", variant="published", duration_s=16.0, start={"position_m": [0.2, 0.0, 4.0]},
        plan={"goal": "hover", "point_m": [0.0, 0.0, 4.0]},
        events=[{"kind": "dropout", "sensor": "pad", "at_s": 7.0, "for_s": 5.0}],
    )  # fmt: skip
    fly(scenario, seed=3, cameras=False, folder=tmp_path / "flight")
    log = read_flight(tmp_path / "flight")
    state, estimate = log.truth["state"], log.measured["estimate"]
    t = estimate["t"]
    for name in "en":
        error = estimate[name] - np.interp(t, state["t"], state[name])
        gone = (t > 7.0) & (t < 12.0)
        assert np.max(np.abs(error[gone])) < 0.6
        # what steps there are, are those of the GPS
        assert np.max(np.abs(np.diff(estimate[name][gone]))) < 0.05
        assert np.max(np.abs(error[t > 13.0])) < 0.1


def test_it_reads_the_ring_alone():
    from scenarios.staging import make_equipment, make_world
    from sim import vehicle

    raptor = vehicle.load("raptor90")
    scenario = build(pad="h")
    with make_world(scenario, np.random.SeedSequence(0), raptor, cameras=False) as world:
        equipment = make_equipment(scenario, raptor, world)
    assert isinstance(equipment.mark, HMark)
    with pytest.raises(UserError, match="ring landmark"):
        navigators.make("wu2019", equipment, variant="published", sees=True)
    navigators.make("wu2019", equipment, variant="helideck", sees=True)
    assert RingMark().turn == 2 * math.pi

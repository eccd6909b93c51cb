"""The stepwise descent to the ring landmark, flown without cameras, and what its experiment makes of flights."""

import math

import numpy as np
import pytest

from scenarios.experiments import wu2019_landing as experiment
from scenarios.experiments.wu2019_landing import Descent, Flown, Witness
from scenarios.flight import fly
from scenarios.load import load


@pytest.fixture(scope="module")
def flown():
    settings = {"start.position_m": [0.2, -0.2, 4.0], "plan.point_m": [0.0, 0.0, 4.0], "plan.steps_m": [2.0, 1.0]}
    witness = Witness("helideck", ("published",))
    heights = []

    def look(world, measurements, navigator, state):
        heights.append((world.t, world.truth.position[2]))
        witness(world, measurements, navigator, state)

    scenario = load("ring_landing", {**settings, "plan.step_s": 3.0})
    flight = fly(scenario, seed=3, cameras=False, navigator=witness.make, onlooker=look)
    return flight, witness.descents(), np.array(heights)


def test_it_comes_down_in_steps_and_lands(flown):
    flight, _, track = flown
    assert flight.summary.landed
    assert flight.summary.touchdown_offset_m < 0.1
    for step in (2.0, 1.0):
        there = track[np.abs(track[:, 1] - step) < 0.12, 0]
        assert there[-1] - there[0] > 2.5  # it stays


def test_ours_and_the_published_estimator_see_the_same_flight(flown):
    _, descents, _ = flown
    ours, theirs = descents["helideck"], descents["published"]
    np.testing.assert_array_equal(ours.t, theirs.t)
    np.testing.assert_array_equal(ours.height, theirs.height)
    # without pictures perspective shows no tilt: what the attitude is wrong by, times the height
    assert np.abs(ours.error).max() < 0.15
    assert np.abs(ours.error[ours.height < 1.0]).max() < 0.03
    assert 0.002 < np.abs(theirs.error).max() < 0.5
    assert ours.height.min() > 0.23  # up to the contact


def made(size: float, turned: float) -> Descent:
    t = np.linspace(3.0, 40.0, 200)
    error = size * np.array([1.0, -0.5, 0.25]) * np.sin(t)[:, None]
    return Descent(t, np.linspace(9.9, 0.3, 200), error, np.full(200, turned), np.full((200, 3), size))


def test_figures_are_the_worst_of_all_flights():
    ours = [made(0.001, 0.0001), made(0.004, -0.0005)]
    flights = [
        Flown({"helideck": ours[0], "published": made(0.05, 0.01), "level": made(0.4, 0.01)}, [], True, 0.02),
        Flown({"helideck": ours[1], "published": made(0.08, 0.01)}, [], True, 0.03),
        Flown({"published": made(0.10, 0.01)}, [], True, 0.07),
    ]
    outcome = experiment.conclude("full", [*flights, [{"height [m]": 10.0}]])
    figures = {figure.quantity: figure for figure in outcome.figures}
    low = figures["X error, largest below 5 m"]
    assert low.ours == pytest.approx(0.004, rel=0.01)
    assert low.faithful == pytest.approx(0.10, rel=0.01)
    assert low.reached
    assert figures["heading error, largest below 5 m"].ours == pytest.approx(math.degrees(0.0005))
    assert figures["touchdown off the mark's centre"].ours == 0.03
    assert figures["touchdown off the mark's centre"].faithful == 0.07
    assert figures["RMS error below 5 m, worst axis"].ours < 0.004


def test_a_figure_beyond_its_bar_is_said_to_be():
    flight = Flown({"helideck": made(0.03, 0.01), "published": made(0.05, 0.01)}, [], True, None)
    outcome = experiment.conclude("quick", [flight, []])
    figures = {figure.quantity: figure for figure in outcome.figures}
    assert not figures["X error, largest below 5 m"].reached
    assert not figures["heading error, largest below 5 m"].reached

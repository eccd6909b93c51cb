"""Terms that the raptor's file does without: each against its closed form, and nothing at its neutral value."""

import math

import numpy as np
import pytest

from sim import vehicle
from sim.pipeline import Pipeline
from sim.terms import CATALOGUE


def alone(name, **numbers):
    raptor = vehicle.load("raptor90")
    pipeline = Pipeline([CATALOGUE[name]], {name: numbers}, raptor.geometry)
    s = pipeline.signals()
    s["density"], s["thrust"], s["up"] = 1.2, 49.0, (0.0, 0.0, 1.0)
    return pipeline, s


def test_drag_is_a_flat_plates_and_a_linear_share():
    pipeline, s = alone("drag", area=0.05, linear=0.3)
    s["velocity"] = (3.0, -4.0, 0.0)
    pipeline.run(s, 0.002)
    assert s["force"] == pytest.approx([-(0.5 * 1.2 * 0.05 * 5.0 + 0.3) * v for v in (3.0, -4.0, 0.0)])


def test_a_centre_of_mass_ahead_pitches_the_nose_down_under_thrust_and_sees_the_whole_force():
    raptor = vehicle.load("raptor90")
    terms = [CATALOGUE["cg_offset"], CATALOGUE["drag"]]  # listed first, acts last
    pipeline = Pipeline(terms, {"cg_offset": {"x": 0.01, "y": 0.0, "z": 0.02}, "drag": {"area": 0.0, "linear": 2.0}},
                        raptor.geometry)
    s = pipeline.signals()
    s["density"], s["velocity"] = 1.2, (0.0, 0.0, -5.0)
    pipeline.run(s, 0.002)
    assert s["force"] == pytest.approx([0.0, 0.0, 10.0])
    assert s["moment"] == pytest.approx(-np.cross([0.01, 0.0, 0.02], s["force"]))
    assert s["moment"][1] > 0.0  # about the left axis: nose down


@pytest.mark.parametrize(
    ("release", "follows"),
    [(0.0, [0.0, 0.0, 0.005, 0.005, 0.005, 0.0, 0.49]), (1.0, [0.0, 0.0, 0.015, 0.015, 0.0, 0.0, 0.5]),
     (0.5, [0.0, 0.0, 0.01, 0.01, 0.01, -0.005, 0.495])],
)
def test_slack_is_taken_up_before_a_control_moves_by_its_rest_or_all_the_way(release, follows):
    pipeline, s = alone("deadband", width=0.02, release=release)
    seen = []
    for command in (0.0, 0.009, 0.015, 0.015, 0.0, -0.01, 0.5):
        s["collective"] = command
        pipeline.run(s, 0.002)
        seen.append(float(s["collective"]))
    assert seen == pytest.approx(follows)


@pytest.mark.parametrize("sink", [0.3, 1.0, 1.7])
def test_thrust_is_lost_where_the_rotor_sinks_as_fast_as_it_pushes_air(sink):
    pipeline, s = alone("vortex_ring", depth=0.3)
    raptor = vehicle.load("raptor90")
    hover = math.sqrt(49.0 / (2.0 * 1.2 * math.pi * float(raptor.geometry["rotor_radius"]) ** 2))
    s["velocity"] = (0.0, 0.0, -sink * hover)
    pipeline.run(s, 0.002)
    assert 1.0 - s["thrust"] / 49.0 == pytest.approx(0.3 * math.exp(-(((sink - 1.0) / 0.35) ** 2)))


@pytest.mark.parametrize(
    ("name", "numbers"),
    [("drag", {"area": 0.0, "linear": 0.0}), ("deadband", {"width": 0.0, "release": 0.0}),
     ("vortex_ring", {"depth": 0.0}), ("cg_offset", {"x": 0.0, "y": 0.0, "z": 0.0})],
)
def test_a_neutral_term_changes_nothing(name, numbers):
    raptor = vehicle.load("raptor90")
    parameters = {**raptor.parameters, name: numbers}
    with_it = Pipeline([*raptor.terms, CATALOGUE[name]], parameters, raptor.geometry)
    without = Pipeline(raptor.terms, raptor.parameters, raptor.geometry)
    answers = []
    for pipeline in (with_it, without):
        s = pipeline.signals()
        s["density"], s["up"], s["height"] = 1.2, (0.0, 0.0, 1.0), 3.0
        for _ in range(50):
            s["collective"], s["lateral"], s["throttle"], s["velocity"] = 0.08, 0.01, 0.24, (1.0, 0.5, -2.0)
            pipeline.run(s, 0.002)
        answers.append(np.concatenate([s["force"], s["moment"]]))
    assert np.array_equal(*answers)

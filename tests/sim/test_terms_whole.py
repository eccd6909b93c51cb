"""The terms together: signs of every control, each term switched off, speed."""

import time
from dataclasses import replace

import numpy as np
import pytest

from flightlog.rotations import angles, wrap
from flightlog.signals import Controls
from sim import vehicle
from sim.pipeline import settle
from sim.terms import CATALOGUE

PULSE = {"collective": 0.01, "lateral": 0.02, "longitudinal": 0.02, "tail": 0.03, "throttle": 0.1}


def pulse(body, pipeline, at, name, size, duration=0.3):
    """Changes of attitude, rates, velocity (body axes) and rotor speed after a pulse, less those without it."""

    def fly(change):
        machine = body(pipeline, at)
        for _ in range(round(duration / machine.dt)):
            machine.step(at.controls._replace(**{name: getattr(at.controls, name) + change}))
        roll, pitch, heading = angles(machine.q)
        return {
            "roll": roll, "pitch": pitch, "heading": heading,
            "wx": machine.rates[0], "wy": machine.rates[1], "wz": machine.rates[2],
            "forward": machine.velocity[1], "left": -machine.velocity[0], "up": machine.velocity[2],
            "rotor": float(machine.s["rotor_speed"]),
        }  # fmt: skip

    pushed, left_alone = fly(size), fly(0.0)
    change = {key: pushed[key] - left_alone[key] for key in pushed}
    return change | {"heading": wrap(change["heading"])}


@pytest.mark.parametrize("direction", [-1.0, 1.0], ids=["clockwise", "counter-clockwise"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("control", "signs"),
    [
        ("collective", {"up": +1}),
        ("lateral", {"roll": +1, "wx": +1, "left": -1}),
        ("longitudinal", {"pitch": -1, "wy": +1, "forward": +1}),
        ("tail", {"heading": +1, "wz": -1, "left": +1}),
        ("throttle", {"rotor": +1}),
    ],
)
def test_every_control_moves_its_axis_the_way_it_should(model, hover, body, control, signs, sign, direction):
    pipeline, at = hover(model(direction=direction))
    change = pulse(body, pipeline, at, control, sign * PULSE[control])
    for key, expected in signs.items():
        assert sign * change[key] * expected > 0.0, (key, change)
    # and it moves that axis most
    rates = {"lateral": "wx", "longitudinal": "wy", "tail": "wz"}
    if control in rates:
        others = [abs(change[key]) for key in ("wx", "wy", "wz") if key != rates[control]]
        assert abs(change[rates[control]]) > 2.0 * max(others)


@pytest.mark.parametrize(("direction", "nose"), [(-1.0, "left"), (1.0, "right")])
def test_the_nose_turns_against_the_rotor_as_the_engine_pulls(model, hover, body, direction, nose):
    pipeline, at = hover(model(direction=direction))
    wz = pulse(body, pipeline, at, "throttle", 0.1)["wz"]
    assert (wz > 0.0) == (nose == "left")


def test_the_trimmed_helicopter_stays_where_it_is(hover, body):
    pipeline, at = hover()
    pipeline.set_parameter("fuel", "rate", 0.0)
    machine = body(pipeline, at)
    for _ in range(250):
        machine.step(at.controls)
    assert np.linalg.norm(machine.position - (0.0, 0.0, 10.0)) < 1e-5
    assert np.linalg.norm(machine.velocity) < 1e-4
    assert abs(machine.s["rotor_speed"] - at.signals["rotor_speed"]) < 1e-6


def test_without_terms_a_body_falls_freely(model, hover, body):
    _, at = hover()
    machine = body(model("fuel"), replace(at, state=np.zeros(1)))
    for _ in range(250):
        machine.step(Controls())
    assert machine.velocity == pytest.approx((0.0, 0.0, -9.80665 * 0.5))
    assert machine.rates == pytest.approx((0.0, 0.0, 0.0))


# what is left when a term is switched off: signal, value
NEUTRAL = {
    "servo": ("lateral", 0.01),
    "fuel": ("mass", 5.0),
    "engine": ("rotor_speed", 50.0 * np.pi),
    "ground_effect": ("ground", 1.0),
    "main_rotor": ("thrust", 0.0),
    "flapping": ("flap_right", 0.0),
    "tail_rotor": ("tail_thrust", 0.0),
}


@pytest.mark.parametrize("name", [term.name for term in vehicle.load("raptor90").terms])
def test_each_term_can_be_switched_off(hover, model, name):
    _, at = hover(height=0.3)

    def run(pipeline):
        s = pipeline.signals()
        for field in ("velocity", "up", "height", "density", *Controls._fields):
            s[field] = at.signals[field]
        commands = {"lateral": 0.01, "collective": 0.08, "throttle": 0.24, "longitudinal": 0.0, "tail": 0.02}
        if pipeline.state_index("engine.speed") >= 0:
            pipeline.state[pipeline.state_index("engine.speed")] = 157.0
        for k in range(100):
            for control, value in commands.items():
                s[control] = value * min(k, 1)  # a step, so that the servo shows
            s["velocity"], s["rates"] = (5.0, 1.0, 0.0), (0.1, 0.2, 0.3)
            pipeline.run(s, 0.002)
        return s

    whole, without = run(model()), run(model(without=[name]))
    signals = ("force", "moment", "mass", "rotor_speed", *Controls._fields)
    assert np.isfinite(np.concatenate([np.ravel(without[field]) for field in signals])).all()
    assert any(np.any(whole[field] != without[field]) for field in signals)  # it did something
    if name in NEUTRAL:
        field, value = NEUTRAL[name]
        assert without[field] == pytest.approx(value, rel=1e-12)
        assert whole[field] != without[field]


def test_every_term_names_its_source_and_its_parameters_ranges_hold_their_values(raptor):
    for name, term in CATALOGUE.items():
        assert term.name == name and term.source
        if name not in raptor.parameters:
            continue
        for declared in term.parameters:
            assert declared.low <= raptor.parameters[name][declared.name] <= declared.high
            written = raptor.document["terms"][name][declared.name]
            assert written["source"]
            assert written["unit"]
            assert "tolerance" in written


def test_one_instant_of_the_whole_model_costs_less_than_four_microseconds(hover):
    pipeline, at = hover()
    s = at.signals.copy()
    pipeline.state[:] = at.state

    def cost(steps=20_000):
        begin = time.perf_counter()
        settle(
            pipeline.kernels, pipeline.spans, s, pipeline.geometry, pipeline.state, pipeline.parameters, 0.002, steps,
            -1, 0.0,
        )  # fmt: skip
        return (time.perf_counter() - begin) / steps

    best = min(cost() for _ in range(5))
    print(f"{best * 1e6:.2f} us per run of the pipeline")
    assert best < 4e-6

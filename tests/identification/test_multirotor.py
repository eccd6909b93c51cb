"""Multirotors: what the balances name, on simulated flights and on measured ones."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from scipy.signal import lfilter

from flightlog.constants import GRAVITY
from flightlog.errors import UserError
from flightlog.tables import Table
from flightlog.topics import topic_of
from identification.diagnosis import diagnose, open_bench
from identification.logs import read
from identification.multirotor import noise, quick
from identification.multirotor.flight import prepare
from identification.multirotor.motion import Motion
from identification.normal import refit_to
from sim.kinds import load
from sim.multirotor import load_multirotor, multirotor_from
from sim.multirotor.model import Inputs, answer
from sim.multirotor.simulate import fly
from tests.blind import quad_flights
from tests.blind.kits import file_of

DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data")) / "crazypad"
measured = pytest.mark.skipif(not DATA.is_dir(), reason="no measured logs: set HELIDECK_DATA to their folder")


@pytest.fixture(scope="module")
def craft():
    return load_multirotor("crazyflie")


def tables(columns):
    return {topic: Table(topic, pa.table(dict(found)), topic_of("measured", topic)) for topic, found in columns.items()}


@pytest.fixture(scope="module")
def nominal(craft, tmp_path_factory):
    good = {f"good{i}": tables(fly(craft, np.random.default_rng(i), 20.0)) for i in range(2)}
    return refit_to(craft, good, tmp_path_factory.mktemp("nominal") / "nominal.toml")


def verdict(nominal, craft, seed, **truth):
    return diagnose({"flight": tables(fly(craft, np.random.default_rng(seed), 20.0, truth))}, nominal)


def test_hover_carries_the_weight(craft):
    one = answer(craft, craft.values(), Inputs(0.01, np.full((3, 4), 0.62), np.full(3, 3.7), np.zeros((3, 3))))
    lift = 4 * np.interp(0.62, *craft.tables[0].T)
    assert one[:, 2] == pytest.approx(lift / craft.mass)
    assert one[:, 3:] == pytest.approx(0.0, abs=1e-9)


def test_a_stronger_rotor_turns_the_way_its_place_and_spin_say(craft):
    one = answer(craft, craft.values({"rotors.2.thrust_scale": 1.1}), Inputs(
        0.01, np.full((3, 4), 0.62), np.full(3, 3.7), np.zeros((3, 3))))[0]  # fmt: skip
    # rotor 3, back left and counter-clockwise: right side down, nose down, nose to the right
    assert one[3] > 0.0
    assert one[4] > 0.0
    assert one[5] < 0.0


def test_climb_and_forward_flight_move_thrust_as_their_numbers_say(craft):
    usual = craft.values({"terms.inflow.climb": 0.1, "terms.inflow.ahead": 0.001})
    speed = np.tile([2.0, 0.0, 0.5], (3, 1))
    hover = Inputs(0.01, np.full((3, 4), 0.62), np.full(3, 3.7), np.zeros((3, 3)))
    moving = Inputs(0.01, hover.commands, hover.voltage, speed)
    still, found = (answer(craft, usual, inputs)[0] for inputs in (hover, moving))
    assert found[2] == pytest.approx(still[2] * (1.0 - 0.1 * 0.5))
    # thrust acts 2 mm further ahead: nose up, which is less than nothing about y
    lift = craft.mass * found[2]
    assert found[4] == pytest.approx(-lift * 2e-3 / craft.numbers["inertia.1"].value)


def test_a_slow_course_is_not_taken_for_noise():
    course = np.sin(np.linspace(0.0, 6.0, 60))
    rough = np.random.default_rng(0).normal(0.0, 0.05, 60)
    assert noise.white([course + rough], [[(0, 60)]]).std < 0.1


def test_whitened_noise_is_white():
    rng = np.random.default_rng(1)
    coloured = lfilter([1.0], [1.0, -0.8, 0.2], rng.standard_normal(4000))
    spans = [(0, 1500), (1500, 4000)]
    white = noise.fit([coloured], [spans], order=8).whiten(coloured, spans)
    assert white.std() == pytest.approx(1.0, abs=0.03)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.05
    both = noise.fit([coloured], [spans]).whiten(np.column_stack([coloured, 2.0 * coloured]), spans)
    assert both[:, 1] == pytest.approx(2.0 * both[:, 0])


def test_what_a_passing_load_takes_off_the_voltage_is_put_back(craft):
    columns = fly(craft, np.random.default_rng(3), 12.0)
    item = prepare("flight", tables(columns), craft, by_estimate=False)
    inside = slice(int(item.first[0]), int(item.first[-1]))
    slow, raw = item.slow.voltage[inside], item.inputs.voltage[inside]
    assert np.diff(slow).std() < 0.1 * np.diff(raw).std()
    assert slow[0] - slow[-1] == pytest.approx(raw[:200].mean() - raw[-200:].mean(), abs=0.03)


def test_speed_within_a_node_is_what_the_tilted_thrust_makes_of_it(craft):
    """East at 1 m/s, heading north, rolled so that the thrust pushes on at 1 m/s^2; a gust takes half of that away."""
    step, per = 0.01, 25
    t = step * np.arange(300)
    roll = np.full_like(t, np.arctan(1.0 / GRAVITY))
    speed, zero = 1.0 + 0.5 * t, np.zeros_like(t)
    log = tables({"estimate": {"t": t, "ve": speed, "vn": zero, "vu": zero, "u": zero, "roll": roll, "pitch": zero,
                               "heading": zero}})  # fmt: skip
    first = np.arange(50, 250, per)
    led = Motion(log, t).led(step, np.full_like(t, 9.9), first, per)
    body = np.column_stack([zero, -speed * np.cos(roll), speed * np.sin(roll)])  # the right is down
    assert led[first] == pytest.approx(body[first], abs=1e-9)
    ends = first + per - 1
    # half of the push went: the share by which all nodes end slower is taken off
    assert led[ends] == pytest.approx(body[ends], abs=0.04)
    # of the first node's speed that the others do not share, nothing is known
    speed[60:75] += 0.3
    gust = Motion(tables({"estimate": {**{n: log["estimate"][n] for n in log["estimate"].columns}, "ve": speed}}), t)
    assert gust.led(step, np.full_like(t, 9.9), first, per)[62] == pytest.approx(led[62], abs=0.02)


def test_a_late_command_is_as_rough_as_one_in_time():
    """Straight lines between samples would halve the variance of white commands that come half a step late."""
    quad = load(file_of("quad"))
    columns = quad_flights.fly(
        quad_flights.plan_of("doublets", quad, np.random.default_rng(0), 12.0), quad, quad.values(), {},
        np.random.default_rng(1),
    )  # fmt: skip
    log = tables(columns)
    moving = quick.prepare(prepare("flight", log, quad, by_estimate=False), log, quad)
    u = 0.5 + 0.05 * np.random.default_rng(2).standard_normal(moving.inputs.commands.shape)
    rough = replace(moving, inputs=replace(moving.inputs, commands=u))
    at_once, late = (rough.expected(quad, {quick.TAU: 0.0, quick.DELAY: d})[0].var() for d in (0.0, 0.005))
    assert 0.65 * at_once < late < 1.1 * at_once


def test_doublets_tell_lag_and_delay_to_three_milliseconds():
    """Flown by the blind tests' own equations, from a nominal file of another lag."""
    quad = load(file_of("quad"))
    for tau, delay in ((0.03, 0.0), (0.07, 0.02)):
        numbers = quad.values({quick.TAU: tau, quick.DELAY: delay})
        rng = np.random.default_rng(5)
        columns = quad_flights.fly(quad_flights.plan_of("doublets", quad, rng, 30.0), quad, numbers, {}, rng)
        moving = open_bench({"flight": tables(columns)}, quad)._moving
        assert moving._own[0][quick.TAU] == pytest.approx(tau, abs=0.003)
        assert moving._own[0][quick.DELAY] == pytest.approx(delay, abs=0.003)


def test_after_a_charge_more_may_differ(nominal, craft):
    columns = fly(craft, np.random.default_rng(4), 8.0)
    step = columns["battery"]["t"][1] - columns["battery"]["t"][0]
    idle = 200  # rows on the ground before

    def grounded(rest):
        found = {}
        for topic, of in columns.items():
            before = {n: np.full(idle, 0.0 if topic == "controls" or n == "u" else v[0]) for n, v in of.items()}
            found[topic] = {n: np.concatenate([before[n], v]) for n, v in of.items()}
            found[topic]["t"] = step * np.arange(len(found[topic]["t"]))
        found["battery"]["voltage"][:idle] = rest
        return {"flight": tables(found)}

    before = replace(nominal.numbers["terms.battery_sag.rest"], value=4.0)
    known = replace(nominal, numbers={**nominal.numbers, "terms.battery_sag.rest": before})
    same, charged = (open_bench(grounded(rest), known).tolerances for rest in (3.95, 4.2))
    handled = craft.numbers["terms.handled.cg"].value
    key = "terms.cg_offset.x"
    assert same[key] == nominal.numbers[key].tolerance
    assert charged[key] == pytest.approx(np.hypot(same[key], handled))
    assert "rotors.0.thrust_scale" in charged
    assert "rotors.0.thrust_scale" not in same


def test_a_normal_flight_is_not_accused(nominal, craft):
    found = verdict(nominal, craft, 10)
    assert found.baseline.certified
    assert found.causes == []
    # a hover answers gusts and little else: how late it does so is not told
    assert {"actuator_lag", "actuator_delay"} <= {item.name for item in found.not_testable}


def test_a_damaged_rotor_is_named_by_its_number(nominal, craft):
    found = verdict(nominal, craft, 11, **{"rotors.2.thrust_scale": 0.8})
    (cause,) = found.causes
    assert cause.name == "rotor_damage"
    assert cause.parameters["rotor"].value == 3
    assert cause.parameters["scale"].value == pytest.approx(0.8, abs=0.03)


def test_a_weight_is_found_where_it_hangs(nominal, craft):
    added, x, y = 0.003, -0.03, 0.03
    whole = craft.mass + added
    truth = {"mass": whole, "terms.payload.x": added * x / whole, "terms.payload.y": added * y / whole}
    (cause,) = verdict(nominal, craft, 12, **truth).causes
    assert cause.name == "mass"
    assert cause.parameters["mass"].value == pytest.approx(whole, abs=0.001)
    assert cause.parameters["x"].value < 0.0 < cause.parameters["y"].value


def test_sag_is_named(nominal, craft):
    there = nominal.numbers["terms.battery_sag.reference"].value
    truth = {"terms.battery_sag.sag": 0.4, "terms.battery_sag.reference": there}
    (cause,) = verdict(nominal, craft, 13, **truth).causes
    assert cause.name == "battery_sag"
    assert cause.parameters["sag"].ci95[0] < 0.4 < cause.parameters["sag"].ci95[1]


def test_a_log_that_does_not_fit_is_refused(craft):
    columns = fly(craft, np.random.default_rng(0), 8.0)
    del columns["controls"]["m4"]
    with pytest.raises(UserError, match=r"m1..m4"):
        diagnose({"flight": tables(columns)}, craft)
    columns = fly(craft, np.random.default_rng(0), 8.0)
    columns["controls"] = {k: v if k == "t" else 65535 * v for k, v in columns["controls"].items()}
    with pytest.raises(UserError, match=r"0 .. 1 would be right"):
        diagnose({"flight": tables(columns)}, craft)


def test_a_table_that_falls_is_refused(craft):
    document = {**craft.document, "rotors": [dict(rotor) for rotor in craft.document["rotors"]]}
    document["rotors"][0]["thrust"] = {"from": "command", "table": [[0, 0], [1, -1]], "unit": "N"}
    with pytest.raises(UserError, match="rise"):
        multirotor_from(document, "some.toml")


def crazypad(nominal_logs, logs, folder):
    flights = [[DATA / f"{name}.csv.gz" for name in names] for names in (nominal_logs, logs)]
    mapping = Path(__file__).parents[2] / "assets" / "mappings" / "crazypad.toml"
    good, judged = (read(paths, mapping).tables for paths in flights)
    return diagnose(judged, refit_to(load("crazyflie"), good, folder / "nominal.toml"))


@measured
@pytest.mark.parametrize("airframe", ["E8", "E9"])
def test_a_measured_normal_flight_shows_neither_weight_nor_damage(airframe, tmp_path):
    found = crazypad([f"normal_flight/{airframe}_log00"], [f"normal_flight/{airframe}_log01"], tmp_path)
    assert found.baseline.certified
    assert {cause.name for cause in found.causes} <= {"battery_sag"}


@measured
def test_a_cut_propeller_is_named_by_its_motor_and_sag_beside_it(tmp_path):
    normal = [f"normal_flight/E8_log0{i}" for i in (0, 1)]
    cut = [f"cut_propeller_M3_3mm_3mm_41mm/E8_log0{i}" for i in (0, 1)]
    causes = {cause.name: cause for cause in crazypad(normal, cut, tmp_path).causes}
    assert set(causes) == {"rotor_damage", "battery_sag"}
    assert causes["rotor_damage"].parameters["rotor"].value == 3
    assert 0.7 < causes["rotor_damage"].parameters["scale"].value < 0.9
    assert "mass" not in causes["rotor_damage"].confusable_with


@measured
def test_a_weight_is_one_entry_with_what_it_cannot_be_told_from(tmp_path):
    normal = [f"normal_flight/E9_log0{i}" for i in (0, 1)]
    weight = [f"add_weight_W1_near_M3/E9_log0{i}" for i in (4, 5)]
    causes = {cause.name: cause for cause in crazypad(normal, weight, tmp_path).causes}
    assert "battery_sag" in causes
    (other,) = (cause for name, cause in causes.items() if name != "battery_sag")
    assert {"mass", "rotor_damage"} <= {other.name, *(name.partition("#")[0] for name in other.confusable_with)}
    assert other.split_by is not None

"""The blind injector: sealed, repeatable, true to the tolerances, and its foreign equations are what they say."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from flightlog.readers.folder import read_flight
from sim import vehicle as vehicles
from sim.kinds import load
from sim.pipeline import Pipeline
from sim.rig_motion import Moving
from tests.blind import draws, foreign, kits, plans, quad_flights, rig_flights
from tests.blind.draws import injected
from tests.blind.effects import EFFECTS, UNKNOWN
from tests.blind.injector import make

TICK = 0.002


@pytest.fixture(scope="module")
def raptor():
    return vehicles.load("raptor90")


@pytest.fixture
def signals(raptor):
    """One term alone, and a record to run it on."""

    def of(term, **numbers):
        pipeline = Pipeline([term], {term.name: numbers}, raptor.geometry)
        return pipeline, pipeline.signals()

    return of


def short(tmp_path, seed, name, **more):
    more = {"names": ["baro_drift"], "plans": ["doublets"], "duration_s": 4.0} | more
    return make(seed, "single", tmp_path / name, tmp_path / "answers", **more)


def test_a_set_holds_measurements_and_a_hash_and_not_a_word_of_the_answer(tmp_path):
    made = short(tmp_path, 5, "one")
    told = "\n".join(path.read_text(errors="ignore") for path in made.folder.rglob("*.json"))
    assert "baro_drift" not in told
    assert "drift_rate" not in told
    assert not list(made.folder.rglob("truth"))
    assert made.open(tmp_path / "answers").names == ("baro_drift",)
    assert set(read_flight(made.flights[0]).measured) >= {"imu", "controls", "rotor", "baro", "gps"}


def test_an_answer_changed_after_the_sealing_is_refused(tmp_path):
    made = short(tmp_path, 5, "one")
    place = tmp_path / "answers" / "one.json"
    told = json.loads(place.read_text())
    told["effects"][0]["name"] = "mass"
    place.write_text(json.dumps(told, sort_keys=True))
    with pytest.raises(ValueError, match="not the one that was sealed"):
        made.open(tmp_path / "answers")


def test_the_same_seed_is_the_same_set_and_another_is_another(tmp_path):
    a, b, c = (short(tmp_path, seed, name) for seed, name in ((5, "a"), (5, "b"), (6, "c")))
    assert a.seal == b.seal != c.seal
    first, second, third = (read_flight(made.flights[0]).measured["baro"]["altitude"] for made in (a, b, c))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, third)


def test_topics_left_out_are_left_out(tmp_path):
    made = short(tmp_path, 5, "one", without=("sonar", "mag"))
    assert not {"sonar", "mag"} & set(read_flight(made.flights[0]).measured)


def test_numbers_are_drawn_with_the_standard_deviation_that_the_file_declares(raptor):
    rng = np.random.default_rng(1)
    keys = [("mass",), ("terms", "ground_effect", "gain"), ("sensors", "baro", "noise"),
            ("terms", "tail_rotor", "gear")]  # fmt: skip
    found = {key: [] for key in keys}
    for _ in range(300):
        document = draws.drawn(raptor.document, rng)
        for key in keys:
            number = document
            for part in key:
                number = number[part]
            found[key].append(number["value"])
    for key, tolerance in zip(keys, (0.05, 0.1, 0.03, 0.0), strict=True):
        assert np.std(found[key]) == pytest.approx(tolerance, rel=0.15)
        if tolerance:
            assert np.ptp(found[key]) < 6.001 * tolerance


@pytest.mark.parametrize("name", [*EFFECTS, *UNKNOWN])
def test_every_effect_makes_a_vehicle_and_follows_its_size(raptor, name):
    draw = EFFECTS[name] if name in EFFECTS else UNKNOWN[name][0]
    seen = set()
    for seed in range(6):
        small, large = (draw(raptor, np.random.default_rng(seed), share) for share in (0.5, 1.0))
        assert (small.name, small.form) == (large.name, large.form) or name == "actuator_delay"
        seen.add(large.form)
        assert large.settings or large.terms or large.tampering
        changed = injected(raptor, [large])
        assert len(changed.terms) == len(raptor.terms) + len(large.terms) + len(
            {key.split(".")[1] for key in large.settings if key.startswith("terms.")} - set(raptor.parameters)
        )
    assert seen


def test_hayden_is_nothing_far_up_and_thirteen_percent_of_power_one_radius_up(signals, raptor):
    pipeline, s = signals(foreign.HAYDEN, gain=1.0)
    for height, power in ((50.0, 1.0), (0.73 - 0.22, 1.0 / (0.9926 + 0.0379 * 4.0))):
        s["height"], s["up"] = height, (0.0, 0.0, 1.0)
        pipeline.run(s, TICK)
        assert float(s["ground"]) == pytest.approx(power, abs=1e-3)


def test_frames_hold_and_hand_on_late(signals):
    pipeline, s = signals(foreign.FRAME_DELAY, period=0.01, frames=2.0)
    sent, got = np.zeros(100), np.zeros(100)
    for k in range(100):
        sent[k] = s["collective"] = float(k >= 10)
        pipeline.run(s, TICK)
        got[k] = s["collective"]
    late = (np.argmax(got > 0.5) - 10) * TICK
    assert 0.02 <= late <= 0.03
    assert set(got) == {0.0, 1.0}


def test_two_lags_are_late_by_their_time_constant_on_a_ramp(signals):
    pipeline, s = signals(foreign.TWO_LAGS, tau=0.05)
    for k in range(500):
        s["tail"] = ramp = k * TICK
        pipeline.run(s, TICK)
    assert ramp - float(s["tail"]) == pytest.approx(0.05, abs=2e-3)


def test_a_stepwise_burn_burns_what_its_rate_says(signals):
    pipeline, s = signals(foreign.STEP_BURN, rate=0.01, every=4.0)
    burnt = []
    for t in np.arange(0.0, 40.0, 0.5):
        s["time"] = t
        pipeline.run(s, TICK)
        burnt.append(5.0 - float(s["mass"]))
    assert burnt[-1] == pytest.approx(0.36, abs=1e-9)
    assert len(set(np.round(burnt, 6))) == 10


def test_plans_stay_over_the_ground_and_every_one_asks_for_something():
    for seed in range(20):
        for name, plan in plans.PLANS.items():
            made = plan(np.random.default_rng(seed), 60.0)
            assert made.name == name
            assert all(leg.height > 0.5 and abs(leg.east) < 20 and abs(leg.north) < 20 for leg in made.legs)
            assert all(0.0 <= leg.at_s < 60.0 for leg in made.legs)
            assert len(made.legs) > 1 or made.doublets or made.steps_m
    doublet = plans.Doublet(3.0, "tail", 0.1, 0.5)
    assert [doublet.at(t) for t in (2.9, 3.2, 3.7, 4.1)] == [0.0, 0.1, -0.1, 0.0]


def test_a_box_closes_and_its_sides_are_square():
    made = plans.box(np.random.default_rng(3), 60.0)
    at = np.array([(leg.east, leg.north) for leg in made.legs[:5]])
    sides = np.diff(at, axis=0)
    assert np.linalg.norm(sides, axis=1) == pytest.approx(np.linalg.norm(sides[0]))
    assert np.sum(sides[:-1] * sides[1:], axis=1) == pytest.approx(0.0, abs=1e-9)
    assert at[0] == pytest.approx(at[4])


def test_wind_stays_what_a_pilot_can_hold():
    rng = np.random.default_rng(2)
    drawn = [plans.weather(rng, 3.0) for _ in range(200)]
    assert max(table.wind_m_s for table in drawn) <= 6.6
    assert np.mean([table.wind_m_s for table in drawn]) == pytest.approx(3.0 * math.sqrt(math.pi / 2), rel=0.2)


def test_an_effect_is_in_the_flight(tmp_path, monkeypatch):
    """A barometer that drifts reads what it drifts; the same flight without it does not."""
    made = short(tmp_path, 8, "with")
    rate = made.open(tmp_path / "answers").effects[0].values["rate"]
    monkeypatch.setattr(kits.draws, "injected", lambda true, effects: injected(true, []))
    monkeypatch.setitem(
        kits.EFFECTS, "baro_drift",
        lambda v, rng, share: replace(EFFECTS_BEFORE(v, rng, share), tampering=()),
    )  # fmt: skip
    plain = short(tmp_path, 8, "without")
    drifted, sound = (read_flight(m.flights[0]).measured["baro"]["altitude"] for m in (made, plain))
    assert (drifted - sound)[-25:].mean() == pytest.approx(4.0 * rate, abs=0.25 + abs(rate))


EFFECTS_BEFORE = EFFECTS["baro_drift"]


def test_the_rig_moves_as_mujoco_moves_it(monkeypatch):
    """Equations written apart, steps of half a millisecond against MuJoCo's; friction, spring and deadband in force."""
    rig = load(kits.file_of("gimbal"))
    monkeypatch.setattr(rig_flights, "SHAKEN", 0.0)
    changes = {"terms.joint_friction.pan.coulomb": 0.005, "terms.joint_stiffness.pan.stiffness": 0.01,
               "terms.input_nonlinearity.pan_motor.deadband": 0.2}  # fmt: skip
    for name in rig_flights.NAMES:
        rng = np.random.default_rng(1)
        course = rig_flights.plan_of(name, rng, 8.0)
        own = rig_flights.fly(course, replace(rig, noise=dict.fromkeys(rig.joints, 1e-9)), rig.values(changes), {}, rng)
        angles = np.column_stack([own["joints"][joint] for joint in rig.joints])
        moving = Moving(rig, 0.01, changes, longest=0.0005)
        start = np.array([[*angles[0], 0.0, 0.0]])
        states = moving.run(start, moving.torques(np.repeat(course.values, 2, axis=0))[None])[0]
        assert np.abs(states[: len(angles), :2] - angles).max() < 4e-3 < 0.03 * np.ptp(angles)


@pytest.mark.parametrize("vehicle", ["quad", "quad_speed", "crazyflie"])
def test_a_quadrotor_carries_its_weight_wherever_its_numbers_were_drawn(vehicle):
    kit = kits.kit_of(vehicle)
    for seed, name in enumerate(quad_flights.NAMES):
        rng = np.random.default_rng(seed)
        craft = kit.draw(rng)
        plan = quad_flights.plan_of(name, kit.nominal, rng, 30.0)
        columns = quad_flights.fly(plan, kit.nominal, craft.numbers, {}, rng)
        assert columns["imu"]["fz"].mean() == pytest.approx(9.81, abs=0.25)
        state = columns.get("estimate", columns.get("reference"))
        assert state["u"].min() > 0.05 and state["u"].max() < 6.5


def test_what_makes_a_quadrotor_turn_is_its_balance():
    """Without gusts the specific force and the angular acceleration are those of the vehicle file's own equations."""
    kit = kits.kit_of("quad")
    rng = np.random.default_rng(3)
    plan = quad_flights.plan_of("ladder", kit.nominal, rng, 10.0)
    numbers = dict(kit.nominal.values()) | {"rotors.2.thrust_scale": 0.85}
    columns = quad_flights.fly(plan, kit.nominal, numbers, {}, rng)
    sent = {i: columns["controls"][f"m{i}"].mean() for i in (1, 2, 3, 4)}
    # a rotor that gives less is asked for more, by as much as its table needs for the same thrust
    lift = {i: np.interp(sent[i], *kit.nominal.tables[i - 1].T) for i in sent}
    assert lift[3] * 0.85 == pytest.approx(np.mean([lift[1], lift[2], lift[4]]), rel=0.06)


@pytest.mark.parametrize("vehicle", ["quad", "crazyflie", "quad_speed", "gimbal"])
def test_every_effect_of_every_kind_can_be_drawn_and_moves_what_it_says(vehicle):
    kit = kits.kit_of(vehicle)
    for name, draw in {**kit.effects, **{n: d for n, (d, _, _) in kit.unknown.items()}}.items():
        for seed in range(4):
            rng = np.random.default_rng(seed)
            craft = kit.draw(rng)
            wrong = kit.effect(draw, craft, rng, 1.0)
            injected = kit.inject(craft, [wrong])
            assert wrong.name == name
            assert injected.numbers != craft.numbers or injected.otherwise != craft.otherwise
            assert set(injected.numbers) == set(craft.numbers)

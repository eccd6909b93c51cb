"""The world against closed forms: falling, turning, resting, its energy, its sensors' clocks, and how it ends."""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

from flightlog.constants import GRAVITY
from flightlog.errors import UserError
from flightlog.marks import HMark
from flightlog.rotations import angles, wrap
from flightlog.signals import BaroSample, Controls, GpsSample, ImuSample, MagSample, PadSample, RotorSample, SonarSample
from sim import vehicle as vehicles
from sim.divergence import SimulationDiverged
from sim.linearisation import trim
from sim.pipeline import Pipeline
from sim.sensors.faults import Offset
from sim.terms import CATALOGUE
from sim.terms.contract import Stage, Term, kernel
from sim.weather import Weather
from sim.wind import Gust
from sim.world import STEP, Start, World

STILL = Weather(wind=0.0, turbulence="none")
TOPICS = {
    ImuSample: "imu", MagSample: "mag", BaroSample: "baro", GpsSample: "gps", SonarSample: "sonar",
    RotorSample: "rotor", PadSample: "pad",
}  # fmt: skip


@pytest.fixture
def world(raptor):
    """`world()` hovers in still air at 10 m over an H."""

    def build(vehicle=raptor, *, height=10.0, seed=0, **keywords):
        keywords.setdefault("weather", STILL)
        return World(
            vehicle,
            mark=HMark(),
            start=Start(np.array([0.0, 0.0, height])),
            seeds=np.random.SeedSequence(seed),
            **keywords,
        )

    return build


def unlifted(world):
    """Take all terms away: what is left is a rigid body."""
    world.pipeline = Pipeline((), {}, world.vehicle.geometry)
    return world


def without(raptor, *names):
    kept = tuple(term for term in raptor.terms if term.name not in names)
    return replace(raptor, terms=kept, parameters={term.name: raptor.parameters[term.name] for term in kept})


# --- motion -----------------------------------------------------------------------------------------------------------


def test_without_terms_it_falls_freely_and_feels_nothing(world):
    w = unlifted(world())
    steps = 250
    for _ in range(steps):
        w.step(Controls())
    t = steps * STEP
    # semi-implicit Euler is half a tick's fall lower than the parabola
    assert w.truth.position == pytest.approx([0.0, 0.0, 10.0 - 0.5 * GRAVITY * t * (t + STEP / 2)], abs=1e-9)
    assert w.truth.velocity == pytest.approx([0.0, 0.0, -GRAVITY * t], abs=1e-9)
    assert w.truth.specific_force == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert w.truth.rates == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_trimmed_it_stays_where_it_is_for_a_second(world):
    w = world()
    for _ in range(250):
        w.step(w.trim.controls)
    assert w.truth.position == pytest.approx([0.0, 0.0, 10.0], abs=2e-3)
    assert w.truth.velocity == pytest.approx([0.0, 0.0, 0.0], abs=4e-3)
    assert w.truth.specific_force == pytest.approx(w.truth.rotation.T @ [0.0, 0.0, GRAVITY], abs=1e-2)
    assert w.truth.rotor_speed == pytest.approx(w.site.nominal_rotor_speed, abs=0.1)


def test_the_files_mass_and_inertia_are_those_that_fly(raptor, world):
    heavy = replace(raptor, inertia=raptor.inertia * 2.0)
    turn = []
    for vehicle in (raptor, heavy):
        w = world(vehicle)
        controls = w.trim.controls._replace(lateral=w.trim.controls.lateral + 0.02, tail=w.trim.controls.tail + 0.02)
        for _ in range(25):
            w.step(controls)
        turn.append(w.truth.rates.copy())
        assert w.model.body_inertia[w._body] == pytest.approx(vehicle.inertia)
    assert turn[1][2] == pytest.approx(turn[0][2] / 2.0, rel=0.05)
    loaded = vehicles.load("raptor90", {"mass": 6.0})
    w = world(loaded)
    w.step(w.trim.controls)
    assert w.model.body_mass.sum() == pytest.approx(6.0, abs=1e-4)


def test_a_pirouette_is_seen_by_gyroscope_and_magnetometer(world):
    w = world()
    w.step(w.trim.controls)
    controls = w.trim.controls._replace(tail=w.trim.controls.tail + 0.06)
    gyro, declination = [], []
    before = angles(w.truth.quaternion)[2]
    for _ in range(150):
        w.step(controls)
        for sample in w.measure():
            if isinstance(sample, ImuSample):
                gyro.append(sample.wz - w.truth.rates[2])
            elif isinstance(sample, MagSample):
                east, north, _ = w.truth.rotation @ sample[1:]
                declination.append(math.atan2(east, north))  # the field points north, wherever the nose does
    turned = wrap(angles(w.truth.quaternion)[2] - before)
    assert w.truth.rates[2] < -0.5 and turned > 0.2  # nose right: clockwise, wz < 0
    assert abs(np.mean(gyro)) < 0.02 and np.std(gyro) < 0.1
    assert np.abs(declination).max() < math.radians(5.0)


@kernel
def _shove(s, v, x, p, dt):
    if s.time > 0.02:
        s.force[1] += 100.0


def surplus(w, throttle, seed=4):
    """By step of a second's rough flying, the energy [J] of body, height and rotor beyond what the engine gave."""
    engine = w.vehicle.parameters["engine"]["inertia"]
    rng = np.random.default_rng(seed)
    trim = w.trim.controls

    def energy():
        t, mass = w.truth, float(w.signals["mass"])
        turning = float(w.vehicle.inertia @ t.rates**2) + engine * t.rotor_speed**2
        return 0.5 * (mass * t.velocity @ t.velocity + turning) + mass * GRAVITY * t.position[2]

    w.step(trim)
    held, last, found = trim, energy(), []
    for k in range(250):
        if k % 25 == 0:
            up, right, forward, tail = rng.uniform(-1.0, 1.0, 4) * [0.03, 0.03, 0.03, 0.05]
            held = Controls(
                trim.collective + up, trim.lateral + right, trim.longitudinal + forward, trim.tail + tail, throttle
            )
        w.step(held)
        work = float(w.signals["engine_torque"]) * w.truth.rotor_speed * STEP
        now = energy()
        found.append(now - last - work)
        last = now
    return np.array(found)


@pytest.mark.parametrize("throttle", [0.0, 1.0])
def test_no_term_makes_energy_out_of_nothing(world, throttle):
    gained = surplus(world(height=20.0), throttle)
    assert gained.max() < 0.02  # [J] a step: the integrator's own, of 2 J that the rotor takes from its shaft
    assert gained.sum() < -100.0  # the air takes a good deal in a second


def test_energy_out_of_nothing_would_be_seen(world):
    gained = surplus(world(height=20.0, extra_terms=[Term("shove", Stage.WRENCH, _shove, ())]), 0.0)
    assert gained.max() > 0.02


def test_dropped_from_ten_centimetres_it_comes_to_rest_on_its_skids(world, raptor):
    low = float(raptor.geometry["skid_height"])
    w = unlifted(world(height=low + 0.10))
    heights, forces, counts = [], [], []
    for _ in range(750):
        w.step(Controls())
        heights.append(float(w.data.qpos[2]))
        forces.append(w.contact.force)
        counts.append(w.contact.count)
    touched = int(np.argmax(np.array(counts) > 0))
    assert touched * STEP == pytest.approx(math.sqrt(2.0 * 0.10 / GRAVITY), abs=0.02)
    after = np.array(heights[touched:])
    assert after.min() > low - 0.02  # skids and ground give way by so much
    lowest = int(after.argmin())
    assert after[lowest:].max() < low + 0.02  # it does not jump up again
    rest = np.array(heights[-250:])
    assert np.ptp(rest) < 1e-4  # stands still for the last second
    assert np.abs(w.data.qvel[:6]).max() < 1e-3
    assert min(counts[-250:]) >= 2
    assert np.mean(forces[-250:]) == pytest.approx(5.0 * GRAVITY, rel=0.01)
    assert angles(w.data.qpos[3:7])[0] == pytest.approx(0.0, abs=0.05)


# --- sensors ----------------------------------------------------------------------------------------------------------


def test_every_sensor_comes_at_its_rate_and_after_its_latency(world, raptor):
    w = world()
    seen = {topic: [] for topic in TOPICS.values()}
    for _ in range(500):
        w.step(w.trim.controls)
        for sample in w.measure():
            seen[TOPICS[type(sample)]].append((sample.t, w.t))
    for topic, pairs in seen.items():
        t, arrived = np.array(pairs).T
        camera = raptor.cameras["down"]
        rate = camera.rate if topic == "pad" else raptor.sensors[topic].numbers["rate"]
        latency = camera.latency if topic == "pad" else raptor.sensors[topic].numbers["latency"]
        assert len(t) >= 0.9 * (2.0 - latency) * rate, topic
        gaps = np.diff(t) * rate
        assert gaps == pytest.approx(np.round(gaps), abs=1e-6) and gaps.min() > 0.5, topic
        if topic != "pad":  # which may miss the mark
            assert gaps.max() == pytest.approx(1.0, abs=1e-6), topic
        late = arrived - t - latency
        assert late.min() > -1e-9 and late.max() < STEP, topic


def test_a_silenced_sensor_says_nothing_for_its_time(world):
    w = world()
    w.silence("baro", 0.5)
    t = []
    for _ in range(200):
        w.step(w.trim.controls)
        t += [sample.t for sample in w.measure() if isinstance(sample, BaroSample)]
    assert t and min(t) >= 0.5


def test_faults_from_outside_change_what_is_sent_and_nothing_else(world):
    def heights(faults):
        w = world(extra_faults=faults)
        samples = []
        for _ in range(100):
            w.step(w.trim.controls)
            samples += [sample.altitude for sample in w.measure() if isinstance(sample, BaroSample)]
        return np.array(samples), w.data.qpos.copy()

    plain, where = heights([])
    off, also = heights([Offset(topic="baro", column="altitude", size=5.0, start=0.2)])
    shift = off - plain
    assert shift[0] == 0.0 and shift[-1] == pytest.approx(5.0)
    assert np.array_equal(where, also)


def test_same_seed_same_measurements_and_another_seed_others(world):
    def measured(seed):
        w = world(seed=seed, weather=Weather(wind=3.0))
        found = []
        for _ in range(50):
            w.step(w.trim.controls)
            found += w.measure()
        return found, w.data.qpos.copy()

    (first, there), (again, also), (other, elsewhere) = measured(7), measured(7), measured(8)
    assert [repr(sample) for sample in first] == [repr(sample) for sample in again]
    assert np.array_equal(there, also)
    assert repr(first[0]) != repr(other[0])
    assert not np.array_equal(there, elsewhere)


# --- weather ----------------------------------------------------------------------------------------------------------


def test_wind_and_gusts_move_it_the_way_they_blow(world):
    calm, blown = world(), world()
    blown.add_gust(Gust(start=0.0, duration=1.0, speed=8.0, wind_from=math.radians(270.0), up=0.0))
    for _ in range(200):
        calm.step(calm.trim.controls)
        blown.step(blown.trim.controls)
    assert blown.truth.position[0] - calm.truth.position[0] > 0.02  # from the west: to the east
    windy = world()
    windy.set_wind(6.0, 0.0)
    windy.step(windy.trim.controls)
    assert windy.truth.wind[1] < -4.0  # from the north: southward


@pytest.mark.parametrize("wind_from", range(0, 360, 45))
def test_it_can_hold_its_place_in_a_fresh_wind_from_anywhere(raptor, model, wind_from):
    direction = math.radians(wind_from)
    air = -12.0 * np.array([math.sin(direction), math.cos(direction), 0.0])
    found = trim(model(), raptor.inertia, wind=air)
    assert abs(found.controls.tail) < raptor.parameters["servo"]["tail_max"]
    assert math.hypot(found.roll, found.pitch) < 0.5


def test_composing_leaves_the_choice_of_opengl_as_it_was(world, monkeypatch):
    for choice in (None, "egl"):
        monkeypatch.delenv("MUJOCO_GL", raising=False)
        if choice is not None:
            monkeypatch.setenv("MUJOCO_GL", choice)
        world()
        assert os.environ.get("MUJOCO_GL") == choice


# --- terms ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_each_term_can_be_left_out_or_it_is_said_why_not(world, raptor, name):
    try:
        w = world(without(raptor, name))
    except UserError as error:
        assert name in ("main_rotor", "hub", "tail_rotor", "flapping")  # nothing else holds it up, straight and level
        assert "raptor90.toml" in str(error) and "\n" not in str(error)
        return
    for _ in range(25):
        w.step(w.trim.controls)
    assert np.isfinite(w.data.qpos).all()
    assert w.truth.position == pytest.approx([0.0, 0.0, 10.0], abs=0.01)


@kernel
def _push(s, v, x, p, dt):
    s.force[1] += p[0]


PUSH = Term("push", Stage.WRENCH, _push, (replace(CATALOGUE["ground_effect"].parameters[0], name="left"),))


def test_a_term_from_outside_flies_with_the_others(world):
    w = world(extra_terms=[PUSH], extra_parameters={"push": {"left": 3.0}})
    lean = angles(w.truth.quaternion)[0] - angles(world().truth.quaternion)[0]
    # it leans right against a push to the left
    assert lean == pytest.approx(math.asin(3.0 / (5.0 * GRAVITY)), rel=0.05)
    for _ in range(125):
        w.step(w.trim.controls)
    assert w.truth.position == pytest.approx([0.0, 0.0, 10.0], abs=2e-3)


# --- the end of the numbers -------------------------------------------------------------------------------------------


@kernel
def _nan_force(s, v, x, p, dt):
    if s.time > 0.1:
        s.force[0] += math.nan


@kernel
def _nan_state(s, v, x, p, dt):
    if s.time > 0.1:
        x[0] = math.inf
    s.force[2] += x[0]


@kernel
def _huge(s, v, x, p, dt):
    if s.time > 0.1:
        s.force[2] += 1e200


@kernel
def _nan_thrust(s, v, x, p, dt):
    if s.time > 0.1:
        s.thrust = math.sqrt(-s.height)


@pytest.mark.parametrize(
    ("term", "words"),
    [
        (Term("poison", Stage.WRENCH, _nan_force, ()), ["term 'poison'", "'force'"]),
        (Term("adrift", Stage.WRENCH, _nan_state, (), ("depth",)), ["term 'adrift'", "'depth'"]),
        (Term("giant", Stage.WRENCH, _huge, ()), ["term 'giant'"]),
        (Term("root", Stage.THRUST, _nan_thrust, ()), ["term 'root'", "'thrust'"]),
    ],
    ids=lambda item: getattr(item, "name", None),
)
def test_a_term_that_leaves_the_numbers_is_named_with_time_and_state(world, term, words, capfd):
    w = world(extra_terms=[term])
    with pytest.raises(SimulationDiverged) as end:
        for _ in range(100):
            w.step(w.trim.controls)
    text = str(end.value)
    assert "\n" not in text
    assert "position [0.0, 0.0, 10.0] m" in text or "position [-0.0" in text or "position [0.0, -0.0" in text
    assert 0.09 < w.t < 0.13 and f"t = {w.t:.3f} s" in text
    assert "rotor 157.1 rad/s" in text
    for word in words:
        assert word in text, text
    assert capfd.readouterr().err == ""  # MuJoCo has nothing to add


def test_a_control_that_is_no_number_is_named(world):
    w = world()
    with pytest.raises(SimulationDiverged, match="control 'tail', which the pilot sent as nan"):
        w.step(w.trim.controls._replace(tail=math.nan))


def test_a_body_too_light_for_the_step_is_called_unstable(world):
    w = world()
    w.data.qvel[3:6] = 1e160
    with pytest.raises(SimulationDiverged):
        for _ in range(10):
            w.step(w.trim.controls)


def test_what_cannot_be_trimmed_is_refused(world):
    with pytest.raises(UserError, match=r"raptor90\.toml: cannot hold its place at 10\.0 m in 40 m/s of wind"):
        world(weather=Weather(wind=40.0, turbulence="none"))



"""Nothing in the loop reads the truth, and every sensor counts."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from flightlog.rotations import angles, wrap
from scenarios.crew import make_navigator
from scenarios.load import build, load


@pytest.fixture
def scrambled(noise):
    """Calls an update while all truth is noise."""

    def call(world, update, argument):
        with noise(world):
            return update(argument)

    return call


@pytest.fixture(scope="module")
def scenario():
    return load("landing", {"duration_s": 6.0, "weather.wind_m_s": 4.0})


def test_noise_in_place_of_truth_changes_no_control(watch, scrambled, scenario):
    plain = watch(scenario, seed=3)
    blind = watch(scenario, seed=3, around=scrambled)
    assert len(plain.controls) > 1300  # 250 a second, for more than 5 s
    assert np.array_equal(plain.controls, blind.controls)
    assert np.array_equal(plain.truth, blind.truth)
    assert np.ptp(plain.controls, axis=0).min() > 1e-3  # and they were controls that moved


@pytest.mark.parametrize(
    "peek",
    [
        lambda world, state: replace(state, position=0.99 * state.position + 0.01 * world.truth.position),
        lambda world, state: replace(state, rotor_speed=state.rotor_speed + 1e-3 * float(world.signals["thrust"])),
        lambda world, state: replace(state, velocity=state.velocity - 0.001 * world._air),
        lambda world, state: replace(state, position=state.position + 0.001 * world.sensor_errors()["baro"][0]),
        lambda world, state: replace(state, heading=state.heading + 1e-6 * world.data.qpos[2]),
    ],
    ids=["position", "rotor", "wind", "sensor errors", "physics"],
)
def test_a_navigator_that_peeks_is_found_out(watch, scrambled, peek):
    short = load("landing", {"duration_s": 1.0})
    worlds = []

    def cheat(*arguments):
        honest = make_navigator(*arguments)
        update = honest.update
        honest.update = lambda measurements: peek(worlds[-1], update(measurements))
        return honest

    def seen(around):
        def remember(world, update, argument):
            worlds.append(world)
            return around(world, update, argument)

        return watch(short, seed=3, around=remember, navigator=cheat).controls

    plain = seen(lambda world, update, argument: update(argument))
    assert not np.array_equal(plain, seen(scrambled))


def test_the_noise_puts_everything_back(watch, noise):
    world = watch(load("landing", {"duration_s": 0.6}), seed=1).world
    before = copy.deepcopy([a for a in noise(world).arrays])
    errors, signals, truth = world.sensor_errors(), world.signals.copy(), repr(world.truth)
    with noise(world):
        assert repr(world.truth) != truth
        assert world.sensor_errors() != errors
        assert world.signals != signals
    assert all(np.array_equal(a, b) for a, b in zip(noise(world).arrays, before, strict=True))
    assert (world.sensor_errors(), repr(world.truth)) == (errors, truth)
    assert world.signals == signals


# --- every sensor counts ----------------------------------------------------------------------------------------------


def hover(height=10.0, *, pad="h", seconds=14.0, events=(), **tables):
    return build(
        duration_s=seconds,
        pad=pad,
        start={"position_m": [0.0, 0.0, height]},
        plan={"goal": "hover", "point_m": [0.0, 0.0, height]},
        weather={"wind_m_s": 2.0},
        events=list(events),
        **tables,
    )


def column(sensor, name, size, at=2.0, fault="offset"):
    return {"at_s": at, "kind": "fault", "sensor": sensor, "column": name, "fault": fault, "size": size}


def lost(sensor, at=2.0):
    return {"at_s": at, "kind": "dropout", "sensor": sensor, "for_s": 1000.0}


@pytest.mark.parametrize(
    ("clean", "degraded", "figure", "least"),
    [
        pytest.param(
            hover(pad="none", events=[lost("gps")]),
            hover(pad="none", events=[lost("gps"), column("baro", "altitude", 0.3, fault="ramp")]),
            lambda flown: flown.error(axes=(2,), after=6.0), 1.5, id="baro",
        ),
        pytest.param(
            hover(pad="none"), hover(pad="none", sensors={"gps": {"bias_e_m": 3.0}}),
            lambda flown: flown.stray(after=6.0), 1.5, id="gps",
        ),
        pytest.param(
            hover(2.0, pad="none", events=[lost("gps")]),
            hover(2.0, pad="none", events=[lost("gps"), column("sonar", "range", 0.4)]),
            lambda flown: flown.error(axes=(2,), after=6.0), 0.15, id="sonar",
        ),
        pytest.param(
            hover(), hover(events=[column("imu", "fx", 1.0), column("imu", "wy", 0.05)]),
            lambda flown: flown.error(axes=(0, 1), after=2.0), 0.02, id="imu",
        ),
        pytest.param(
            hover(5.0, events=[lost("gps")]), hover(5.0, events=[lost("gps"), lost("pad")]),
            lambda flown: flown.stray(after=3.0), 0.2, id="pad",
        ),
        pytest.param(
            hover(5.0, pad="none"), hover(5.0, pad="none", events=[column("mag", "my", 4.0)]),
            lambda flown: abs(wrap(angles(flown.world.truth.quaternion)[2])), 0.05, id="mag", marks=pytest.mark.slow,
        ),
        pytest.param(
            hover(), hover(events=[column("rotor", "speed", -15.0)]),
            lambda flown: abs(flown.world.truth.rotor_speed - 157.1), 5.0, id="rotor", marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_each_sensor_degraded_makes_the_flight_worse(watch, clean, degraded, figure, least):
    good, bad = watch(clean, seed=5), watch(degraded, seed=5)
    n = min(len(good.controls), len(bad.controls))
    assert not np.array_equal(good.controls[:n], bad.controls[:n])
    assert figure(bad) > figure(good) + least, (figure(good), figure(bad))


@pytest.mark.render
def test_a_dark_or_blurred_camera_makes_the_flight_worse(watch):
    """The same two seconds through pictures: as they should be, much defocused, and black."""

    def seen(**down):
        cameras = {"down": down, "forward_a": {"rate_hz": 1.0}, "forward_b": {"rate_hz": 1.0}}
        flown = watch(hover(5.0, seconds=2.0, cameras=cameras), seed=5, cameras=True)
        return flown.estimate[-1, 4], flown.std[-1, :2].max(), flown.error(axes=(0, 1), after=1.0), flown.controls

    clear, blurred, black = seen(), seen(defocus_px=10.0), seen(gain=0.01)
    ages, stds, errors, controls = zip(clear, blurred, black, strict=True)
    assert ages[0] < 0.2 and np.isinf(ages[2])  # [s] since the mark was seen
    assert stds[2] > 2.0 * stds[0]
    assert errors[2] > 5.0 * errors[0]
    assert not np.array_equal(controls[0], controls[1]) and not np.array_equal(controls[0], controls[2])

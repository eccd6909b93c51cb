"""Nothing in the loop reads the truth, and every sensor counts."""

import copy
from dataclasses import fields, replace

import numpy as np
import pytest

from flightlog.rotations import angles, wrap
from scenarios.crew import make_navigator
from scenarios.load import build, load

# not what only the simulator knows: what its sensors are made of, and the mount that is known aboard as well
MACHINERY = ("numbers", "site", "rng", "topic", "_mount", "_axes")


class Noise:
    """Replaces all that only a simulator may know by noise, and puts it back."""

    def __init__(self, world):
        self.world = world
        self.rng = np.random.default_rng(12345)
        truth = world.truth
        holders = [truth, *world._sensors.values(), world.wind, world.contact]
        self.arrays = [a for holder in holders for a in self._arrays(holder)]
        data = world.data
        self.arrays += [getattr(data, name) for name in
                        ("qpos", "qvel", "qacc", "xpos", "xquat", "xmat", "xipos", "cvel", "qfrc_applied", "cam_xpos")]
        self.arrays += [world._air, world.pipeline.state]
        self.holders = holders

    @staticmethod
    def _slots(holder):
        if hasattr(holder, "__dict__"):
            return vars(holder)
        return {field.name: getattr(holder, field.name) for field in fields(holder)}

    def _arrays(self, holder):
        arrays = [v for k, v in self._slots(holder).items() if isinstance(v, np.ndarray) and k not in MACHINERY]
        return [array for array in arrays if array.dtype.kind == "f" and array.flags.writeable]

    def __enter__(self):
        self.kept = [a.copy() for a in self.arrays]
        self.signals = self.world.signals.copy()
        self.numbers = []
        for array in self.arrays:
            array[...] = self.rng.normal(0.0, 100.0, array.shape)
        for name in self.world.signals.dtype.names:
            self.world.signals[name] = self.rng.normal(0.0, 100.0, np.shape(self.world.signals[name]))
        for holder in self.holders:
            for name, value in list(self._slots(holder).items()):
                if name in MACHINERY:
                    continue
                if isinstance(value, float):
                    self.numbers.append((holder, name, value))
                    setattr(holder, name, float(self.rng.normal(0.0, 100.0)))
                elif isinstance(value, tuple | list) and value and isinstance(value[0], float):
                    self.numbers.append((holder, name, value))
                    setattr(holder, name, type(value)(self.rng.normal(0.0, 100.0, len(value)).tolist()))
        return self

    def __exit__(self, *_):
        for holder, name, value in self.numbers:
            setattr(holder, name, value)
        for array, kept in zip(self.arrays, self.kept, strict=True):
            array[...] = kept
        for name in self.world.signals.dtype.names:
            self.world.signals[name] = self.signals[name]


def scrambled(world, update, argument):
    with Noise(world):
        return update(argument)


@pytest.fixture(scope="module")
def scenario():
    return load("landing", {"duration_s": 6.0, "weather.wind_m_s": 4.0})


def test_noise_in_place_of_truth_changes_no_control(watch, scenario):
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
def test_a_navigator_that_peeks_is_found_out(watch, peek):
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


def test_the_noise_puts_everything_back(watch, scenario):
    world = watch(load("landing", {"duration_s": 0.6}), seed=1).world
    before = copy.deepcopy([a for a in Noise(world).arrays])
    errors, signals, truth = world.sensor_errors(), world.signals.copy(), repr(world.truth)
    with Noise(world):
        assert repr(world.truth) != truth
        assert world.sensor_errors() != errors
        assert world.signals != signals
    assert all(np.array_equal(a, b) for a, b in zip(Noise(world).arrays, before, strict=True))
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
            lambda flown: abs(wrap(angles(flown.world.truth.quaternion)[2])), 0.05, id="mag",
        ),
        pytest.param(
            hover(), hover(events=[column("rotor", "speed", -15.0)]),
            lambda flown: abs(flown.world.truth.rotor_speed - 157.1), 5.0, id="rotor",
        ),
    ],
)  # fmt: skip
def test_each_sensor_degraded_makes_the_flight_worse(watch, clean, degraded, figure, least):
    good, bad = watch(clean, seed=5), watch(degraded, seed=5)
    n = min(len(good.controls), len(bad.controls))
    assert not np.array_equal(good.controls[:n], bad.controls[:n])
    assert figure(bad) > figure(good) + least, (figure(good), figure(bad))

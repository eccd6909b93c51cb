"""Flights without cameras, watched from outside: flown once, looked at many times."""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
import pytest

import scenarios.flight
from scenarios.crew import make_navigator, make_pilot
from scenarios.flight import Flight, fly
from scenarios.schema import Scenario

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


@pytest.fixture(scope="session")
def noise() -> type[Noise]:
    return Noise


@dataclass
class Watched:
    """A flight with what nobody aboard may see: truth (N, 7) t, e, n, u, ve, vn, vu; estimate (N, 5) t, e, n, u, pad's
    age; std (N, 3) of the estimated position; and the controls (M, 5) that the pilot sent."""

    flight: Flight
    truth: np.ndarray
    estimate: np.ndarray
    std: np.ndarray
    controls: np.ndarray
    world: object

    def stray(self, point=(0.0, 0.0, 0.0), after=0.0, horizontal=True):
        """Largest distance [m] from a point after a time."""
        here = self.truth[self.truth[:, 0] > after, 1:4] - np.asarray(point)
        return float(np.linalg.norm(here[:, :2] if horizontal else here, axis=1).max())

    def error(self, axes=(0, 1, 2), after=1.0):
        """Largest error [m] of the estimated position in these axes after a time."""
        chosen = self.truth[:, 0] > after
        difference = (self.estimate[chosen, 1:4] - self.truth[chosen, 1:4])[:, list(axes)]
        return float(np.linalg.norm(difference, axis=1).max())


@pytest.fixture
def watch(monkeypatch) -> Callable[..., Watched]:
    """Fly a scenario and keep what happened; `around(world, update, argument)` may wrap both updates."""

    def flown(scenario: Scenario, *, around=None, navigator=make_navigator, pilot=make_pilot, **keywords) -> Watched:
        worlds, truth, estimate, std, controls = [], [], [], [], []
        make_world = scenarios.flight.make_world

        def making(*arguments, **more):
            worlds.append(make_world(*arguments, **more))
            return worlds[-1]

        call = around or (lambda world, update, argument: update(argument))

        def watched_navigator(*arguments):
            made = navigator(*arguments)
            update = made.update
            made.update = lambda measurements: call(worlds[-1], update, measurements)
            return made

        def watched_pilot(*arguments):
            made = pilot(*arguments)
            update = made.update

            def turn(state):
                now = worlds[-1].truth
                truth.append((now.t, *now.position, *now.velocity))
                estimate.append((state.t, *state.position, state.pad_age))
                std.append(tuple(state.std_position))
                sent = call(worlds[-1], update, state)
                controls.append(tuple(sent))
                return sent

            made.update = turn
            return made

        keywords.setdefault("cameras", False)
        with monkeypatch.context() as patch:
            patch.setattr(scenarios.flight, "make_world", making)
            flight = fly(scenario, navigator=watched_navigator, pilot=watched_pilot, **keywords)
        return Watched(flight, *map(np.array, (truth, estimate, std, controls)), worlds[-1])

    return flown

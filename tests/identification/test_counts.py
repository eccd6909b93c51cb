"""Events have the exact likelihood of their counts."""

import tomllib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import beta, binom

from flightlog.tables import Table, table
from identification.counts import count, told
from identification.extension import Delta
from identification.extension import extended as write_down
from sim import vehicle
from sim.sensors.barometer import Barometer
from sim.sensors.contract import Truth
from sim.vehicle import Vehicle
from sim.world import MAGNETIC_FIELD

RAPTOR = vehicle.load("raptor90")
TIME = np.arange(0.0, 40.0, 0.04)
HEIGHT = 8.0 + 2.0 * np.sin(0.3 * TIME)


def flight(share: float, jumps: tuple[float, ...] = (), seed: int = 0) -> tuple[dict[str, dict[str, Table]], list[Any]]:
    """A hover out of the ranger's reach, as tables and as a prepared flight."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, 0.05)
    heard = rng.random(len(t)) < share
    sonar = np.column_stack([t, np.where(heard, rng.uniform(0.2, 3.0, len(t)), np.nan), heard])
    seen = np.interp(t, TIME, HEIGHT) + 0.1 * rng.standard_normal(len(t))
    for n, size in enumerate(jumps):
        seen[150 + 120 * n : 152 + 120 * n] += size
    baro = np.column_stack([t, seen])
    tables = {
        "sonar": table("measured", "sonar", sonar.tolist(), ["t", "range", "valid"]),
        "baro": table("measured", "baro", baro.tolist(), ["t", "altitude"]),
    }
    position = np.column_stack([0.0 * TIME, 0.0 * TIME, HEIGHT])
    return {"a": tables}, [SimpleNamespace(motion=SimpleNamespace(t=TIME, position=position))]


def evidence(share: float, jumps: tuple[float, ...] = (), seed: int = 0) -> dict[str, Any]:
    logs, flights = flight(share, jumps, seed)
    return {found.name: found for found in count(logs, flights, RAPTOR)}


@pytest.mark.parametrize("seed", range(20))
def test_declared_echoes_and_noise_are_no_cause(seed: int) -> None:
    found = evidence(0.05, seed=seed)
    assert found["sonar_false_echo"].log_bayes_factor < 2.0
    assert found["baro_glitch"].log_bayes_factor == 0.0


def test_many_echoes_are_counted() -> None:
    found = evidence(0.4)["sonar_false_echo"]
    assert found.log_bayes_factor > 10.0
    low, high = found.parameters["share"].ci95
    assert low < 0.4 < high


def test_echoes_by_quadrature() -> None:
    logs, flights = flight(0.3)
    found = count(logs, flights, RAPTOR)[0]
    t, valid = np.asarray(logs["a"]["sonar"]["t"]), np.asarray(logs["a"]["sonar"]["valid"]) > 0
    n, k = len(t), int(valid.sum())  # all of it is out of reach
    a = 0.05 * (0.05 * 0.95 / 0.03**2 - 1.0)
    b = a * 0.95 / 0.05
    usual, _ = quad(lambda p: binom.pmf(k, n, p) * beta.pdf(p, a, b), 0.0, 1.0, points=[k / n], limit=200)
    assert found.log_bayes_factor == pytest.approx(np.log(1.0 / (n + 1)) - np.log(usual), abs=1e-3)


def test_jumps_are_counted() -> None:
    found = evidence(0.05, (6.0, -9.0, 12.0))["baro_glitch"]
    assert found.log_bayes_factor > 10.0
    assert found.parameters["count"].value == 3
    assert found.parameters["size"].value == pytest.approx(12.0, abs=1.5)
    assert found.parameters["first"].value == pytest.approx(150 * 0.05, abs=0.1)


def extended(*names: str, share: float = 0.4, jumps: tuple[float, ...] = ()) -> Vehicle:
    """The file with what was counted on one flight written into it."""
    found = evidence(share, jumps)
    causes = [found[name].asserted() for name in names]
    events = told(causes, 1)
    delta = Delta(
        values={key: value for key, (value, *_) in events.items()},
        causes={key: cause for key, (_, cause, _, _) in events.items()},
        units={key: unit for key, (*_, unit, _) in events.items()},
        covariance=np.diag([std**2 for *_, std in events.values()]), visited={},
    )  # fmt: skip
    return vehicle.from_document(tomllib.loads(write_down(RAPTOR, delta, {})), RAPTOR.path)


def test_what_was_counted_is_foretold_on_what_was_held_out() -> None:
    gain = evidence(0.4)["sonar_false_echo"].gain
    assert gain is not None
    assert gain.rmse_reduction == pytest.approx(1.0 - np.sqrt(0.24 / (0.24 + 0.35**2)), abs=0.04)
    assert gain.share_of_explainable > 0.95
    usual = evidence(0.05)["sonar_false_echo"].gain
    assert usual is None or abs(usual.rmse_reduction) < 0.03


def test_a_file_that_tells_of_the_events_needs_no_cause() -> None:
    jumps = (6.0, -9.0, 12.0)
    known = extended("sonar_false_echo", "baro_glitch", jumps=jumps)
    assert known.sensors["sonar"].numbers["false_echo_share"] == pytest.approx(0.4, abs=0.05)
    assert known.sensors["baro"].numbers["glitch_count"] == 3.0
    logs, flights = flight(0.4, jumps, seed=3)
    for found in count(logs, flights, known):
        assert found.log_bayes_factor < 1.0, found.name
    logs, flights = flight(0.4, tuple(4.0 * jump for jump in jumps), seed=3)
    assert {f.name: f.log_bayes_factor for f in count(logs, flights, known)}["baro_glitch"] > 10.0


def test_the_simulated_barometer_jumps_as_the_file_tells() -> None:
    numbers = dict(RAPTOR.sensors["baro"].numbers)
    numbers |= {"glitch_count": 2.0, "glitch_size": 12.0, "glitch_first": 3.0, "glitch_every": 2.0}
    site = RAPTOR.site(101325.0, 288.15, MAGNETIC_FIELD)
    odd, sound = (
        Barometer(n, np.zeros(3), site, np.random.default_rng(0)) for n in (numbers, RAPTOR.sensors["baro"].numbers)
    )
    truth = Truth(
        0.0, np.array([0.0, 0.0, 5.0]), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.eye(3), np.zeros(3),
        np.zeros(3),
        np.array([0.0, 0.0, 9.8]), 157.0, 49.0, 3.5, np.zeros(3), 101265.0, 288.1,
    )  # fmt: skip
    at = []
    for i in range(500):
        truth.t = 0.02 * i
        apart = odd.sample(truth).altitude - sound.sample(truth).altitude
        if abs(apart) > 1e-6:
            assert apart == pytest.approx(12.0, rel=0.01)
            at.append(truth.t)
    assert at == pytest.approx([*np.arange(3.0, 3.099, 0.02), *np.arange(5.0, 5.099, 0.02)], abs=1e-6)

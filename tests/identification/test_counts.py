"""Events have the exact likelihood of their counts."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import beta, binom

from flightlog.tables import Table, table
from identification.counts import count
from sim import vehicle

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

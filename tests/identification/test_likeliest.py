"""Which of two sensors is wrong, where what each of them does is far from linear."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
import pytest

from identification import diagnosis
from identification.bench import Baseline, Bench
from identification.causes.contract import Cause, Parameter
from identification.search import Search
from identification.stack import Rows
from sim import vehicle

MARK, CLOCK = "cameras.mark", "sensors.clock"
CAUSES = [Cause(key, "sensor", (Parameter("late", "s", key, 1.0),), "late") for key in (MARK, CLOCK)]
SIZE = 300


class Curved:
    """What a late mark does is drawn; at first, and linearly, a clock explains it better."""

    def __init__(self, prepared_at: Mapping[str, float]) -> None:
        self.vehicle = vehicle.load("raptor90")
        self.names, self.causes, self.prepared_at = ["flight"], CAUSES, dict(prepared_at)
        self.not_testable: Mapping[str, Sequence[str]] = {}
        self.channels: Mapping[int, object] = {}
        self.nominal, self.tolerances = dict.fromkeys((MARK, CLOCK), 0.0), dict.fromkeys((MARK, CLOCK), 0.01)
        self.spreads, self.units = dict.fromkeys((MARK, CLOCK), 10.0), dict.fromkeys((MARK, CLOCK), "s")
        self.baseline = Baseline(True, None)
        rng = np.random.default_rng(4)
        noise, self.clock, aside = rng.standard_normal((3, SIZE))
        self.mark = self.clock + 0.5 * aside
        done = 2.0 * self.clock + 0.2 * aside  # by a mark that is late by 2, far from linear
        self.left = noise + (0.0 if MARK in self.prepared_at else done)

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        columns = {MARK: self.mark, CLOCK: self.clock}
        left = self.left - sum(columns[key] * size for key, size in changes.items())
        return Rows(left, columns, np.zeros((SIZE, 1)), np.ones(1), np.zeros(SIZE, int), np.arange(SIZE, dtype=float))

    def bounded(self, key: str, value: float) -> float:
        return value if key in self.nominal else float("nan")

    def anew(self, causes: Sequence[Cause], at: Mapping[str, float], std: Mapping[str, float]) -> "Curved":
        assert set(std) >= {p.key for cause in causes for p in cause.parameters}
        return Curved({p.key: at[p.key] for cause in causes for p in cause.parameters})


def prepared(monkeypatch: pytest.MonkeyPatch, rivals: int) -> Bench | None:
    monkeypatch.setattr(diagnosis, "RIVALS", rivals)
    monkeypatch.setattr(diagnosis, "FAR", 100.0)
    search = Search(Curved({}))
    for cause in CAUSES:
        search.fit((cause.name,))
    assert search.gain((CLOCK,)) > search.gain((MARK,)) + diagnosis.ALIKE > 100.0  # the wrong one
    return diagnosis._likeliest(search, (CLOCK,))


def test_flights_are_prepared_about_the_sensor_that_then_explains_more(monkeypatch: pytest.MonkeyPatch) -> None:
    found = prepared(monkeypatch, 2)
    assert isinstance(found, Curved) and list(found.prepared_at) == [MARK]
    astray = prepared(monkeypatch, 0)
    assert isinstance(astray, Curved) and list(astray.prepared_at) == [CLOCK]

"""Blind sets, one for every kind of verdict: drawn, flown, sealed, diagnosed from what was measured, then opened.

The many-set figures come from `python -m benchmarks.blind`; here stands what must hold on a handful of short flights.
A case that does not hold yet says so in its place.
"""

from dataclasses import dataclass
from functools import cache

import pytest

from benchmarks.blind_judge import Job, Record, run

SHORT = {"flights": 1, "duration_s": 20.0}

JOBS = {
    "null": Job("test", 101, "null", plans=("doublets",), **SHORT),
    "weak": Job("test", 102, "weak", ("actuator_deadband",), plans=("turn",), **SHORT),
    "plant": Job("test", 110, "single", ("drag",), plans=("box",), **SHORT),
    "sensor": Job("test", 103, "single", ("baro_drift",), plans=("doublets",), **SHORT),
    "timing": Job("test", 105, "single", ("gps_latency",), plans=("box",), **SHORT),
    "class": Job("test", 106, "single", ("sonar_scale",), plans=("ladder",), **SHORT),
    "pair": Job("test", 107, "pair", ("baro_drift", "drag"), plans=("box",), **SHORT),
    "unknown": Job("test", 108, "unknown", ("speed_lift",), plans=("box",), **SHORT),
}


@dataclass(frozen=True)
class Found:
    """What a verdict says, seen against the answer."""

    record: Record

    @property
    def named(self) -> set[str]:
        return {cause["name"] for cause in self.record.asserted}

    @property
    def held(self) -> set[str]:
        """Names and what is declared confusable with them."""
        return self.named | {name for cause in self.record.asserted for name in cause["confusable_with"]}

    @property
    def true(self) -> set[str]:
        return {effect["name"] for effect in self.record.truth}


@cache
def found(kind: str) -> Found:
    return Found(run(JOBS[kind]))


@pytest.mark.parametrize("kind", JOBS)
def test_a_verdict_is_certified_and_its_answer_was_sealed_before(kind):
    record = found(kind).record
    assert record.certified
    assert len(record.seal) == 64
    assert {effect["name"] for effect in record.truth} == set(JOBS[kind].names or ())


def short_of(reason: str):
    """What the gate table in docs/diagnosis.md counts, and a single short flight does not yet show."""
    return pytest.mark.xfail(reason=reason, strict=True)


@pytest.mark.parametrize("kind", ["plant", "sensor", "pair"])
def test_what_is_wrong_is_seen_and_named(kind):
    seen = found(kind)
    assert seen.record.best > 10.0
    assert seen.true <= seen.held


@pytest.mark.parametrize("kind", [
    "timing",
    "class",
])  # fmt: skip
def test_what_is_wrong_is_seen_and_named_or_its_class(kind):
    seen = found(kind)
    assert seen.true <= seen.held


@pytest.mark.parametrize("kind", ["null", "weak"])
@short_of("false alarms on flights as short as these")
def test_nothing_is_named_where_nothing_can_be_seen(kind):
    assert found(kind).named == set()


@short_of("what no cause explains is not sought yet")
def test_what_stands_in_no_catalogue_is_flagged_and_not_named():
    seen = found("unknown").record
    assert seen.unexplained
    assert any(item["channel"] == seen.shows[0] for item in seen.unexplained)

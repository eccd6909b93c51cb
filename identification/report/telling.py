"""Which of all means show best what a cause changes, or that nothing does.

A cause is shown in the channel in which most was gained by it on held-out rows; as the force, moment or acceleration
that the model lacks, where it is one, else as innovations. The driver is the one that tells best how what the cause
changes goes up and down along the flights, of those over which its means depart.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from identification.diagnosis import Diagnosis
from identification.report.bands import courses
from identification.report.drivers import RATES, STICKS
from identification.report.findings import Findings
from identification.report.means import Course
from identification.report.unforeseen import at_rest, curves, lacking
from identification.verdict import Asserted

SHOWS = 0.2  # of the nats that the best driver takes, which another must take to be shown
NEAR = 0.03  # of the variance, within which the driver that is named first is shown
# by which these must tell more: whatever changes once along a flight goes with time, and a pilot answers what is wrong
LESS = {"time": 0.2, **dict.fromkeys((*RATES, *STICKS, *(f"{name}_rate" for name in STICKS)), 0.15)}
CALM = (("force_z", "height"), ("force_x", "forward_speed"), ("force_y", "left_speed"))  # where nothing is wrong
SHOWN = 3


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture's worth: one channel over one driver."""

    course: Course
    cause: str | None  # what is at rest before and at work after; None: nothing was found
    others: Sequence[Course] = ()  # the same channel over every driver


@lru_cache(maxsize=1)
def telling(findings: Findings) -> tuple[Shown, ...]:
    """One for each cause that has a channel, in the verdict's order; where nothing is wrong what is looked at first."""
    diagnosis, gain = findings.diagnosis, findings.gain
    if diagnosis is None or gain is None:
        return ()
    if not findings.verdict.causes:
        return () if findings.verdict.unexplained else tuple(calm(findings))
    found = []
    for cause in findings.verdict.causes:
        name = name_of(cause, diagnosis)
        most = gain.best()
        if name is None or most is None:
            continue
        rest = tuple(n for n in diagnosis.causes if n != name)
        bench, search, channel = diagnosis.bench, diagnosis.search, (cause.gain or most).channel
        own = {p.key for p in search.causes[name].parameters}
        ways = (
            curves(bench, at_rest(bench, search.fit(rest), own), search.fit(diagnosis.causes), [channel]),
            courses(gain, [channel]),
        )
        chosen = [(best, way) for way in ways if (best := choose(way)) is not None]
        if chosen:
            best, way = next((pair for pair in chosen if pair[0].departs), chosen[0])
            found.append(Shown(best, cause.name, way))
    return tuple(found[:SHOWN])


def name_of(cause: Asserted, diagnosis: Diagnosis) -> str | None:
    """The search's name of a cause as it is told; None for one that is no part of the search."""
    for name in diagnosis.causes:
        known = diagnosis.search.causes[name]
        fixed = {key: p.value for key, p in cause.parameters.items() if key in known.fixed}
        alike = known.title == cause.name and known.topic == cause.topic
        if name == cause.name or (alike and fixed == {key: float(value) for key, value in known.fixed.items()}):
            return name
    return None


def choose(found: Sequence[Course]) -> Course | None:
    """Of one channel's drivers the one that tells best; None where the means come no nearer to nothing."""
    most = max((c.taken for c in found), default=0.0)
    if most <= 0.0:
        return None
    seen = sorted((c for c in found if c.taken >= SHOWS * most), key=lambda c: c.driver == "time")
    seen = [c for c in seen if c.departs] or seen
    worth = [c.told - LESS.get(c.driver, 0.0) for c in seen]
    return next(c for c, w in zip(seen, worth, strict=True) if w >= max(worth) - NEAR)


def calm(findings: Findings) -> list[Shown]:
    """Of a sound model: the forces over what they depend on first, else each channel over its first driver."""
    assert findings.diagnosis is not None
    assert findings.gain is not None
    null = findings.diagnosis.search.null
    found = curves(findings.diagnosis.bench, null, null, lacking(findings.diagnosis.bench))
    if not found:
        found = courses(findings.gain, [c.channel for c in findings.gain.channels])
    first = {c.channel: c for c in reversed(found)}
    chosen = [c for place in CALM for c in found if (c.channel, c.driver) == place] or list(reversed(first.values()))
    return [Shown(c, None, [other for other in found if other.channel == c.channel]) for c in chosen[:SHOWN]]

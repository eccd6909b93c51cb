"""From logs without a vehicle to the verdict: heights, one cause a sensor."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flightlog.tables import Table
from identification.causes.contract import Where
from identification.null import CLASS_MARGIN
from identification.parity import alignment, drift, events
from identification.parity.series import Heights, Series, collect
from identification.verdict import (
    Asserted,
    BaselineReport,
    Candidate,
    CauseGain,
    ChannelError,
    Fitted,
    LostBecause,
    NotTestable,
    Number,
    Verdict,
)  # fmt: skip

Floats = NDArray[np.float64]

THRESHOLD = 8.0  # [nats] above which a cause is asserted; no healthy log of the tests comes near
STRAYS = 3.0  # usual slow errors that a sensor must have walked
PRIOR = 0.01  # that any one of these is at work
SPLIT = {
    ("baro_drift", "gps_drift"): "a second height (ranger, mark, a second barometer or the receiver's own climb rate), "
    "or standing still on the same ground before and after",
}


@dataclass(frozen=True, eq=False)
class Finding:
    """One cause on one flight."""

    name: str
    where: Where
    log_bayes_factor: float
    channel: str
    parameters: Mapping[str, Fitted]
    said: str  # what was seen, in words
    corrected: Callable[[Heights], Heights] | None = None  # with the cause taken out
    beyond: bool = True  # further than such a sensor strays on any day
    witnesses: int = 3  # that measure the same: of two that differ none can be told to be wrong


def judge(logs: Mapping[str, Mapping[str, Table]]) -> Verdict:
    """What redundant sensors say of each other.

    logs: measured tables by flight and topic. Nothing is asserted of a flight on which fewer than two sensors measure
    one thing; where that is so of all, the baseline is not certified.
    """
    notes: list[str] = []
    every: dict[str, dict[str, Finding]] = {}
    channels: list[ChannelError] = []
    noise: dict[str, Number] = {}
    seen: set[str] = set()
    comparable = False
    for name, tables in logs.items():
        heights = collect(tables)
        alignment.check(name, heights)
        notes += [f"{name}: {note}" for note in heights.notes]
        seen |= _measured(heights)
        if len(heights.levels) + (heights.sonar is not None) < 2:
            notes.append(f"{name}: {_only(heights)}; nothing measures the same beside it")
            continue
        comparable = True
        findings, doubts = _examine(heights)
        every[name] = {f.name: f for f in findings}
        notes += [f"{name}: {doubt}" for doubt in doubts]
        found = _asserted(every[name])
        notes += [f"{name}: {f.said}" for f in found]
        channels += _channels(name if len(logs) > 1 else "", heights, found)
        noise |= {k: Number(v, "m") for k, v in _noise(heights).items() if k not in noise}
    causes, candidates = _answer(every)
    notes += _undecided(every, causes)
    return Verdict(
        vehicle=None,
        logs=list(logs),
        baseline=BaselineReport(
            comparable, None if comparable else "without a vehicle, two sensors that measure one thing are needed: two "
            "of barometer, GPS, sonar, reference", noise, {},
        ),
        channels=channels,
        causes=causes,
        candidates=candidates,
        unexplained=[],
        not_testable=_not_testable(seen),
        notes=notes,
    )  # fmt: skip


def _examine(heights: Heights) -> tuple[list[Finding], list[str]]:
    """Every cause on one flight, and what is not judged. Jumps are counted first and left out of what walks slowly."""
    found: list[Finding] = []
    late, clean = alignment.offset(heights)
    if late is not None:
        found.append(_late(late, clean))
        heights = clean
    for topic, series in heights.baro.items():
        others = [s for s in heights.levels.values() if not s.name.startswith("baro")]
        others = others or [s for name, s in heights.baro.items() if name != topic]
        jumps = events.glitches(series, others)
        found.append(_glitch(topic, jumps))
        clean = replace(clean, baro={**clean.baro, topic: series.without(jumps.rows)})
    if heights.sonar is not None:
        found.append(_echoes(events.false_echoes(clean)))
    apart = alignment.strangers(clean)
    if apart is None:
        found += _drifts(clean)
    best: dict[str, Finding] = {}
    for finding in found:  # the worst of several devices
        if finding.name not in best or finding.log_bayes_factor > best[finding.name].log_bayes_factor:
            best[finding.name] = finding
    doubts = [] if apart is None else [
        f"{apart[0]} and {apart[1]} do not move together: swapped, of another flight, or one of them broken; "
        "which walks away is not judged"
    ]  # fmt: skip
    return list(best.values()), doubts


def _late(late: alignment.Late, after: Heights) -> Finding:
    either = " or ".join((late.topic, *late.others))
    said = f"the clock of {either} is off by {late.delay:+.1f} s for {late.topic}; judged with it set right"
    return Finding("clock_offset", "timing", late.log_bayes_factor, f"{late.topic}.t",
                   {"delay": _known(late.delay, late.std, "s")}, said, lambda _: after)  # fmt: skip


def _glitch(topic: str, jumps: events.Found) -> Finding:
    spread = float(np.sqrt(max(jumps.count, 1)))
    most = jumps.count + 1.96 * spread
    parameters = {
        "count": Fitted(jumps.count, 0.0, spread, (max(0.0, 2.0 * jumps.count - most), most), "1"),
        "size": _known(jumps.size, events.EVERYDAY, "m"),
        "first": _known(jumps.first, 0.1, "s"),
    }  # fmt: skip
    said = (f"{topic}.altitude jumps {jumps.count} time(s), by as much as {jumps.size:.0f} m, first at t = "
            f"{jumps.first:.1f} s, and no other height does")  # fmt: skip

    def corrected(heights: Heights) -> Heights:
        return replace(heights, baro={**heights.baro, topic: heights.baro[topic].without(jumps.rows)})

    return Finding("baro_glitch", "sensor", jumps.log_bayes_factor, f"{topic}.altitude", parameters, said, corrected)


def _echoes(echoes: events.Found) -> Finding:
    could = max(echoes.count / echoes.share, 1.0) if echoes.share else 1.0
    std = float(np.sqrt(max(echoes.share * (1.0 - echoes.share), 1.0 / could) / could))
    ends = max(0.0, echoes.share - 1.96 * std), min(1.0, echoes.share + 1.96 * std)
    said = (f"sonar.range claims the ground up to {abs(echoes.size):.0f} m nearer than the other heights have it, in "
            f"{echoes.count} rows from t = {echoes.first:.1f} s on, and leaps about")  # fmt: skip
    return Finding("sonar_false_echo", "sensor", echoes.log_bayes_factor, "sonar.range",
                   {"share": Fitted(echoes.share, 0.0, std, ends, "1")}, said,
                   lambda heights: replace(heights, sonar=None if heights.sonar is None else
                                           heights.sonar.without(echoes.rows)))  # fmt: skip


def _drifts(heights: Heights) -> list[Finding]:
    """Which of the heights walks away."""
    problem = drift.pose(heights)
    if problem is None or len(problem.names) < 2:
        return []
    problem = drift.plain(problem)
    usual = drift.evidence(problem)
    found = []
    for name, sensors in drift.hypotheses(problem).items():
        scores = {(s, rate): drift.evidence(problem, {s: rate}) - usual for s in sensors for rate in drift.RATES}
        best = max(scores, key=lambda key: scores[key])
        score = float(np.logaddexp.reduce(list(scores.values())) - np.log(len(scores)))
        found.append(_drift(name, best, score, problem) if score > 0.0 else Finding(name, "sensor", score, "", {}, ""))
    return found


def _drift(name: str, best: tuple[str, float], score: float, problem: drift.Problem) -> Finding:
    sensor, rate = best
    walked = drift.walk(problem, sensor, {sensor: rate})
    moved = float(walked.error[-1] - walked.error[0])
    over = float(walked.t[-1] - walked.t[0])
    std = float(walked.std[-1])
    channel = f"{sensor}.{'u' if sensor.startswith('gps') else 'altitude'}"
    parameters = {
        "u" if sensor.startswith("gps") else "rate": _known(moved / over, std / over, "m/s"),
    }
    said = f"{channel} walks by {moved:+.1f} +- {std:.1f} m in {over:.0f} s against the other sensors"

    usual = np.hypot(problem.sizes[problem.slow[sensor]], problem.sizes[problem.slow.get("baro", 0)]
                     if sensor.startswith("baro_") else 0.0)  # fmt: skip
    beyond = bool(np.ptp(walked.error) > STRAYS * usual and abs(moved) > 2.0 * std)

    def corrected(heights: Heights) -> Heights:
        def right(series: Series) -> Series:
            return Series(series.name, series.t, series.value - np.interp(series.t, walked.t, walked.error))

        return replace(
            heights,
            gps={k: right(s) if k == sensor else s for k, s in heights.gps.items()},
            baro={k: right(s) if sensor in (k, "baro") else s for k, s in heights.baro.items()},
        )

    return Finding(name, "sensor", score, channel, parameters, said, corrected, beyond,
                   drift.witnesses(problem))  # fmt: skip


def _known(value: float, std: float, unit: str, nominal: float = 0.0) -> Fitted:
    return Fitted(value, nominal, std, (value - 1.96 * std, value + 1.96 * std), unit)


def _rivals(name: str, found: Mapping[str, Finding]) -> list[str]:
    """Causes that explain the same rows instead."""
    return [other for pair in SPLIT for other in pair if name in pair and other != name and other in found]


def _asserted(found: Mapping[str, Finding]) -> list[Finding]:
    """What stands above the threshold, and above what explains the same."""
    return [
        f for f in found.values()
        if f.log_bayes_factor > THRESHOLD
        and f.beyond
        and all(f.log_bayes_factor >= found[r].log_bayes_factor for r in _rivals(f.name, found))
    ]  # fmt: skip


def _answer(every: Mapping[str, Mapping[str, Finding]]) -> tuple[list[Asserted], list[Candidate]]:
    """Over all flights: a cause may be at work on one of them alone."""
    best: dict[str, Finding] = {}
    for found in every.values():
        for f in found.values():
            if f.name not in best or f.log_bayes_factor > best[f.name].log_bayes_factor:
                best[f.name] = f
    flights = np.log(max(len(every), 1))  # so many places to look at
    best = {name: replace(f, log_bayes_factor=f.log_bayes_factor - flights) for name, f in best.items()}
    causes = []
    for f in _asserted(best):
        near = [r for r in _rivals(f.name, best)
                if best[r].log_bayes_factor > f.log_bayes_factor - CLASS_MARGIN or f.witnesses < 3]  # fmt: skip
        split = next((text for pair, text in SPLIT.items() if f.name in pair and any(n in pair for n in near)), None)
        of_class = sum(_probability(n, best) for n in (f.name, *near))
        causes.append(Asserted(f.name, f.where, min(1.0, of_class), f.parameters, _gain(f, every), near, split))
    causes.sort(key=lambda cause: -cause.probability)
    candidates = []
    for f in sorted(best.values(), key=lambda f: -f.log_bayes_factor):
        winner = next((r for r in _rivals(f.name, best) if best[r].log_bayes_factor > f.log_bayes_factor), None)
        lost = None if winner is None or best[winner].log_bayes_factor < THRESHOLD else LostBecause(
            best[winner].channel, "the whole flight")  # fmt: skip
        candidates.append(Candidate(f.name, round(f.log_bayes_factor, 3), _probability(f.name, best), lost))
    return causes, candidates


def _probability(name: str, best: Mapping[str, Finding]) -> float:
    logs = np.array([best[n].log_bayes_factor + np.log(PRIOR) for n in (name, *_rivals(name, best))])
    return float(np.exp(logs[0] - np.logaddexp.reduce([*logs, np.log1p(-PRIOR)])))


def _gain(finding: Finding, every: Mapping[str, Mapping[str, Finding]]) -> CauseGain | None:
    return None


def _apart(heights: Heights) -> dict[str, Floats]:
    """By channel, how far each height is from the first of the others, each less its median."""
    levels = list(heights.levels.values())
    found: dict[str, Floats] = {}
    for series in (*levels, *([heights.sonar] if heights.sonar is not None else [])):
        other = next((s for s in levels if _kind(s) != _kind(series)), None)
        if other is None:
            continue
        rest = series.value - other.at(series.t)
        rest = rest[np.isfinite(rest)]
        if len(rest):
            found[series.name] = rest - np.median(rest)
    return found


def _kind(series: Series) -> str:
    return series.name.partition(".")[0].partition("_")[0]


def _channels(prefix: str, heights: Heights, found: Sequence[Finding]) -> list[ChannelError]:
    """Differences of redundant heights before and after what was found is taken out."""
    after = heights
    for f in found:
        after = after if f.corrected is None else f.corrected(after)
    one, two, noise = _apart(heights), _apart(after), _noise(heights)
    return [
        ChannelError(f"{prefix}:{name}" if prefix else name, "m", float(np.sqrt(np.mean(rest**2))),
                     float(np.sqrt(np.mean(two[name] ** 2))) if name in two else 0.0, noise.get(name, 0.0), False)
        for name, rest in one.items()
    ]  # fmt: skip


def _noise(heights: Heights) -> dict[str, float]:
    """White noise of every height, from how it bends between rows."""
    found = {}
    for series in (*heights.levels.values(), *([heights.sonar] if heights.sonar is not None else [])):
        bends = series.value[2:] - 2.0 * series.value[1:-1] + series.value[:-2]
        if len(bends):
            found[series.name] = 1.48 * float(np.median(np.abs(bends))) / np.sqrt(6.0)
    return found


def _undecided(every: Mapping[str, Mapping[str, Finding]], causes: Sequence[Asserted]) -> list[str]:
    """What can be said of a pair that disagrees where neither is named."""
    said = []
    for cause in causes:
        if cause.confusable_with:
            names = " and ".join((cause.name, *cause.confusable_with))
            said.append(f"{names} cannot be told apart here: either explains the difference; needed: {cause.split_by}")
    return said


def _measured(heights: Heights) -> set[str]:
    return {t.split("_")[0] for t in heights.levels} | ({"sonar"} if heights.sonar is not None else set())


def _only(heights: Heights) -> str:
    one = sorted(_measured(heights))
    return f"of heights only {one[0]}" if one else "no height in it"


def _not_testable(seen: set[str]) -> list[NotTestable]:
    """Of the catalogue what needs a vehicle, or a topic that is not there."""
    from identification.causes import CATALOGUE

    mine: Mapping[str, tuple[str, ...]] = {
        "baro_glitch": ("baro",),
        "sonar_false_echo": ("sonar",),
        "baro_drift": ("baro",),
        "gps_drift": ("gps",),
        "clock_offset": (),
    }
    found = []
    for name, needs in mine.items():
        lacking = [topic for topic in needs if topic not in seen]
        if len(seen) < 2 and not lacking:
            lacking = ["a second height"]
        if lacking:
            found.append(NotTestable(name, lacking))
    found += [NotTestable(name, ["a vehicle file"]) for name in CATALOGUE if name not in mine]
    return sorted(found, key=lambda item: item.name)

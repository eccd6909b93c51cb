"""Whether a flight's topics run by one clock, and the longest stretch of it without a gap."""

from collections.abc import Mapping, Sequence

import numpy as np

from flightlog.errors import UserError
from flightlog.tables import Table
from identification.intake.rows import between

Tables = Mapping[str, Table]

SHARE = 0.5  # of the shorter of two spans that both must have in common
FACTORS = {1e3: "ms", 1e6: "us", 1e9: "ns"}
WITHIN = 0.2  # of a factor
FEWEST = 10  # rows of a topic that is looked at
GAPS = {"imu": 0.3, "controls": 0.5, "actuators": 0.5, "rotor": 1.0, "joints": 0.5}  # [s]
LATE = 0.3  # [s] by which one may begin or end before another
STEPS = 6.0  # usual steps that make a gap in any case
ROSE = 1.0  # [m]
BEFORE = 10.0  # [s] before it rose


def together(name: str, tables: Tables, needed: Sequence[str], notes: list[str]) -> dict[str, Table]:
    """Topics of the clock that most rows run by; UserError where a needed one, or a unit of time, is another."""
    spans = {topic: (float(table["t"][0]), float(table["t"][-1])) for topic, table in tables.items()}
    main = max(tables, key=lambda topic: (topic in needed, len(tables[topic])))
    first, last = spans[main]
    kept = dict(tables)
    for topic, (begin, end) in spans.items():
        if topic == main or len(tables[topic]) < FEWEST:
            continue
        said = f"{topic} runs from {begin:.7g} to {end:.7g} s, {main} from {first:.7g} to {last:.7g} s"
        for factor, unit in FACTORS.items():
            for wrong, ratio in ((topic, (end - begin) / (last - first)), (main, (last - first) / (end - begin))):
                if abs(ratio / factor - 1.0) < WITHIN:
                    raise UserError(f"{name}: {said}; one clock in s would be right: {wrong} is likely in {unit}")
        if min(end, last) - max(begin, first) < SHARE * min(end - begin, last - first):
            if topic in needed:
                raise UserError(f"{name}: {said}; one clock would be right")
            notes.append(f"{name}: {said}: another clock; {topic} left out")
            del kept[topic]
    return kept


def unbroken(name: str, tables: Tables, needed: Sequence[str], notes: list[str]) -> dict[str, Table]:
    """The longest stretch without a gap in what is needed."""
    breaks: list[tuple[float, float, str]] = []
    ends = []
    for topic in needed:
        if topic not in tables or len(tables[topic]) < 2:
            continue
        t = np.asarray(tables[topic]["t"], float)
        steps = np.diff(t)
        wide = np.flatnonzero(steps > max(GAPS.get(topic, 1.0), STEPS * float(np.median(steps))))
        breaks += [(float(t[i]), float(t[i + 1]), topic) for i in wide]
        ends.append((float(t[0]), float(t[-1])))
    if not ends:
        return dict(tables)
    begin, end = max(a for a, _ in ends), min(b for _, b in ends)
    late = max(begin - min(a for a, _ in ends), max(b for _, b in ends) - end)
    if not breaks and late <= LATE:
        return dict(tables)
    pieces, at = [], begin
    for a, b, _ in sorted(breaks):
        pieces.append((at, min(a, end)))
        at = max(at, b)
    pieces.append((at, end))
    first, last = max(pieces, key=lambda piece: piece[1] - piece[0])
    silent = ", ".join(dict.fromkeys(topic for _, _, topic in breaks)) or "one or the other"
    longest = max([late, *(b - a for a, b, _ in breaks)])
    notes.append(
        f"{name}: {', '.join(needed)}: {silent} silent for up to {longest:.1f} s; only t = {first:.1f} to "
        f"{last:.1f} s, the longest stretch with all of them, is used"
    )
    return _cut(tables, first, last)


def not_too_long(name: str, tables: Tables, longest: float, notes: list[str]) -> dict[str, Table]:
    """The first `longest` seconds from where it rose."""
    t = np.asarray(max(tables.values(), key=len)["t"], float)
    length = float(np.subtract(*np.quantile(t, [0.9, 0.1]))) / 0.8  # whatever a few broken stamps say
    if length <= longest:
        return dict(tables)
    first = float(t[0])
    heights = (("baro", "altitude"), ("gps", "u"))
    height = next(((tables[topic], c) for topic, c in heights if topic in tables and c in tables[topic]), None)
    if height is not None:
        values = np.asarray(height[0][height[1]], float)
        known = values[np.isfinite(values)]
        risen = np.flatnonzero(values > np.median(known[:50]) + ROSE) if len(known) else known
        if len(risen):
            first = max(first, float(height[0]["t"][int(risen[0])]) - BEFORE)
    last = first + longest
    notes.append(
        f"{name}: {length / 60.0:.0f} min long; t = {first:.1f} to {last:.1f} s are looked at, the rest is not judged"
    )
    return _cut(tables, first, last)


def _cut(tables: Tables, first: float, last: float) -> dict[str, Table]:
    cut = {topic: between(table, first, last) for topic, table in tables.items()}
    return {topic: table for topic, table in cut.items() if len(table)}

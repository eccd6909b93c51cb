"""What a diagnosis reads: logs of any kind as flights by name, and what must be said about them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from flightlog.errors import UserError
from flightlog.readers import Log, read_log
from flightlog.tables import Table

UNREAD = ("frames",)  # pictures: not read here
LEAST = 2.0  # [s] of a segment that is looked at
REPEATED = 0.01  # of a topic's times
MANY = 50  # rows from which on a topic knows of a reset


@dataclass(frozen=True, eq=False)
class Flights:
    """Logs, read: one flight a log, or one a segment where its clock was reset."""

    logs: Mapping[str, Log]  # by flight
    tables: Mapping[str, Mapping[str, Table]]  # by flight and topic
    notes: tuple[str, ...]

    @property
    def untimed(self) -> list[str]:
        """Topics of some flight whose times cannot be trusted to a sample."""
        return sorted({t for name, log in self.logs.items() for t in self.tables[name] if t not in log.timed})

    def __add__(self, others: "Flights") -> "Flights":
        """Both; UserError where a flight stands in both. Of two files of one name the second is told by its folder."""
        logs, tables = dict(self.logs), dict(self.tables)
        for name, log in others.logs.items():
            if name in self.logs and log.path.resolve() == self.logs[name].path.resolve():
                raise UserError(f"{log.path}: given twice")
            other = f"{log.path.resolve().parent.name}/{name}" if name in logs else name
            logs[other], tables[other] = log, others.tables[name]
        return Flights(logs, tables, tuple(dict.fromkeys((*self.notes, *others.notes))))


def read(paths: Sequence[Path], mapping: Path | None = None) -> Flights:
    """Read logs; UserError for the first that is unusable, or given twice.

    Args:
        paths: flight folders, folders of CSV files, CSV, ULog or DataFlash files.
        mapping: what the columns of the CSV files among them are.
    """
    logs: dict[str, Log] = {}
    tables: dict[str, Mapping[str, Table]] = {}
    notes: list[str] = []
    seen: dict[Path, Path] = {}
    for path in paths:
        if path.resolve() in seen:
            raise UserError(f"{path}: given twice")
        seen[path.resolve()] = path
        log = read_log(path, mapping)
        name = _name(path, logs)
        log, said = _by_one_clock(_doubted(log))
        notes += [f"{name}: {note}" for note in (*log.notes, *said)]
        parts = [i for i, (first, last) in enumerate(log.segments) if last - first >= LEAST]
        if not parts:
            raise UserError(f"{path}: {log.duration:.2f} s long; at least {LEAST:g} s would be right")
        if len(parts) < len(log.segments):
            notes.append(f"{name}: {len(log.segments) - len(parts)} segment(s) shorter than {LEAST:g} s left out")
        for part in parts:
            own = name if len(parts) == 1 else f"{name}#{part + 1}"
            logs[own], tables[own] = log, _measured(log, part)
    return Flights(logs, tables, tuple(dict.fromkeys(notes)))


def _doubted(log: Log) -> Log:
    """The log with topics whose times are repeated more than now and then not trusted to a sample."""
    steps = {topic: np.diff(table["t"]) for topic, table in log.tables.items()}
    repeated = {topic for topic, step in steps.items() if np.count_nonzero(step == 0.0) > REPEATED * len(step)}
    return replace(log, timed=log.timed - repeated) if repeated else log


def _by_one_clock(log: Log) -> tuple[Log, list[str]]:
    """The log without topics whose clock alone was reset, or alone was not: the rule is what most rows say."""
    rows = {topic: len(table) for topic, table in log.tables.items()}
    resets: dict[int, list[str]] = {}
    for topic, table in log.tables.items():
        resets.setdefault(len(table.segments) - 1, []).append(topic)
    if len(resets) == 1:
        return log, []
    usual = max(resets, key=lambda count: sum(rows[topic] for topic in resets[count]))
    # a topic of few rows may well have none after a reset
    others = [
        topic
        for count, topics in resets.items()
        for topic in topics
        if count > usual or (count < usual and rows[topic] > MANY)
    ]
    if not others:
        return log, []
    said = f"the clock of {', '.join(sorted(others))} was reset otherwise than that of the others; left out"
    return log.without(others), [said]


def _name(path: Path, taken: Mapping[str, Log]) -> str:
    """What a flight is called: its file's name, with the folder's where two are alike."""
    short = path.resolve().name or str(path)
    if short not in {name.partition("#")[0] for name in taken}:
        return short
    return str(path)


def _measured(log: Log, part: int) -> dict[str, Table]:
    """A segment's tables. What Helideck's own navigator made of the sensors is no measurement of its own."""
    left_out = (*UNREAD, "estimate") if log.kind == "flight" else UNREAD
    return {topic: table for topic, table in log.segment(part).items() if topic not in left_out}

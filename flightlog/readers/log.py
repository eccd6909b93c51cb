"""A log as every reader gives it, and how a reader puts one together."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.readers import health, plausibility
from flightlog.tables import Table, arrange
from flightlog.topics import topic_of

Kind = Literal["flight", "csv", "ulog", "dataflash"]
Columns = Mapping[str, NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Log:
    """A measured log: tables by topic, in SI units, ENU and body axes forward, left, up.

    notes: what was out of order, missing, doubtful or left out, a line each. segments: (first, last) time [s] between
    resets of the clock; one where it was never reset. timed: the topics whose times can be trusted to a sample;
    others were placed by the order of rows, so causes that show in timing cannot be tested with them.
    """

    path: Path
    kind: Kind
    tables: Mapping[str, Table]
    notes: tuple[str, ...]
    segments: tuple[tuple[float, float], ...]
    timed: frozenset[str]
    document: Mapping[str, Any] = field(default_factory=dict)  # flight.json of a flight folder; else `parameters`

    def segment(self, index: int) -> dict[str, Table]:
        """The tables of one segment; topics without rows in it are left out."""
        found = {}
        for name, table in self.tables.items():
            for part, owner in enumerate(_owners(_spans(table), self.segments)):
                if owner == index and name not in found:
                    found[name] = table.segment(part)
        return found

    def without(self, topics: Iterable[str]) -> "Log":
        """The log without some of its topics, and its segments without theirs."""
        left = {name: table for name, table in self.tables.items() if name not in set(topics)}
        if not left:
            raise UserError(f"{self.path}: no topic is left")
        return replace(
            self, tables=MappingProxyType(left), segments=_segments(left.values()), timed=self.timed & left.keys()
        )

    @property
    def duration(self) -> float:
        """Time covered [s], all segments together."""
        return sum(last - first for first, last in self.segments)


class Draft:
    """A log being read: takes columns topic by topic."""

    def __init__(self, path: Path, kind: Kind) -> None:
        """Nothing in it yet."""
        self.path = path
        self.kind: Kind = kind
        self.notes: list[str] = []
        self._tables: dict[str, Table] = {}
        self._timed: set[str] = set()

    def add(
        self, topic: str, columns: Columns, *, timed: bool = True, units: Mapping[str, str] | None = None
    ) -> None:
        """Take a topic's columns, `t` among them, each (N,) in SI units; columns without a number are left out.

        Args:
            topic: its name; where it is taken already the next free of `<topic>_2`, `_3`.
            columns: by name; what is not finite is missing.
            timed: whether t can be trusted to a sample.
            units: of columns that the topic does not know, or that this log has in another.
        """
        kept = {name: np.asarray(values) for name, values in columns.items() if name == "t" or _says(values)}
        if len(kept) < 2:
            return
        known = topic_of("measured", topic)
        fields, arrays = [], []
        for name, values in kept.items():
            column = None if known is None else known.column(name)
            unit = (units or {}).get(name, column.unit if column is not None else None)
            values = np.array(values, object if values.dtype.kind in "OUS" else values.dtype)
            arrays.append(pa.array(values, pa.string()) if values.dtype.kind == "O" else pa.array(values))
            fields.append(pa.field(name, arrays[-1].type, metadata={"unit": unit} if unit else None))
        self.take(topic, pa.Table.from_arrays(arrays, schema=pa.schema(fields)), timed=timed)

    def take(self, topic: str, arrow: pa.Table, *, timed: bool = True, file: str | None = None) -> None:
        """Take a topic's rows as an Arrow table; `file` as errors name it."""
        name = self._free(topic)
        table, notes = arrange(arrow, topic_of("measured", topic), name, file or str(self.path))
        self.notes += notes
        if not len(table):
            self.notes.append(f"{name}: no rows")
            return
        self._tables[name] = table
        if timed:
            self._timed.add(name)

    def note(self, text: str) -> None:
        """Remember what a user should know."""
        self.notes.append(text)

    def finish(self, document: Mapping[str, Any] | None = None) -> Log:
        """The log, after all of it was looked through; UserError where it is empty or a unit is plainly wrong."""
        return finish(self.path, self.kind, self._tables, self.notes, self._timed, document)

    def _free(self, topic: str) -> str:
        name, number = topic, 1
        while name in self._tables:
            number += 1
            name = f"{topic}_{number}"
        return name


def finish(
    path: Path,
    kind: Kind,
    tables: Mapping[str, Table],
    notes: Iterable[str],
    timed: Iterable[str],
    document: Mapping[str, Any] | None = None,
) -> Log:
    """A log from tables that are read; UserError where there are none or a unit is plainly wrong."""
    tables = {name: table for name, table in tables.items() if len(table)}
    if not tables:
        raise UserError(f"{path}: nothing measured in it")
    plausibility.check(path, tables)
    said = [*notes, *health.look(tables)]
    return Log(
        path=path,
        kind=kind,
        tables=MappingProxyType(tables),
        notes=tuple(dict.fromkeys(said)),
        segments=_segments(tables.values()),
        timed=frozenset(timed) & tables.keys(),
        document=MappingProxyType(dict(document or {})),
    )


def _says(values: Any) -> bool:
    """Whether there is anything in a column."""
    values = np.asarray(values)
    if values.dtype.kind == "f":
        return bool(np.isfinite(values).any())
    return len(values) > 0


def _spans(table: Table) -> list[tuple[float, float]]:
    """(first, last) time [s] of each segment of a table."""
    t = table["t"]
    return [(float(t[i]), float(t[j - 1])) for i, j in pairwise((*table.segments, len(t)))]


def _segments(tables: Iterable[Table]) -> tuple[tuple[float, float], ...]:
    """The log's segments: those of the topic with most of them, widened to what the others cover."""
    spans = [_spans(table) for table in tables]
    found = [list(span) for span in max(spans, key=len)]
    for others in spans:
        for span, owner in zip(others, _owners(others, [(a, b) for a, b in found]), strict=True):
            found[owner] = [min(found[owner][0], span[0]), max(found[owner][1], span[1])]
    return tuple((first, last) for first, last in found)


def _owners(spans: list[tuple[float, float]], segments: Iterable[tuple[float, float]]) -> list[int]:
    """To which of the log's segments each of a table's belongs: in order, else where they overlap most."""
    segments = list(segments)
    if len(spans) == len(segments):
        return list(range(len(spans)))
    owners: list[int] = []
    for first, last in spans:
        start = owners[-1] + 1 if owners else 0
        overlap = [min(last, b) - max(first, a) for a, b in segments[start:]]
        owners.append(min(start + int(np.argmax(overlap)), len(segments) - 1) if overlap else len(segments) - 1)
    return owners

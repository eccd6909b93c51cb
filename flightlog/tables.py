"""Tables as a log gives them: columns as numpy arrays by name, in order of time."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.topics import Topic, columns_of, topic_of

RESET = 1.0  # [s] a clock that falls back further, and stays back, was reset
DISORDER = 50  # rows by which one may be out of order
LOOK_AHEAD = 1000  # rows among which a clock that was not reset is ahead again


@dataclass(frozen=True, eq=False)
class Table:
    """One topic of a log: rows sorted by t within each segment (segments: spans between resets of the clock)."""

    name: str
    arrow: pa.Table
    topic: Topic | None  # None for a table that is none of the known topics
    segments: tuple[int, ...] = (0,)  # the row at which each begins

    @cached_property
    def _arrays(self) -> dict[str, NDArray]:  # type: ignore[type-arg]
        return {}

    def __getitem__(self, name: str) -> NDArray:  # type: ignore[type-arg]
        """The column (N,) of that name; NaN where the topic knows it and this log lacks it."""
        found = self._arrays.get(name)
        if found is None:
            if name in self.arrow.column_names:
                found = _numpy(self.arrow.column(name))
            elif self.topic is not None and self.topic.column(name) is not None:
                found = np.full(len(self), np.nan)
            else:
                raise KeyError(f"{self.name} has no column {name!r}; it has {', '.join(self.columns)}")
            found.flags.writeable = False
            self._arrays[name] = found
        return found

    def __contains__(self, name: object) -> bool:
        """Whether the log has the column."""
        return name in self.arrow.column_names

    def __len__(self) -> int:
        return int(self.arrow.num_rows)

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that the log has."""
        return tuple(self.arrow.column_names)

    def unit(self, name: str) -> str | None:
        """The unit in the file, else the topic's own; None where neither says."""
        if name in self.arrow.column_names:
            metadata = self.arrow.schema.field(name).metadata or {}
            if b"unit" in metadata:
                return str(metadata[b"unit"].decode())
        column = None if self.topic is None else self.topic.column(name)
        return None if column is None else column.unit

    def stack(self, *names: str) -> NDArray[np.float64]:
        """Columns side by side (N, len(names))."""
        return np.column_stack([np.asarray(self[name], float) for name in names])

    def segment(self, index: int) -> "Table":
        """One span between resets of the clock as a table of its own."""
        edges = (*self.segments, len(self))
        return Table(self.name, self.arrow.slice(edges[index], edges[index + 1] - edges[index]), self.topic)


def table(group: str, name: str, rows: Sequence[Sequence[Any]], columns: Iterable[str] | None = None) -> Table:
    """A table in memory from rows in order of time; `columns` where they are not all that the topic has."""
    chosen = columns_of(group, name, columns)
    arrays = [pa.array(values) for values in zip(*rows, strict=True)] or [pa.array([], pa.float64())] * len(chosen)
    return Table(name, pa.table(arrays, names=[column.name for column in chosen]), topic_of(group, name))


def arrange(arrow: pa.Table, topic: Topic | None, name: str, file: str) -> tuple[Table, list[str]]:
    """A table in order of time, and notes on what was out of order.

    Args:
        arrow: rows as the log has them.
        topic: what the columns are, None where unknown.
        name: how to call it.
        file: how to call its file in an error.
    """
    if "t" not in arrow.column_names:
        raise UserError(f"{file}: no column t; it has {', '.join(arrow.column_names) or 'none'}")
    if len(set(arrow.column_names)) < len(arrow.column_names):
        raise UserError(f"{file}: two columns of one name among {', '.join(arrow.column_names)}")
    arrow = _typed(arrow, topic, file)
    notes = []
    t = _numpy(arrow.column("t"))
    if t.dtype.kind not in "fiu":
        raise UserError(f"{file}: column t is {arrow.schema.field('t').type}; seconds as a number would be right")
    t = t.astype(float)
    timed = np.isfinite(t)
    if not timed.all():
        notes.append(f"{name}: {np.count_nonzero(~timed)} rows without a time left out")
        arrow, t = arrow.filter(pa.array(timed)), t[timed]
    segments = _resets(t)
    edges = (*segments, len(t))
    order = np.arange(len(t))
    backward = repeats = 0
    for start, end in pairwise(edges):
        part = t[start:end]
        backward += int(np.count_nonzero(np.diff(part) < 0))
        order[start:end] = start + np.argsort(part, kind="stable")
        repeats += int(np.count_nonzero(np.diff(t[order[start:end]]) == 0))
    if len(segments) > 1:
        starts = ", ".join(f"{t[order[i]]:.3f} s (row {i})" for i in segments[1:])
        notes.append(f"{name}: the clock was reset {len(segments) - 1} time(s); segments start again at {starts}")
    if backward:
        notes.append(f"{name}: {backward} backward step(s) in time; rows sorted")
        arrow = arrow.take(pa.array(order))
    if repeats:
        notes.append(f"{name}: {repeats} repeated time(s)")
    return Table(name, arrow, topic, segments), notes


def _resets(t: NDArray[np.float64]) -> tuple[int, ...]:
    """Rows at which a clock starts again: it falls back by more than RESET and stays behind.

    A late row, or rows out of order, fall back too, but the clock is ahead again before it could have run that far.
    """
    falls = np.flatnonzero(np.diff(t) < -RESET) + 1
    if not len(falls):
        return (0,)
    steps = np.diff(t)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    found = [0]
    for i in falls.tolist():
        if i - found[-1] > 1 and t[i - 2] - t[i] < RESET:
            continue  # a row that came too early
        before, after = float(t[found[-1] : i].max()), t[i : i + LOOK_AHEAD]
        ahead = np.flatnonzero(after >= before)
        behind = int(ahead[0]) if len(ahead) else len(after)
        fell = before - float(t[i])
        if (behind > 1 and behind * usual >= 0.8 * fell) or (not len(ahead) and fell > DISORDER * usual):
            found.append(i)
    return tuple(found)


def _typed(arrow: pa.Table, topic: Topic | None, file: str) -> pa.Table:
    """Known number columns as float64, int64 or bool, whatever width or encoding the file gave them."""
    if topic is None:
        return arrow
    for index, field in enumerate(arrow.schema):
        column = topic.column(field.name)
        if column is None or column.kind == "text":
            continue
        values = arrow.column(index)
        if pa.types.is_boolean(field.type) and column.kind != "float":
            continue
        if not (pa.types.is_floating(field.type) or pa.types.is_integer(field.type) or pa.types.is_boolean(field.type)):
            raise UserError(f"{file}: column {field.name} is {field.type}; a number would be right")
        if column.kind == "float" and field.type != pa.float64():
            values = pc.cast(pc.cast(values, pa.int8()) if pa.types.is_boolean(field.type) else values, pa.float64())
            arrow = arrow.set_column(index, pa.field(field.name, pa.float64(), metadata=field.metadata), values)
        elif column.kind == "bool":
            values = pc.not_equal(values, 0)
            arrow = arrow.set_column(index, pa.field(field.name, pa.bool_(), metadata=field.metadata), values)
    return arrow


def _numpy(column: pa.ChunkedArray) -> NDArray:  # type: ignore[type-arg]
    """A column (N,); nulls become NaN (None among texts)."""
    if column.null_count and (pa.types.is_integer(column.type) or pa.types.is_boolean(column.type)):
        column = pc.cast(pc.cast(column, pa.int64()), pa.float64())
    return np.array(column.to_numpy())

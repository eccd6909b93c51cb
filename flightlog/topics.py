"""The flight log's topics: every column with its unit, in the order in which rows are written.

A topic may carry further columns (a reader keeps them) and may lack some (a reader gives NaN). A second device of a
kind is `<topic>_2`, `_3`.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from flightlog.signals import StateEstimate

Kind = Literal["float", "int", "bool", "text"]


@dataclass(frozen=True)
class Column:
    """One column of a topic; unit "1" where a number has none, "" for text."""

    name: str
    unit: str
    kind: Kind = "float"


@dataclass(frozen=True)
class Topic:
    """What one topic holds."""

    name: str
    columns: tuple[Column, ...]  # as Helideck writes them
    further: tuple[Column, ...] = ()  # known as well, where a log has them
    numbered: tuple[Column, ...] = ()  # m stands for m1, m2, ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns that Helideck writes."""
        return tuple(column.name for column in self.columns)

    @property
    def known(self) -> tuple[Column, ...]:
        """All columns with names of their own."""
        return self.columns + self.further

    def column(self, name: str) -> Column | None:
        """The column of that name, None where the topic knows none."""
        for column in self.known:
            if column.name == name:
                return column
        for column in self.numbered:
            if re.fullmatch(rf"{column.name}[1-9]\d*", name):
                return Column(name, column.unit, column.kind)
        return None


def _columns(text: str) -> tuple[Column, ...]:
    """Columns from lines `names : unit [kind]`, names separated by blanks."""
    columns = []
    for line in filter(None, (part.strip() for part in text.split(";"))):
        names, _, right = line.partition(":")
        unit, kind = [*right.split(), "float"][:2]
        columns += [Column(name, unit.strip('"'), kind) for name in names.split()]  # type: ignore[arg-type]
    return tuple(columns)


def _catalogue(*topics: Topic) -> Mapping[str, Topic]:
    return MappingProxyType({topic.name: topic for topic in topics})


_STICKS = _columns("t: s; collective lateral longitudinal tail: rad; throttle: 1")
_MOTORS = _columns("m: 1")

MEASURED: Mapping[str, Topic] = _catalogue(
    Topic("imu", _columns("t: s; fx fy fz: m/s^2; wx wy wz: rad/s")),
    Topic("mag", _columns("t: s; mx my mz: uT")),
    Topic("baro", _columns("t: s; pressure: Pa; temperature: K; altitude: m")),
    Topic("gps", _columns("t t_arrival: s; e n u: m; ve vn vu: m/s; satellites: 1 int; hdop: 1; valid: 1 bool")),
    Topic("sonar", _columns("t: s; range: m; valid: 1 bool")),
    Topic(
        "pad",
        _columns(
            't t_arrival: s; x y z: m; angle: rad; std_x std_y std_z: m; std_angle: rad; quality: 1; source: "" text'
        ),
    ),
    Topic("horizon", _columns("t t_arrival: s; roll pitch std_roll std_pitch: rad; valid: 1 bool")),
    Topic("flow", _columns("t t_arrival dt: s; u v: rad; quality: 1")),
    Topic("controls", _STICKS, numbered=_MOTORS),
    Topic("actuators", _STICKS, numbered=_MOTORS),
    Topic("rotor", _columns("t: s; speed: rad/s"), numbered=_columns("speed: rad/s")),
    Topic("battery", _columns("t: s; voltage: V; current: A")),
    Topic(
        "estimate",
        _columns(
            "t: s; e n u: m; ve vn vu: m/s; roll pitch heading: rad; ae an au: m/s^2;"
            "std_e std_n std_u: m; std_ve std_vn std_vu: m/s; std_roll std_pitch std_heading: rad"
        ),
        further=_columns("std_ae std_an std_au: m/s^2"),
    ),
    Topic(
        "reference",
        _columns("t: s; e n u: m; roll pitch heading: rad"),
        further=_columns("qw qx qy qz: 1; ve vn vu: m/s; wx wy wz: rad/s"),
    ),
    Topic("joints", _columns("t: s")),
    Topic("frames", _columns('t t_arrival: s; camera file: "" text')),
)

TRUTH: Mapping[str, Topic] = _catalogue(
    Topic("state", _columns("t: s; e n u: m; ve vn vu: m/s; roll pitch heading: rad; wx wy wz: rad/s")),
    Topic("wind", _columns("t: s; e n u: m/s")),  # where the air moves to, at the body origin
    Topic("rotor", _columns("t: s; speed: rad/s"), numbered=_columns("speed: rad/s")),
    Topic("contact", _columns("t: s; contacts: 1 int; force: N")),  # skid contacts, normal force over all of them
    Topic("errors", _columns("t: s")),  # one column a fault state, named <sensor>_<state>
)

GROUPS: Mapping[str, Mapping[str, Topic]] = MappingProxyType({"measured": MEASURED, "truth": TRUTH})


def topic_of(group: str, name: str) -> Topic | None:
    """The topic of a table's name in measured or truth (`gps_2` is a gps); None for one that is not in the list."""
    topics = GROUPS[group]
    found = topics.get(name)
    return topics.get(re.sub(r"_[1-9]\d*$", "", name)) if found is None else found


def columns_of(group: str, name: str, columns: Iterable[str | Column] | None = None) -> tuple[Column, ...]:
    """What a writer writes: the topic's own columns, or those asked for, each by its name or given whole."""
    topic = topic_of(group, name)
    if columns is None:
        if topic is None:
            raise ValueError(f"{group}/{name} is no topic: give its columns, or one of {', '.join(GROUPS[group])}")
        return topic.columns
    chosen = []
    for column in columns:
        known = column if isinstance(column, Column) else topic.column(column) if topic is not None else None
        if known is None:
            raise ValueError(f"{group}/{name} knows no column {column!r}: give it as a Column with its unit")
        chosen.append(known)
    if not chosen or chosen[0].name != "t":
        raise ValueError(f"{group}/{name}: the first column is t")
    return tuple(chosen)


def estimate_row(estimate: StateEstimate) -> tuple[float, ...]:
    """A row of the topic `estimate`."""
    vectors = (
        estimate.position,
        estimate.velocity,
        np.array([estimate.roll, estimate.pitch, estimate.heading]),
        estimate.acceleration,
        estimate.std_position,
        estimate.std_velocity,
        estimate.std_attitude,
    )
    return (estimate.t, *np.concatenate(vectors).tolist())

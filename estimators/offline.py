"""Runs a navigator over a measured log, in the log's own clock."""

import math
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from estimators.kinematic import Angles, KinematicNavigator
from estimators.log_samples import KINDS, SEEN, arrivals
from estimators.navigators import Navigator, Steered
from estimators.replay import AHEAD
from flightlog.equipment import Equipment
from flightlog.errors import UserError
from flightlog.signals import Controls, ImuSample, Measurement, StateEstimate
from flightlog.tables import Table
from flightlog.topics import columns_of, estimate_row, topic_of

Floats = NDArray[np.float64]

ROWS = 50.0  # [Hz] of the series at most
PERIOD = 0.02  # [s] of a run without inertial samples
ACCELERATION = 2.0  # [m/s^2/sqrt(Hz)] then: a surge of 3 m/s^2 for half a second
PAUSE = 30.0  # [s] without inertial samples, after which a navigator begins anew
WITHOUT_IMU = ("baro", "gps", "sonar")
COLUMNS = columns_of("measured", "estimate")

Maker = Callable[[], Navigator]
Progress = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Run:
    """What a navigator made of a log."""

    estimate: Table  # the topic `estimate`, at most 50 rows a second
    used: tuple[str, ...]  # topics of which samples were taken in
    rejected: Mapping[str, int]  # by topic, samples that were not used
    inertial: bool  # False: there were no inertial samples


def run(
    segments: Sequence[Mapping[str, Table]],
    equipment: Equipment,
    make: Maker,
    *,
    pictures: Path | None = None,
    progress: Progress | None = None,
) -> Run:
    """Run over a log's segments, each with a navigator of its own.

    Args:
        segments: tables by topic, of each span between resets of the clock.
        equipment: the sensors as known aboard.
        make: makes the navigator; not asked where there are no inertial samples.
        pictures: folder of the pictures that the topic `frames` names, for vision to run again.
        progress: told the time of the log [s] now and then.

    Raises:
        UserError: the log has neither inertial samples nor height or position.
    """
    rows = array("d")
    used: set[str] = set()
    rejected: Counter[str] = Counter()
    inertial = any("imu" in tables for tables in segments)
    for tables in segments:
        own = make if "imu" in tables else _kinematic(tables, equipment)
        if own is None:
            continue
        taken = set(KINDS if "imu" in tables else WITHOUT_IMU) & tables.keys()
        if pictures is not None and "frames" in tables:
            taken = taken - set(SEEN) | {"frames"}
        used |= taken
        for navigator, state in _states(own, tables, equipment, pictures, rejected):
            rows.extend(estimate_row(state))
            if progress is not None and len(rows) % (100 * len(COLUMNS)) == 0:
                progress(state.t)
            latest = navigator
        rejected.update(latest.rejected)
    if not rows:
        names = ", ".join(sorted({name for tables in segments for name in tables}))
        raise UserError(f"nothing to estimate from: an imu, or baro, gps or sonar would be right; there is {names}")
    columns = np.array(rows).reshape(-1, len(COLUMNS)).T
    fields = [pa.field(column.name, pa.float64(), metadata={"unit": column.unit}) for column in COLUMNS]
    table = Table("estimate", pa.table(list(columns), pa.schema(fields)), topic_of("measured", "estimate"))
    return Run(table, tuple(topic for topic in (*KINDS, "frames") if topic in used), dict(rejected), inertial)


def _kinematic(tables: Mapping[str, Table], equipment: Equipment) -> Maker | None:
    """What makes the navigator of a span without inertial samples; None where it has nothing to go by."""
    heard = [tables[topic] for topic in WITHOUT_IMU if topic in tables]
    if not heard:
        return None
    angles = None
    for topic in ("reference", "estimate"):
        table = tables.get(topic)
        if angles is None and table is not None and "roll" in table and "pitch" in table:
            angles = Angles(table["t"], table["roll"], table["pitch"], table["heading"])
    start = min(float(table["t"][0]) for table in heard)
    return lambda: KinematicNavigator(
        equipment, start - PERIOD, period=PERIOD, acceleration=ACCELERATION, attitude=angles
    )


def _states(
    make: Maker, tables: Mapping[str, Table], equipment: Equipment, pictures: Path | None, rejected: Counter[str]
) -> Iterator[tuple[Navigator, StateEstimate]]:
    """The navigator and its state, at most ROWS times a second, after each update that is due."""
    navigator = make()
    steer = _steering(tables)
    steered = navigator if isinstance(navigator, Steered) else None
    last = due = -math.inf
    for t, batch in _batches(tables, equipment, pictures):
        if t - last > PAUSE and math.isfinite(last):
            rejected.update(navigator.rejected)
            navigator = make()
            steered = navigator if isinstance(navigator, Steered) else None
        last = t
        state = navigator.update(batch)
        if steered is not None and (controls := steer(t)) is not None:
            steered.steer(controls)
        if t >= due - 1e-6:
            due = max(due, t - 1.0 / ROWS) + 1.0 / ROWS if math.isfinite(due) else t + 1.0 / ROWS
            yield navigator, state


def _batches(
    tables: Mapping[str, Table], equipment: Equipment, pictures: Path | None
) -> Iterator[tuple[float, list[Measurement]]]:
    """(time [s], what arrived since the last) for each update: one an inertial sample, or one a period without them."""
    times = _clock(tables, equipment)
    seldom = "imu" in tables and equipment.sensors["imu"].rate * AHEAD < 1.0
    stream = arrivals(tables, equipment, pictures)
    waiting = next(stream, None)
    for t in times:
        batch = []
        while waiting is not None and waiting[0] <= t + 1e-9:
            batch.append(waiting[1])
            waiting = next(stream, None)
        # in the order in which it was sent, as in flight; but filters refuse what lies far ahead of the inertial sample
        batch.sort(key=lambda sample: (seldom and type(sample) is not ImuSample, sample.t))
        yield t, batch


def _clock(tables: Mapping[str, Table], equipment: Equipment) -> Iterator[float]:
    """When updates happen [s]: at inertial samples, in their period where some are missing."""
    if "imu" not in tables:
        spans = [tables[topic]["t"] for topic in WITHOUT_IMU if topic in tables]
        start, end = min(float(t[0]) for t in spans), max(float(t[-1]) for t in spans)
        yield from start + PERIOD * np.arange(math.ceil((end - start) / PERIOD) + 1)
        return
    stamps = np.unique(tables["imu"]["t"])
    period = 1.0 / equipment.sensors["imu"].rate
    last = math.nan
    for t in stamps.tolist():
        gap = t - last
        if 1.5 * period < gap <= PAUSE:
            for k in range(1, round(gap / period)):
                yield last + k * period
        yield t
        last = t


def _steering(tables: Mapping[str, Table]) -> Callable[[float], Controls | None]:
    """The controls in force at a time [s]; None before the first, or where the log has none."""
    table = tables.get("controls")
    if table is None or not any(name in table for name in Controls._fields):
        return lambda t: None
    stamps = table["t"]
    columns = np.nan_to_num(table.stack(*Controls._fields)).tolist()

    def at(t: float) -> Controls | None:
        row = int(np.searchsorted(stamps, t + 1e-9, side="right")) - 1
        return Controls(*columns[row]) if row >= 0 else None

    return at


"""Heights of one flight that several sensors measure, and what stands beside them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.tables import Table

Floats = NDArray[np.float64]

LEAST = 20  # rows of a channel that is looked at
FROZEN = 5.0  # [s] of one and the same value: the channel stood still, not the aircraft
LONG_STEP = 2.0  # [s] between rows: nothing is known in between


@dataclass(frozen=True, eq=False)
class Series:
    """One channel: values at times, both (N,)."""

    name: str  # topic and column
    t: Floats  # [s]
    value: Floats  # [m], or [m/s]

    def at(self, t: Floats) -> Floats:
        """Value at other times (M,); NaN outside and in gaps."""
        found = np.interp(t, self.t, self.value, left=np.nan, right=np.nan)
        after = np.clip(np.searchsorted(self.t, t), 1, len(self.t) - 1)
        return np.where(self.t[after] - self.t[after - 1] > LONG_STEP, np.nan, found)

    def moved(self, by: float) -> "Series":
        """The same, later by so many seconds."""
        return Series(self.name, self.t + by, self.value)

    def without(self, bad: NDArray[np.bool_]) -> "Series":
        """The rows that are left when some are taken out."""
        return Series(self.name, self.t[~bad], self.value[~bad])


@dataclass(frozen=True, eq=False)
class Heights:
    """All that tells of a flight's height; topics that are not there are missing from the mappings."""

    baro: Mapping[str, Series]  # by topic
    gps: Mapping[str, Series]
    climb: Mapping[str, Series]  # by topic of the receiver, velocity up
    reference: Series | None
    sonar: Series | None  # rows that claim an echo
    speed: Series | None  # [m/s] over the ground
    place: tuple[Series, Series] | None  # [m] east and north
    throttle: Series | None  # [1]
    hdop: float  # median; NaN where it is not logged
    notes: tuple[str, ...]

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of any of these."""
        every = [s for s in (*self.baro.values(), *self.gps.values(), self.reference, self.sonar) if s is not None]
        return min(float(s.t[0]) for s in every), max(float(s.t[-1]) for s in every)

    @property
    def levels(self) -> dict[str, Series]:
        """Heights over the start, by topic."""
        found = {**self.baro, **self.gps}
        return found if self.reference is None else {**found, "reference": self.reference}


def collect(tables: Mapping[str, Table]) -> Heights:
    """What a flight's tables say of its height. Channels that are dead are left out and noted."""
    notes: list[str] = []

    def take(topic: str, column: str, where: NDArray[np.bool_] | None = None) -> Series | None:
        table = tables.get(topic)
        if table is None or column not in table or table[column].dtype.kind not in "fiub":
            return None
        t, value = np.asarray(table["t"], float), np.asarray(table[column], float)
        good = np.isfinite(t) & np.isfinite(value) if where is None else np.isfinite(t) & np.isfinite(value) & where
        t, value = t[good], value[good]
        fresh = np.concatenate([[True], np.diff(t) > 0.0]) if len(t) else np.zeros(0, bool)
        t, value = t[fresh], value[fresh]
        if len(t) < LEAST:
            return None
        still = frozen(t, value) & (topic != "sonar" or np.ptp(value) == 0.0)  # a ranger rests while the skids do
        if still.any():
            dead = float(np.mean(still)) > 0.9
            fate = "it is" if dead else "those are"
            rows = f"{np.count_nonzero(still)} of {len(t)} rows"
            notes.append(f"{topic}.{column}: stands still for {rows}; {fate} left out")
            t, value = t[~still], value[~still]
            if dead or len(t) < LEAST:
                return None
        return Series(f"{topic}.{column}", t, value)

    baro, gps, climb = {}, {}, {}
    hdop = np.nan
    for topic in tables:
        kind = topic.split("_")[0]
        if kind == "baro" and (series := take(topic, "altitude")) is not None:
            baro[topic] = series
        if kind == "gps":
            fixed = _flag(tables[topic], "valid")
            if (series := take(topic, "u", fixed)) is not None:
                gps[topic] = series
                hdop = hdop if np.isfinite(hdop) else _median(tables[topic], "hdop")
            if (series := take(topic, "vu", fixed)) is not None:
                climb[topic] = series
    speed = None
    first = next(iter(gps), None)
    if first is not None and {"ve", "vn"} <= set(tables[first].columns):
        rows = tables[first].stack("ve", "vn")
        good = np.isfinite(rows).all(axis=1) & _flag(tables[first], "valid")
        if np.count_nonzero(good) >= LEAST:
            speed = Series(f"{first}.ve, vn", np.asarray(tables[first]["t"], float)[good], np.hypot(*rows[good].T))
    east, north = (None if first is None else take(first, axis, _flag(tables[first], "valid")) for axis in "en")
    place = None if east is None or north is None else (east, north)
    reference = take("reference", "u")
    sonar = take("sonar", "range", _flag(tables["sonar"], "valid")) if "sonar" in tables else None
    return Heights(
        baro, gps, climb, reference, sonar, speed, place, _throttle(tables), float(hdop), tuple(notes),
    )  # fmt: skip


def frozen(t: Floats, value: Floats) -> NDArray[np.bool_]:
    """(N,) rows in runs of one value that last longer than any working sensor's."""
    edges = np.flatnonzero(np.concatenate([[True], np.diff(value) != 0.0, [True]]))
    starts, ends = edges[:-1], edges[1:] - 1
    long = t[ends] - t[starts] > FROZEN
    return np.repeat(long, ends - starts + 1)


def _flag(table: Table, column: str) -> NDArray[np.bool_]:
    if column not in table:
        return np.ones(len(table), bool)
    return np.asarray(np.nan_to_num(np.asarray(table[column], float)) > 0)


def _median(table: Table, column: str) -> float:
    values = np.asarray(table[column], float) if column in table else np.empty(0)
    values = values[np.isfinite(values) & (values > 0.0)]
    return float(np.median(values)) if len(values) else np.nan


def _throttle(tables: Mapping[str, Table]) -> Series | None:
    """What drives the rotors, where the log has it as one number in 0 .. 1."""
    table = tables.get("controls")
    column = next((c for c in ("throttle", "collective") if table is not None and c in table), None)
    if table is None or column is None:
        return None
    t, value = np.asarray(table["t"], float), np.asarray(table[column], float)
    good = np.isfinite(t) & np.isfinite(value) & (np.abs(value) <= 1.5)
    return Series(f"controls.{column}", t[good], value[good]) if np.count_nonzero(good) >= LEAST else None

"""A log's tables as the measurements that they were, in the order in which they arrived."""

import heapq
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.equipment import Equipment
from flightlog.errors import UserError
from flightlog.signals import (
    BaroSample,
    FlowSample,
    Frame,
    GpsSample,
    HorizonSample,
    ImuSample,
    MagSample,
    Measurement,
    PadSample,
    RotorSample,
    SonarSample,
)
from flightlog.tables import Table

Floats = NDArray[np.float64]

BLOCK = 4096  # [rows] turned into samples at a time: a log of hours does not stand in memory twice

# in the order in which samples of one time are sent
KINDS: Mapping[str, Callable[..., Measurement]] = {
    "imu": ImuSample, "mag": MagSample, "baro": BaroSample, "gps": GpsSample, "sonar": SonarSample,
    "rotor": RotorSample, "pad": PadSample, "horizon": HorizonSample, "flow": FlowSample,
}  # fmt: skip
SEEN = ("pad", "horizon", "flow")  # what eyes have seen: not measured again where the pictures are there
FIELDS: Mapping[str, tuple[str, ...]] = {name: kind._fields for name, kind in KINDS.items()}  # type: ignore[attr-defined]


# (arrival [s], validity [s], rank among those of one time, number, sample)
Sent = tuple[float, float, int, int, Any]


def arrivals(
    tables: Mapping[str, Table], equipment: Equipment, pictures: Path | None = None
) -> Iterator[tuple[float, Measurement]]:
    """(time of arrival [s], sample) in order of arrival, then of sending.

    A time of arrival that the log does not hold is the time of validity and the sensor's latency.

    Args:
        tables: by topic; topics that no navigator takes are passed over.
        equipment: the sensors as known aboard.
        pictures: the folder of the pictures that the topic `frames` names; None: what was seen in them stands in.
    """
    streams = []
    for rank, topic in enumerate(KINDS):
        if topic in tables and not (pictures is not None and topic in SEEN):
            streams.append(_stream(topic, rank, tables[topic], equipment))
    if pictures is not None and "frames" in tables:
        streams.append(_frames(tables["frames"], pictures, len(KINDS)))
    for arrival, _, _, _, sample in heapq.merge(*streams, key=lambda sent: sent[:4]):
        yield arrival, sample


def _stream(topic: str, rank: int, table: Table, equipment: Equipment) -> Iterator[Sent]:
    """Samples of one topic, by arrival."""
    kind = KINDS[topic]
    columns = {name: _column(topic, table, name) for name in FIELDS[topic]}
    t = columns["t"]
    spec = equipment.sensors.get(topic)
    if topic == "sonar" and spec is not None:  # echoes from beyond its reach are none
        columns["valid"] = columns["valid"] & (columns["range"] <= spec["greatest_range"])
    late = t + (spec.latency if spec is not None else 0.0)
    if "t_arrival" in columns:
        known = np.isfinite(columns["t_arrival"])
        columns["t_arrival"] = np.where(known, columns["t_arrival"], late)
        late = columns["t_arrival"]
    order = np.lexsort((t, late))
    for start in range(0, len(t), BLOCK):
        rows = order[start : start + BLOCK]
        cells = [columns[name][rows].tolist() for name in FIELDS[topic]]
        when = late[rows].tolist()
        for index, (arrival, values) in enumerate(zip(when, zip(*cells, strict=True), strict=True), start):
            yield arrival, values[0], rank, index, kind(*values)


def _column(topic: str, table: Table, name: str) -> NDArray[Any]:
    """A field's values (N,): of numbers float, of truth values bool; a missing one is NaN, valid, or none."""
    values = table[name]
    if name == "valid":
        wanted = {"sonar": "range", "gps": "u", "horizon": "roll"}[topic]
        heard = np.isfinite(table[wanted].astype(float))
        return heard & (values.astype(float) == 1.0) if name in table else heard
    if name == "satellites":
        return np.nan_to_num(values.astype(float), nan=0.0).astype(int)
    if name == "source":
        return values if name in table else np.full(len(table), "log", object)
    return values.astype(float)


def _frames(table: Table, folder: Path, rank: int) -> Iterator[Sent]:
    """Pictures, read one at a time."""
    import cv2

    t, late = table["t"].astype(float), table["t_arrival"].astype(float)
    late = np.where(np.isfinite(late), late, t)
    for row in np.lexsort((t, late)).tolist():
        file = folder / str(table["file"][row])
        picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        if picture is None:
            raise UserError(f"{file}: no picture that can be read; the topic frames names it")
        image = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2RGB)
        frame = Frame(float(t[row]), float(late[row]), str(table["camera"][row]), image.astype(np.uint8, copy=False))
        yield float(late[row]), float(t[row]), rank, row, frame

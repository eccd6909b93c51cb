"""Columns that the sensors among themselves would rather have exchanged, or of the other sign.

A flight that stays in place hardly moves east or north, and a receiver whose axes are exchanged looks like one that
drifts. So where something is found wrong with a sensor, the motion is filtered again with columns turned: what is
likelier that way by more than what was found explains is no fault but a wrong column.
"""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pyarrow as pa

from flightlog.errors import UserError
from flightlog.tables import Table
from identification.flight import Motion, prepare
from identification.kinematics import GATE, HUBER
from sim.vehicle import Vehicle

Tables = Mapping[str, Table]

SURE = 20.0  # [nats] that it takes at least
# by topic: what is said of it, and where each column would come from, with its sign
TURNED: Mapping[str, Mapping[str, Mapping[str, tuple[str, float]]]] = {
    "gps": {
        "gps.e and gps.n are likely swapped": {"e": ("n", 1.0), "n": ("e", 1.0), "ve": ("vn", 1.0), "vn": ("ve", 1.0)},
        "gps.e has likely the wrong sign": {"e": ("e", -1.0), "ve": ("ve", -1.0)},
        "gps.n has likely the wrong sign": {"n": ("n", -1.0), "vn": ("vn", -1.0)},
    },
    "pad": {
        "pad.x and pad.y are likely swapped": {
            "x": ("y", 1.0), "y": ("x", 1.0), "std_x": ("std_y", 1.0), "std_y": ("std_x", 1.0)
        },
        "pad.x has likely the wrong sign": {"x": ("x", -1.0)},
        "pad.y has likely the wrong sign": {"y": ("y", -1.0)},
        "pad.angle has likely the wrong sign": {"angle": ("angle", -1.0)},
    },
}  # fmt: skip


def check(logs: Mapping[str, Tables], vehicle: Vehicle, said: str, gained: float) -> None:
    """Raise UserError where columns are likelier turned; looked at is one flight, as all are read alike.

    said: what was found instead; gained [nats]: log evidence of it, all flights together.
    """
    name, tables = max(logs.items(), key=lambda item: len(item[1].keys() & TURNED.keys()))
    ways = [(told, topic, columns) for topic in TURNED if topic in tables for told, columns in TURNED[topic].items()]
    flights = [tables, *({**tables, topic: _turned(tables[topic], columns)} for _, topic, columns in ways)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        as_read, *turned = pool.map(lambda flight: _likelihood(prepare(name, flight, vehicle).motion), flights)
    best = int(np.argmax(turned)) if turned else 0
    if turned and turned[best] - as_read > max(SURE, gained / len(logs)):
        raise UserError(
            f"{name}: {ways[best][0]}: that way all sensors agree better by {turned[best] - as_read:.0f} nats; as they "
            f"are, {said} would be found"
        )


def _turned(table: Table, columns: Mapping[str, tuple[str, float]]) -> Table:
    arrow = table.arrow
    for name, (source, sign) in columns.items():
        if name in table and source in table:
            values = pa.array(sign * np.asarray(table[source], float))
            arrow = arrow.set_column(arrow.column_names.index(name), name, values)
    return Table(table.name, arrow, table.topic)


def _likelihood(motion: Motion) -> float:
    """[nats] of all measurements of the motion, each by what came before it."""
    innovation, std, _ = motion.answers.T
    size = np.minimum(np.abs(innovation) / std, GATE)
    square = np.where(size <= HUBER, size**2, HUBER * (2.0 * size - HUBER))
    return -float(np.sum(0.5 * square + np.log(std)))

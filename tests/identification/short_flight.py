"""A short flight of the helicopter in which nothing is wrong: its columns, for a fault to be put in."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from flightlog.readers import read_flight
from flightlog.tables import Table
from flightlog.topics import topic_of
from scenarios.flight import fly
from scenarios.load import build

Columns = dict[str, dict[str, NDArray[Any]]]


def short_flight(folder: Path, seconds: float = 14.0) -> Columns:
    """Columns by topic of a landing from 3.2 m, without what the navigator made of them."""
    place = {"position_m": [1.0, -1.0, 3.2]}
    scenario = build(duration_s=seconds, start=place, plan={"goal": "land", "point_m": [0.0, 0.0, 3.2]})
    fly(scenario, seed=3, folder=folder, cameras=False)
    tables = read_flight(folder, truth=False).measured
    return {
        topic: {name: np.array(table[name]) for name in table.columns}
        for topic, table in tables.items()
        if topic != "estimate"
    }


def copied(columns: Columns) -> Columns:
    """The same, to be changed."""
    return {topic: dict(found) for topic, found in columns.items()}


def written(columns: Mapping[str, Mapping[str, NDArray[Any]]], folder: Path) -> Path:
    """A flight folder of these columns."""
    (folder / "measured").mkdir(parents=True)
    (folder / "flight.json").write_text(json.dumps({"scenario_name": "made", "seed": [0]}), encoding="utf-8")
    for topic, found in columns.items():
        pq.write_table(pa.table(dict(found)), folder / "measured" / f"{topic}.parquet")
    return folder


def made_table(topic: str, columns: dict[str, NDArray[Any]]) -> Table:
    """Columns as a table of their topic."""
    return Table(topic, pa.table(dict(columns)), topic_of("measured", topic))

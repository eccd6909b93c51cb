"""What `helideck predict` does: a log and a vehicle file in, errors of free runs out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from flightlog import toml_file
from flightlog.errors import UserError
from flightlog.readers import read_log
from helideck.estimation import find_mapping
from identification.course import courses
from identification.free_run import Channel, predict
from sim.rig import load_rig
from sim.vehicle import find


@dataclass(frozen=True)
class Prediction:
    """Free runs of one log, as `--json` prints them."""

    log: Path
    vehicle: str
    channels: Sequence[Channel]


def predict_log(
    log: Path,
    vehicle: Path,
    mapping: Path | None = None,
    horizon: float = 10.0,
    every: float = 2.5,
    between: tuple[float | None, float | None] = (None, None),
) -> Prediction:
    """Free runs of `horizon` [s], one `every` [s], over a log or what was logged `between` two times [s].

    Raises:
        UserError: a log or vehicle file that cannot be used, or that do not fit one another.
    """
    path = find(vehicle)
    kind = toml_file.read(path).get("kind")
    if kind != "rig":
        raise UserError(f"{path}: kind: found {kind!r}; predict runs vehicles of kind 'rig'")
    rig = load_rig(vehicle)
    read = read_log(log, find_mapping(mapping))
    stretches = [
        course
        for segment in range(len(read.segments))
        for course in courses(str(log), read.segment(segment), rig)
    ]
    start, end = between
    if start is not None or end is not None:
        span = (-math.inf if start is None else start, math.inf if end is None else end)
        reached = [c for c in stretches if c.t[-1] >= span[0] and c.t[0] < span[1]]
        if not reached:
            raise UserError(f"{log}: nothing was logged between {span[0]:g} and {span[1]:g} s")
        stretches = [course.part(*span) for course in reached]
    return Prediction(log, rig.name, predict(rig, stretches, horizon, every))


def print_predictions(found: Sequence[Prediction]) -> None:
    """A table for people."""
    for item in found:
        table = Table(title=f"{item.log.name}: free runs of {item.vehicle}", title_justify="left")
        for heading in ("channel", "unit", "horizon [s]", "runs", "rms error", "largest", "rms of holding the last"):
            table.add_column(heading, justify="left" if heading in ("channel", "unit") else "right")
        for c in item.channels:
            table.add_row(c.channel, c.unit, f"{c.horizon_s:g}", str(c.runs), f"{c.rmse:.3f}", f"{c.max:.3f}",
                          f"{c.hold_last_rmse:.3f}")  # fmt: skip
        Console().print(table)

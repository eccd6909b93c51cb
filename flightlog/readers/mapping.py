"""The mapping file of a wide CSV: which column is which topic's, in which unit, along which axes."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator
from scipy.spatial.transform import Rotation

from flightlog import toml_file
from flightlog.errors import UserError
from flightlog.topics import MEASURED, Topic, topic_of
from flightlog.units import to_si

Floats = NDArray[np.float64]

SUFFIX = ".mapping.toml"
FREE = ("controls", "actuators", "joints")  # topics whose columns are named by whoever logs them
DOWN = {"u", "vu", "au"}  # point down in NED
TURNED = {"fy", "fz", "wy", "wz", "my", "mz"}  # point right and down in FRD
QUATERNION = ("qw", "qx", "qy", "qz")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Clock(_Strict):
    """Where the time comes from: a column, or the step from row to row."""

    column: str | None = None
    unit: str = "s"
    step: Annotated[float, Field(gt=0.0)] | None = None  # [s]

    @model_validator(mode="after")
    def _one(self) -> "Clock":
        if (self.column is None) == (self.step is None):
            raise ValueError('give either column = "..." or step = seconds')
        return self


class Target(_Strict):
    """What a column of the file becomes: scale times it plus offset, in `unit`, is `to`."""

    to: str
    unit: str | None = None  # None: SI
    scale: float = 1.0
    offset: float = 0.0


class Frames(_Strict):
    """Along which axes the file's vectors are. `to` names the line (n north, fy sideways), this the sense."""

    world: Literal["ENU", "NED"] = "ENU"  # NED: u, vu, au are positive down
    body: Literal["FLU", "FRD"] = "FLU"  # FRD: y and z of forces, rates and fields are positive right and down


class MappingFile(_Strict):
    """The whole file."""

    time: Clock
    columns: Annotated[dict[str, Target], Field(min_length=1)]
    frames: Frames = Frames()


def read_mapping(path: Path) -> MappingFile:
    """The mapping in a file; UserError names file, line, key, what was found and what would be right."""
    found = toml_file.validate(toml_file.read(path), MappingFile, path)
    taken: dict[str, str] = {}
    for source, target in found.columns.items():
        topic, _, column = target.to.partition(".")
        place = f'{path}: columns."{source}"'
        known = topic_of("measured", topic)
        if known is None or not column:
            wanted = toml_file.nearest(topic, MEASURED)
            raise UserError(f"{place}: to = {target.to!r}: write it as topic.column; no topic {topic!r}; {wanted}")
        if known.name not in FREE and known.column(column) is None and not _is_yaw(known, column):
            names = [entry.name for entry in known.known] + (["yaw"] if known.column("heading") else [])
            wanted = toml_file.nearest(column, names)
            raise UserError(f"{place}: to = {target.to!r}: {topic} has no column {column!r}; {wanted}")
        if column == "t":
            raise UserError(f"{place}: to = {target.to!r}: the time is given by the key time")
        if target.to in taken:
            raise UserError(f"{place}: to = {target.to!r} is already the target of {taken[target.to]!r}")
        taken[target.to] = source
        try:
            to_si(1.0, target.unit or unit_of(known, column), unit_of(known, column, target.unit))
        except ValueError as error:
            raise UserError(f"{place}: {error}") from None
    try:
        to_si(1.0, found.time.unit, "s")
    except ValueError as error:
        raise UserError(f"{path}: time.unit: {error}") from None
    return found


def unit_of(topic: Topic, column: str, given: str | None = None) -> str:
    """The SI unit of a topic's column; of a freely named one that which was given."""
    known = topic.column("heading" if _is_yaw(topic, column) else column)
    if known is not None and (topic.name not in FREE or given is None or _fits(given, known.unit)):
        return known.unit
    if topic.name == "joints" and (given is None or _fits(given, "rad")):
        return "rad"
    return given or "1"


def _is_yaw(topic: Topic, column: str) -> bool:
    """Whether it is the other name of the heading."""
    return column == "yaw" and topic.column("heading") is not None


def _fits(unit: str, wanted: str) -> bool:
    try:
        to_si(1.0, unit, wanted)
    except ValueError:
        return False
    return True


def convert(values: Floats, target: Target, frames: Frames) -> tuple[str, str, Floats, str]:
    """(topic, column, values in SI along our axes, unit) of a column (N,) of the file."""
    name, _, column = target.to.partition(".")
    topic = topic_of("measured", name)
    assert topic is not None
    unit = unit_of(topic, column, target.unit)
    si = to_si(target.scale * values + target.offset, target.unit or unit, unit)
    if frames.world == "NED" and column in DOWN:
        si = -si
    if frames.body == "FRD" and column in TURNED and topic.name in ("imu", "mag", "reference"):
        si = -si
    if _is_yaw(topic, column):  # counter-clockwise from x, which is east in ENU; clockwise from north in NED
        column, si = "heading", (si if frames.world == "NED" else 0.5 * np.pi - si)
    if column == "heading" and np.nanmax(np.abs(si), initial=0.0) < 7.0:
        si = si % (2.0 * np.pi)  # not where the unit is wrong: that must stay to be seen
    return name, column, si, unit


def turn_quaternions(columns: dict[str, Floats], frames: Frames) -> None:
    """Bring qw, qx, qy, qz of a topic to ENU and forward, left, up, in place."""
    if not all(name in columns for name in QUATERNION) or frames == Frames():
        return
    q = np.column_stack([columns[name] for name in QUATERNION])
    sound = np.isfinite(q).all(axis=1) & (np.linalg.norm(q, axis=1) > 1e-6)
    world = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    body = Rotation.from_quat([1.0, 0.0, 0.0, 0.0])  # half a turn about forward
    turned = Rotation.from_quat(q[sound][:, [1, 2, 3, 0]])
    if frames.world == "NED":
        turned = world * turned
    if frames.body == "FRD":
        turned = turned * body
    q[sound] = turned.as_quat()[:, [3, 0, 1, 2]]
    q[~sound] = np.nan
    for index, name in enumerate(QUATERNION):
        columns[name] = q[:, index]

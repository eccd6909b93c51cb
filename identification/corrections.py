"""Measurements with what the vehicle file knows of its sensors' errors taken out.

A vehicle file that was extended by a diagnosis holds errors of sensors and cameras; a sound one holds none, and its
tables come back as they are. Lag and downwash of the barometer are not among these: the filter of the motion has them
in its own model.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from flightlog.camera import DOWN
from flightlog.equipment import CameraSpec
from flightlog.rotations import from_vector, matrix, quaternion
from flightlog.tables import Table
from identification.lens import bend
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

LENS_ROUNDS = 2
STATED = ("std_x", "std_y", "std_z")
FORCE, RATE = ("fx", "fy", "fz"), ("wx", "wy", "wz")


def bent(vehicle: Vehicle) -> bool:
    """Whether the file knows an error of the down camera's lens: what it does depends on how the camera is held."""
    pad = vehicle.sensors.get("pad")
    return "down" in vehicle.cameras and bool(vehicle.cameras["down"].k1_error + (pad.numbers["k1"] if pad else 0.0))


def corrected(
    tables: Mapping[str, Table], vehicle: Vehicle, attitudes: tuple[Floats, Floats] | None = None
) -> dict[str, Table]:
    """The tables as a sensor without the file's known errors would have given them, in the file's own clock.

    attitudes: times (S,) and quaternions (S, 4) by which a mark seen through a lens is looked at; None: level, with
    the heading in which the mark appears.
    """
    found = dict(tables)
    for topic, table in tables.items():
        if topic not in vehicle.sensors:
            continue
        numbers = vehicle.sensors[topic].numbers
        changes = _values(topic, table, numbers)
        if topic == "pad" and "down" in vehicle.cameras:
            held = None if attitudes is None else _held(table, vehicle.cameras["down"], numbers, attitudes)
            changes = _picture(table, vehicle, held)
        late = numbers.get("clock", 0.0)
        if topic == "gps":
            late += numbers["delay"]
        if topic == "pad" and "down" in vehicle.cameras:
            late += numbers["delay"] + vehicle.cameras["down"].stamp_delay
        if late:
            changes |= {name: np.asarray(table[name], float) - late for name in ("t", "t_arrival") if name in table}
        if changes:
            found[topic] = _with(table, changes)
    return found


def _values(topic: str, table: Table, n: Mapping[str, float]) -> dict[str, Floats]:
    """Columns that change, by the sensor's own equation solved for the truth."""
    match topic:
        case "imu":
            return _inertial(table, n)
        case "mag":
            return _less(table, {f"m{axis}": (n[f"bias_{axis}"], 0.0) for axis in "xyz"})
        case "baro":
            return _less(table, {"altitude": (n["bias"], n["drift_rate"])})
        case "gps":
            return _less(table, {axis: (n[f"bias_{axis}"], n[f"drift_rate_{axis}"]) for axis in "enu"})
        case "sonar" if n["scale"] != 1.0:
            return {"range": np.asarray(table["range"], float) / n["scale"]}
        case "rotor" if n["scale"] != 1.0:
            return {"speed": np.asarray(table["speed"], float) / n["scale"]}
    return {}


def _less(table: Table, errors: Mapping[str, tuple[float, float]]) -> dict[str, Floats]:
    """Columns less a bias and a drift a second since the first row."""
    t = np.asarray(table["t"], float)
    since = t - t[:1]
    return {
        name: np.asarray(table[name], float) - bias - rate * since
        for name, (bias, rate) in errors.items()
        if name in table and (bias or rate)
    }


def _inertial(table: Table, n: Mapping[str, float]) -> dict[str, Floats]:
    """Bias, scale and turn of the case undone, in this order."""
    turn = np.array([n[f"misalignment_{axis}"] for axis in "xyz"])
    found: dict[str, Floats] = {}
    for names in (FORCE, RATE):
        bias, scale = (np.array([n[f"{stem}_{name}"] for name in names]) for stem in ("bias", "scale"))
        if turn.any() or bias.any() or (scale != 1.0).any():
            true = (table.stack(*names) - bias) / scale @ matrix(from_vector(turn)).T
            found |= dict(zip(names, true.T, strict=True))
    return found


def _held(
    table: Table, camera: CameraSpec, n: Mapping[str, float], attitudes: tuple[Floats, Floats]
) -> Floats:
    """(N, 3, 3) body to world when each picture was taken."""
    t, quaternions = attitudes
    taken = np.asarray(table["t"], float) - n.get("clock", 0.0) - n["delay"] - camera.stamp_delay
    at = np.clip(np.searchsorted(t, taken), 0, len(t) - 1)
    return np.array([matrix(q) for q in quaternions[at]])


def _picture(table: Table, vehicle: Vehicle, held: Floats | None) -> dict[str, Floats]:
    """The mark as the camera would see it that it is taken for, and how sure that is."""
    camera, n = vehicle.cameras["down"], vehicle.sensors["pad"].numbers
    scale, focal = n["scale"], camera.focal_scale * n["focal_scale"]
    k1, axes = camera.k1_error + n["k1"], camera.mount.axes
    straight = np.allclose(axes, DOWN, atol=1e-12)
    if scale == focal == 1.0 and straight and not k1:
        return {}
    seen, found = table.stack("x", "y", "z") / scale * [1.0, 1.0, focal], {}
    if k1:
        if held is None:  # its axis points north
            headings = -np.nan_to_num(np.asarray(table["angle"], float)) if "angle" in table else np.zeros(len(seen))
            held = np.array([matrix(quaternion(0.0, 0.0, heading)) for heading in headings.tolist()])
        good = np.isfinite(seen).all(axis=1)
        straightened = seen.copy()
        for _ in range(LENS_ROUNDS):  # from where the mark is, not from where it seems to be
            position = -np.einsum("nij,nj->ni", held, straightened @ axes.T + camera.mount.position)[good]
            lens = bend(position, held[good], vehicle)
            straightened[good] = seen[good] - k1 * lens.moved[:, :3]
        seen = straightened
        if "angle" in table:
            found["angle"] = np.asarray(table["angle"], float).copy()
            found["angle"][good] -= k1 * lens.moved[:, 3]
        for axis, name in enumerate(STATED):
            if name in table:
                found[name] = np.asarray(table[name], float).copy()
                found[name][good] = np.hypot(found[name][good], k1 * lens.unsure[:, axis])
    if not straight:
        seen = seen @ axes.T @ DOWN
    return found | dict(zip(("x", "y", "z"), seen.T, strict=True))


def _with(table: Table, columns: Mapping[str, Sequence[float] | Floats]) -> Table:
    """The table with these columns in the place of its own."""
    arrow = table.arrow
    for name, values in columns.items():
        at = arrow.schema.get_field_index(name)
        field = pa.field(name, pa.float64(), metadata=arrow.schema.field(at).metadata)
        arrow = arrow.set_column(at, field, pa.array(np.asarray(values, float)))
    return Table(table.name, arrow, table.topic, table.segments)

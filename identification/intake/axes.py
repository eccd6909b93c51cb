"""Units and axes that only a vehicle tells, or the motion of a rigid body: what else sensors would have to say."""

from collections.abc import Mapping, MutableMapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flightlog.constants import GRAVITY
from flightlog.errors import UserError
from flightlog.tables import Table
from sim.vehicle import Vehicle
from sim.world import MAGNETIC_FIELD

Floats = NDArray[np.float64]
Tables = Mapping[str, Table]

HEAVY = 1.8  # times gravity, that a flight does not have on the median
UP = 0.5  # share of the force along the mast, below which axes are others
CALM = 2.0  # [rad/s] that half of all rates are below
SPEED = 0.35  # by which a rotor's speed may be off its nominal one
WITHIN = 0.12  # of a factor between units
REACH = 1.2  # of a ranger's, which none reports in one row of ten
DIP = 35.0  # [deg] by which the angle between force and field may be off
FEWEST = 10  # rows
SLOWEST = 0.04  # [s] between rows of the inertial sensor
GRID = 0.02  # [s]
SPAN = 0.5  # [s] over which the field's turning is averaged
WORST = 1e6  # condition of three rates against the field
OFF, SURE = 0.5, 5.0  # of a rate against the field's, and in standard deviations
BEYOND, OFTEN = 1.3, 0.1  # of a control's stop, in this share of the rows
STOPS = {"collective": "collective_max", "lateral": "cyclic_max", "longitudinal": "cyclic_max", "tail": "tail_max"}
CONTROLS = {"collective": 1.0, "lateral": 1.0, "longitudinal": 1.0, "tail": 1.2}  # [rad]


def check(name: str, tables: MutableMapping[str, Table], vehicle: Vehicle | None, notes: list[str]) -> None:
    """Raise UserError for a wrong unit or axis; topics that are not needed are left out instead.

    vehicle: a helicopter; None: of another kind.
    """
    if "imu" in tables:
        _force(name, tables["imu"])
    if vehicle is not None:
        _rotor(name, tables, vehicle)
        _ranger(name, tables, vehicle)
    if "imu" in tables and len(tables["imu"]) >= FEWEST:
        step = float(np.median(np.diff(tables["imu"]["t"])))
        if vehicle is not None and step > SLOWEST:
            raise UserError(
                f"{name}: imu: a row every {step:.3g} s; one every {SLOWEST:g} s or more often would be right"
            )
        if "mag" in tables and vehicle is not None:
            _dip(name, tables, notes)
        _rates(name, tables)


def _force(name: str, imu: Table) -> None:
    force = imu.stack("fx", "fy", "fz")
    force = force[np.isfinite(force).all(axis=1)]
    if not len(force):
        return
    middle = np.median(force, axis=0)
    share = middle / max(float(np.median(np.linalg.norm(force, axis=1))), 1e-9)
    if share[2] >= UP:
        size = float(np.median(np.linalg.norm(force, axis=1))) / GRAVITY
        if not 1.0 / HEAVY < size < HEAVY:
            unit = "ft/s^2" if abs(size * 0.3048 - 1.0) < WITHIN else "another unit"
            found = f"{size * GRAVITY:.3g} m/s^2 on the median"
            raise UserError(f"{name}: imu.fx, fy, fz: {found}; in flight it is near 9.8: likely {unit}")
        return
    found = ", ".join(f"{v:.1f}" for v in middle)
    said = f"{name}: imu.fx, fy, fz: on the median ({found}) m/s^2; in flight fz is near 9.8"
    if share[2] <= -UP:
        raise UserError(f'{said}: axes are likely forward, right, down: declare frames.body = "FRD" in a mapping')
    raise UserError(f"{said}: axes are likely swapped")


def sticks(name: str, tables: Tables, vehicle: Vehicle) -> None:
    """Raise UserError for controls of a helicopter in another unit."""
    table = tables.get("controls")
    if table is None:
        return
    stops = vehicle.parameters.get("servo", {})
    for column, stop in STOPS.items():
        if column not in table or stop not in stops:
            continue
        values = np.asarray(table[column], float)
        if float(np.mean(np.abs(values[np.isfinite(values)]) > BEYOND * stops[stop])) > OFTEN:
            _too_far(name, column, values, stops[stop], vehicle)
    for column, most in CONTROLS.items():
        values = np.abs(np.asarray(table[column], float)) if column in table else np.zeros(0)
        values = values[np.isfinite(values)]
        if len(values) and float(np.median(values)) > most:
            found = f"{np.median(values):.3g} rad on the median"
            raise UserError(
                f"{name}: controls.{column}: {found}; a blade is pitched by less than {most:g} rad: it is likely in deg"
            )
    throttle = np.asarray(table["throttle"], float) if "throttle" in table else np.zeros(0)
    throttle = throttle[np.isfinite(throttle)]
    if len(throttle) and float(np.median(throttle)) > 1.5:
        raise UserError(
            f"{name}: controls.throttle: {np.median(throttle):.3g} on the median; it lies in 0 .. 1: likely percent"
        )


def _too_far(name: str, column: str, values: Floats, stop: float, vehicle: Vehicle) -> None:
    most = float(np.nanpercentile(np.abs(values), 95.0))
    likely = "it is likely in deg" if most > 1.0 else "it is likely a share of full travel, or another vehicle's"
    raise UserError(
        f"{name}: controls.{column}: {most:.3g} rad and more; the stop of {vehicle.name} is at {stop:.3g} rad: {likely}"
    )


def _rotor(name: str, tables: Tables, vehicle: Vehicle) -> None:
    if "rotor" not in tables or "speed" not in tables["rotor"]:
        return
    speed = np.asarray(tables["rotor"]["speed"], float)
    speed = speed[np.isfinite(speed)]
    if not len(speed):
        return
    nominal = float(vehicle.geometry["nominal_speed"])
    ratio = float(np.median(speed)) / nominal
    said = f"{name}: rotor.speed: {np.median(speed):.4g} rad/s on the median; {vehicle.name} has {nominal:.4g}"
    for factor, unit in ((30.0 / np.pi, "rpm"), (0.5 / np.pi, "Hz")):
        if abs(ratio / factor - 1.0) < WITHIN:
            raise UserError(f"{said}: it is likely in {unit}")
    if abs(ratio - 1.0) > SPEED:
        raise UserError(f"{said}: another vehicle's log, or another unit")


def _ranger(name: str, tables: Tables, vehicle: Vehicle) -> None:
    if "sonar" not in tables or "sonar" not in vehicle.sensors:
        return
    table, reach = tables["sonar"], vehicle.sensors["sonar"].numbers["greatest_range"]
    values = np.asarray(table["range"], float)
    values = values[np.isfinite(values)]
    if not len(values):
        return
    most = float(np.percentile(values, 90.0))
    ratio = most / reach
    if ratio <= REACH:
        return
    unit = "mm" if ratio > 300.0 else "cm" if ratio > 10.0 else "ft" if ratio > 2.5 else None
    likely = f": it is likely in {unit}" if unit else ": another ranger, or another unit"
    raise UserError(f"{name}: sonar.range: reaches {most:.4g} m; the one of {vehicle.name} reaches {reach:g} m{likely}")


def _dip(name: str, tables: MutableMapping[str, Table], notes: list[str]) -> None:
    """The field's angle with the force, which in calm flight points up."""
    imu, mag = tables["imu"], tables["mag"]
    t = np.asarray(mag["t"], float)
    force = np.column_stack([np.interp(t, imu["t"], _smooth(imu, axis, SPAN)) for axis in ("fx", "fy", "fz")])
    field = mag.stack("mx", "my", "mz")
    cosine = np.sum(force * field, axis=1) / np.maximum(
        np.linalg.norm(force, axis=1) * np.linalg.norm(field, axis=1), 1e-9
    )
    cosine = cosine[np.isfinite(cosine)]
    if not len(cosine):
        return
    found = float(np.degrees(np.arccos(np.clip(np.median(cosine), -1.0, 1.0))))
    right = float(np.degrees(np.arccos(MAGNETIC_FIELD[2] / np.linalg.norm(MAGNETIC_FIELD))))
    if abs(found - right) > DIP:
        notes.append(
            f"{name}: mag: the field makes {found:.0f} deg with the mast, {right:.0f} deg are expected: other axes "
            "(FRD?) or another place on Earth; left out"
        )
        del tables["mag"]


def _smooth(table: Table, column: str, span: float) -> Floats:
    values = np.asarray(table[column], float)
    step = float(np.median(np.diff(table["t"])))
    return np.asarray(uniform_filter1d(np.nan_to_num(values), max(1, round(span / max(step, 1e-6)))))


def _rates(name: str, tables: Tables) -> None:
    """Rates that are too large for any calm flight; and against the field, which only turns as the body does."""
    imu = tables["imu"]
    rates = np.column_stack([_smooth(imu, axis, SPAN) for axis in ("wx", "wy", "wz")])
    usual = float(np.median(np.linalg.norm(rates, axis=1)))
    if usual > CALM:
        raise UserError(f"{name}: imu.wx, wy, wz: {usual:.3g} rad/s on the median; a flight that can be judged turns "
                        "slower than 2 rad/s: they are likely in deg/s")  # fmt: skip
    if "mag" not in tables:
        return
    found = against_field(tables)
    if found is None:
        return
    for axis, (value, std) in enumerate(found):
        if abs(value - 1.0) > max(OFF, SURE * std):
            here = "xyz"[axis]
            likely = "deg/s" if value < 0.05 and abs(57.3 * value - 1.0) < 0.3 else None
            how = f": it is likely in {likely}" if likely else (
                ": its sign is likely another (FRD?)" if value < -OFF else ": axes are likely swapped")  # fmt: skip
            turned = f"the magnetic field turns by {value:.2f} +- {std:.2f} of what it says"
            raise UserError(f"{name}: imu.w{here}: {turned}; 1 would be right{how}, or mag's are")


def against_field(tables: Tables) -> list[tuple[float, float]] | None:
    """How much of each rate (x, y, z) the field's turning shows, with a standard deviation; None where too little."""
    imu, mag = tables["imu"], tables["mag"]
    first, last = max(imu["t"][0], mag["t"][0]), min(imu["t"][-1], mag["t"][-1])
    if last - first < 5.0:
        return None
    grid = np.arange(first, last, GRID)
    m = np.column_stack([np.interp(grid, mag["t"], _smooth(mag, axis, 0.1)) for axis in ("mx", "my", "mz")])
    w = np.column_stack([np.interp(grid, imu["t"], _smooth(imu, axis, 0.1)) for axis in ("wx", "wy", "wz")])
    stride = max(1, round(SPAN / GRID))
    # d m = - w x m dt, each axis' part integrated over the stride
    parts = []
    for axis in range(3):
        only = np.zeros_like(w)
        only[:, axis] = w[:, axis] - np.mean(w[:, axis])
        grown = np.cumsum(-np.cross(only, m) * GRID, axis=0)
        parts.append(grown[stride:] - grown[:-stride])
    moved = m[stride:] - m[:-stride]
    moved = moved - moved.mean(axis=0)
    design = np.stack([part - part.mean(axis=0) for part in parts], axis=-1).reshape(-1, 3)
    target = moved.reshape(-1)
    information = design.T @ design
    if np.linalg.cond(information) > WORST:
        return None
    value = np.linalg.solve(information, design.T @ target)
    left = target - design @ value
    independent = max(len(left) / (3.0 * stride), 4.0)  # strides that overlap say the same
    variance = float(np.mean(left**2)) * (len(left) / independent)
    std = np.sqrt(np.diag(np.linalg.inv(information)) * variance)
    return list(zip(value.tolist(), std.tolist(), strict=True))

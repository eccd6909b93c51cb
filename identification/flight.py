"""One measured flight, prepared: the motion by its sensors, and what drives the model along it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE, pressure_at
from flightlog.constants import GRAVITY, LAPSE_RATE
from flightlog.errors import UserError
from flightlog.rotations import angles
from flightlog.tables import Table
from identification import kinematics as k
from identification import lens
from identification.barometer import lag_of, port_of, rounded, washed
from identification.beginning import SETTLED, levelled, mended, start
from identification.corrections import bent, corrected
from identification.first_look import lonely
from identification.grid import Course, Drive, lay, smooth
from identification.sensor_statistics import statistics
from identification.vibration import calm
from identification.white_noise import noise_factors
from sim.vehicle import Vehicle
from sim.world import MAGNETIC_FIELD

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STEP = 0.04  # [s] of a node: a turn of the rotor, so that its vibration has no mean
NEEDED = ("imu", "controls", "rotor")
CLEAR = 0.08  # [m] of the skids above the ground while a flight is looked at
AFTERMATH = 0.6  # [s] that a touch of the ground shakes
POINTING, STAMP = 5e-4, 2e-3  # [rad], [s]: what gyro and stamps leave open in turning from body to camera to world
PAD_FLOOR, ANGLE_FLOOR = 0.002, 1e-3  # [m], [rad] that no front end is better than
TACH_SPAN = 0.3  # [s] over which the tachometer is smoothed
REACH_MARGIN = 2.0  # [m] that GPS and barometer may both be too high


@dataclass(frozen=True, eq=False)
class Motion:
    """The recorded way of `kinematics.track` along one flight: N nodes, M scalar measurements."""

    step: float
    t: Floats  # (N,) [s] end of each node, the log's own clock
    first: Ints  # (N + 1,)
    kinds: Ints  # (M,)
    times: Floats  # (M,) [s]
    values: Floats  # (M,)
    stds: Floats  # (M,)
    decay: Floats  # (STATES,)
    way: Floats  # (N, 15)
    rows: Floats  # (M, STATES)
    gains: Floats  # (M, STATES)
    answers: Floats  # (M, 3)
    position: Floats  # (N, 3) [m]
    velocity: Floats  # (N, 3) [m/s]
    attitude: Floats  # (N, 4)

    @property
    def node(self) -> Ints:
        """(M,) node to which each measurement belongs."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @property
    def whitened(self) -> Floats:
        """(M,) innovations over their standard deviation; 0 where one was not used."""
        nu, s, weight = self.answers.T
        return np.asarray(np.sqrt(weight) * nu / s)


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight prepared for one vehicle."""

    name: str
    motion: Motion
    drive: Drive
    measured: Floats  # (N, 7): mean force, rate and rotor speed of each node; NaN where there is none, or the ground
    inertial: Floats  # (N, 6): mean force and rate, also there
    thrust: Floats  # (N,) [N] about: force along the mast times mass
    skids: Floats  # (N,) [m] of the skids above the ground
    baro_lag: float  # [s] by which the barometer was taken to follow
    baro_port: float  # pressure coefficient that its port was taken to have
    late: frozenset[str]  # topics of which some lateness was taken out
    echoes: tuple[int, int]  # samples of the ranger beyond its reach, and how many of them said they were valid
    notes: tuple[str, ...]


def prepare(name: str, tables: Mapping[str, Table], vehicle: Vehicle) -> Flight:
    """Filter a log with the vehicle's sensors as declared; UserError where the log cannot carry a diagnosis."""
    for topic in NEEDED:
        if topic not in tables or len(tables[topic]) < 2:
            raise UserError(f"{name}: has no topic {topic}: a {vehicle.document['kind']} needs {', '.join(NEEDED)}")
    notes: list[str] = []
    raw, tables = tables, corrected(tables, vehicle)
    imu_t, imu = _inertial(name, tables["imu"], notes)
    rotor = _rotor_speed(tables["rotor"], imu_t)
    imu = calm(imu_t, imu, rotor, float(vehicle.parameters.get("tail_rotor", {}).get("gear", 0.0)))
    mass = float(vehicle.geometry["mass"])
    pressure, temperature = _surface(tables)
    setup = _setup(vehicle)
    edges = _edges(imu_t)
    measurements = _measurements(tables, vehicle, imu_t, imu, edges)
    down = vehicle.cameras.get("down")
    begun = start(tables, imu, imu_t, _samples_a_turn(imu_t), None if down is None else down.mount.position)
    surface = pressure, temperature
    borne = _at_origin(imu_t, imu, vehicle.sensors["imu"].position)
    motion, samples, skids = _filter(vehicle, imu_t, borne, edges, measurements, begun, setup, mass, surface)
    if bent(vehicle):
        tables = corrected(raw, vehicle, (imu_t, samples[:, 6:]))
        measurements = _measurements(tables, vehicle, imu_t, imu, edges)
        motion, samples, skids = _filter(vehicle, imu_t, borne, edges, measurements, begun, setup, mass, surface)
    last = _airborne(skids)
    if last * STEP < 5.0:
        raise UserError(f"{name}: {last * STEP:.1f} s in the air; at least 5 s would be right")
    motion, edges = _cut(motion, last), edges[: last + 1]
    speed = tables["rotor"]
    sticks = np.nan_to_num(tables["controls"].stack("collective", "lateral", "longitudinal", "tail", "throttle"))
    course = Course(
        imu_t, samples, imu[:, 3:], rotor,
        np.asarray(tables["controls"]["t"], float), sticks,
    )  # fmt: skip
    fine, coarse = (lay(course, edges, pressure, temperature, rough, vehicle.wind[2]) for rough in (False, True))
    drive = Drive(fine, coarse, vehicle.sensors["imu"].position, pressure, temperature)
    measured = np.full((last, 7), np.nan)
    sums = np.add.reduceat(imu[: edges[-1]], edges[:-1])
    measured[:, :6] = sums / np.diff(edges)[:, None]
    measured[:, 6] = _means(np.asarray(speed["t"], float), np.asarray(speed["speed"], float), imu_t[edges])
    inertial, touched = measured[:, :6].copy(), _touched(skids[:last])
    thrust = mass * inertial[:, 2]
    if touched.any():
        measured[touched] = np.nan  # the ground's force is not the model's
        notes.append(f"on or near the ground for {touched.sum() * STEP:.1f} s: force and moment not judged there")
    return Flight(
        name, motion, drive, measured, inertial, thrust, skids[:last], lag_of(vehicle), port_of(vehicle),
        _late(vehicle), _echoes(tables, vehicle, motion), tuple(notes),
    )  # fmt: skip


def _rotor_speed(table: Table, t: Floats) -> Floats:
    """[rad/s] at the times t (S,), smoothed; a tachometer gives the mean since its sample before."""
    tach = np.asarray(table["t"], float)
    step = float(np.median(np.diff(tach)))
    turns = smooth(np.asarray(table["speed"], float), max(2, round(TACH_SPAN / step)))
    return np.interp(t, tach - 0.5 * step, turns)


def _means(t: Floats, values: Floats, marks: Floats) -> Floats:
    """Mean of the samples between each two marks; NaN where there is none."""
    which = np.digitize(t, marks) - 1
    inside = (which >= 0) & (which < len(marks) - 1) & np.isfinite(values)
    total = np.bincount(which[inside], values[inside], len(marks) - 1)
    count = np.bincount(which[inside], minlength=len(marks) - 1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _samples_a_turn(t: Floats) -> int:
    return max(1, round(STEP / float(np.median(np.diff(t)))))


def _inertial(name: str, table: Table, notes: list[str]) -> tuple[Floats, Floats]:
    t = np.asarray(table["t"], float)
    imu = table.stack("fx", "fy", "fz", "wx", "wy", "wz")
    good = np.isfinite(imu).all(axis=1) & np.concatenate([[True], np.diff(t) > 0])
    if not good.all():
        notes.append(f"imu: {np.count_nonzero(~good)} rows not finite or not in order left out")
    t, imu = t[good], imu[good]
    size = float(np.median(np.linalg.norm(imu[:, :3], axis=1))) if len(t) else math.nan
    if not 0.5 * GRAVITY < size < 2.0 * GRAVITY:
        likely = "cm/s^2" if 500 < size < 2000 else "g" if 0.5 < size < 2 else "another unit"
        raise UserError(f"{name}: imu.fx, fy, fz: typical size {size:.3g}; in m/s^2 it would be 9.8; likely {likely}")
    return t, imu


def _edges(t: Floats) -> Ints:
    """First sample of each node, and the end."""
    count = int((t[-1] - t[0]) / STEP)
    marks = t[0] + STEP * np.arange(count + 1)
    return np.asarray(np.searchsorted(t, marks - 1e-6), np.int64)


def _out_of_reach(tables: Mapping[str, Table], t: Floats, reach: float) -> NDArray[np.bool_]:
    """(N,) where every other height is so far beyond a ranger's reach that an echo must be a false one."""
    beyond = np.zeros(len(t), bool)
    known = [(tables[topic], column) for topic, column in (("gps", "u"), ("baro", "altitude")) if topic in tables]
    for i, (table, column) in enumerate(known):
        good = np.isfinite(table[column])
        if good.any():
            far = np.interp(t, table["t"][good], table[column][good]) > reach + REACH_MARGIN
            beyond = far if i == 0 else beyond & far
    return beyond


def _surface(tables: Mapping[str, Table]) -> tuple[float, float]:
    """Pressure [Pa] and temperature [K] at the ground, from what the barometer says; standard without one."""
    if "baro" not in tables or "pressure" not in tables["baro"]:
        return SURFACE_PRESSURE, SURFACE_TEMPERATURE
    rows = tables["baro"].stack("pressure", "temperature", "altitude")
    pressure, temperature, altitude = np.nanmedian(rows[:50], axis=0)
    ground = temperature - LAPSE_RATE * altitude
    return float(pressure_at(-altitude, pressure, temperature)), float(ground)


def _setup(vehicle: Vehicle) -> Floats:
    setup = np.zeros((6, 3))
    for row, topic in enumerate(("gps", "sonar", "baro")):
        if topic in vehicle.sensors:
            setup[row] = vehicle.sensors[topic].position
    if "down" in vehicle.cameras:
        setup[3] = vehicle.cameras["down"].mount.position
    if "sonar" in vehicle.sensors:
        setup[4, 0] = vehicle.sensors["sonar"].numbers["beam_half_angle"]
    return setup


def _measurements(
    tables: Mapping[str, Table], vehicle: Vehicle, imu_t: Floats, imu: Floats, edges: Ints
) -> tuple[Ints, Ints, Floats, Floats, Floats]:
    """First (N + 1,), kinds, times, values and standard deviations (M,), in order of time."""
    parts: list[tuple[int, Floats, Floats, Floats]] = []
    sensors = vehicle.sensors

    def add(kind: int, t: Floats, value: Floats, std: Floats | float) -> None:
        good = np.isfinite(value) & np.isfinite(t)
        parts.append((kind, t[good], value[good], np.broadcast_to(std, value.shape)[good]))

    if "gps" in tables and "gps" in sensors:
        table, n = tables["gps"], sensors["gps"].numbers
        valid = np.asarray(table["valid"], float) > 0 if "valid" in table else np.ones(len(table), bool)
        t = np.where(valid, table["t"], np.nan)
        for axis, name in enumerate(("e", "n", "u")):
            add(k.GPS + axis, t, np.asarray(table[name], float), n["noise_up"] if axis == 2 else n["noise"])
            add(k.GPS_V + axis, t, np.asarray(table[f"v{name}"], float), n["velocity_noise"])
    if "baro" in tables and "baro" in sensors:
        table, n = tables["baro"], sensors["baro"].numbers
        add(k.BARO, np.asarray(table["t"]) - n["lag"], np.asarray(table["altitude"], float), n["noise"])
    if "sonar" in tables and "sonar" in sensors:
        table, n = tables["sonar"], sensors["sonar"].numbers
        heard = (np.asarray(table["valid"], float) > 0) & ~_out_of_reach(tables, table["t"], n["greatest_range"])
        heard &= ~lonely(heard, np.asarray(table["range"], float))
        value = np.where(heard, table["range"], np.nan)
        std = np.hypot(n["noise_share"] * value, n["resolution"] / math.sqrt(12.0))
        add(k.SONAR, np.asarray(table["t"]), value, std)
    if "mag" in tables and "mag" in sensors:
        table, n = tables["mag"], sensors["mag"].numbers
        for axis, name in enumerate(("mx", "my", "mz")):
            add(k.FIELD + axis, np.asarray(table["t"]), np.asarray(table[name], float), n["noise"])
    if "pad" in tables and "down" in vehicle.cameras:
        table = tables["pad"]
        depth, stamp = np.nan_to_num(np.asarray(table["z"], float)), np.asarray(table["t"])
        turning = np.interp(stamp, imu_t, np.linalg.norm(imu[:, 3:5], axis=1))
        floor = np.hypot(PAD_FLOOR, depth * np.hypot(POINTING, STAMP * turning))
        aside = np.nan_to_num(np.hypot(np.asarray(table["x"], float), np.asarray(table["y"], float)))
        beside = np.hypot(PAD_FLOOR, aside * np.hypot(POINTING, STAMP * turning))
        for axis, name in enumerate(("x", "y", "z")):
            std = np.hypot(np.asarray(table[f"std_{name}"], float), floor if axis < 2 else beside)
            add(k.PAD + axis, stamp, np.asarray(table[name], float), std)
        std = np.hypot(np.asarray(table["std_angle"], float), ANGLE_FLOOR)
        add(k.PAD_ANGLE, np.asarray(table["t"]), np.asarray(table["angle"], float), std)
    kinds = np.concatenate([np.full(len(t), kind) for kind, t, _, _ in parts] or [np.zeros(0)]).astype(np.int64)
    times, values, stds = (np.concatenate([p[i] for p in parts] or [np.zeros(0)]) for i in (1, 2, 3))
    ends = imu_t[np.clip(edges[1:] - 1, 0, len(imu_t) - 1)]
    node = np.searchsorted(ends, times - 1e-9)
    inside = (node < len(ends)) & (times >= imu_t[0])
    order = np.lexsort((kinds, times, node))
    order = order[inside[order]]
    first = np.searchsorted(node[order], np.arange(len(ends) + 1))
    return np.asarray(first, np.int64), kinds[order], times[order], values[order], stds[order]


def _filter(
    vehicle: Vehicle, imu_t: Floats, imu: Floats, edges: Ints,
    measurements: tuple[Ints, Ints, Floats, Floats, Floats], begun: Floats, setup: Floats, mass: float,
    surface: tuple[float, float],
) -> tuple[Motion, Floats, Floats]:  # fmt: skip
    """Several times: what the rotor's downwash does to the barometer needs the height, and each sensor's white noise
    is taken from its own innovations.
    """
    first, kinds, times, values, stds = measurements
    nodes = len(edges) - 1
    prior, noise, decay = statistics(vehicle, STEP, float(np.median(np.diff(imu_t))))
    way, samples = np.zeros((nodes, 15)), np.zeros((len(imu_t), 10))
    rows, gains, answers = (np.zeros((len(times), n)) for n in (k.STATES, k.STATES, 3))
    shifts, unsure, picture = np.zeros((3, len(times)))
    slow = np.where(kinds >= k.PAD, stds, 0.0)
    ends = np.clip(edges[1:] - 1, 0, len(imu_t) - 1)
    skid = float(vehicle.geometry["skid_height"])
    for turn in range(4):
        last = turn == 3
        k.track(
            imu_t, imu, edges, first, kinds, times, values, np.hypot(stds, unsure), slow, shifts, begun, setup,
            MAGNETIC_FIELD, prior, noise, decay, way, samples, rows, gains, answers,
        )  # fmt: skip
        if turn == 0:
            begun = levelled(imu_t, imu, samples, begun)
            begun, prior = mended(vehicle, imu_t, samples, kinds, times, values, setup, begun, prior)
            picture = lens.unsure(vehicle, kinds, times, imu_t[ends], samples[ends])
        height = samples[ends, 2] - skid
        if not last:
            wash = washed(vehicle, kinds, times, imu_t[ends], height, mass * way[:, 2], surface)
            shifts = wash + rounded(vehicle, kinds, times, imu_t[ends], samples[ends, 2])
            # where the ground carries the vehicle, nobody knows what the rotor does
            standing = np.interp(times, imu_t[ends], _touched(height)) > 0.0
            unsure = np.where(standing, np.abs(wash), 0.0) + picture
            counts = (times >= imu_t[0] + SETTLED) & ~standing
            stds = stds * noise_factors(kinds, counts, stds, answers, measurements[4])[kinds]
    motion = Motion(
        STEP, imu_t[ends], first, kinds, times, values, stds, decay, way, rows, gains, answers,
        samples[ends, :3], samples[ends, 3:6], samples[ends, 6:],
    )  # fmt: skip
    return motion, samples, height


def _at_origin(t: Floats, imu: Floats, arm: Floats) -> Floats:
    """Inertial samples (S, 6) as at the body's origin: f - dw/dt x r - w x (w x r); arm (3,) [m] of the sensor."""
    rate, moved = imu[:, 3:], imu.copy()
    moved[:, :3] -= np.cross(np.gradient(rate, t, axis=0), arm) + np.cross(rate, np.cross(rate, arm))
    return moved


def _airborne(skids: Floats) -> int:
    """Nodes until the skids touch for good."""
    clear = np.flatnonzero(skids > CLEAR)
    return int(clear[-1]) + 1 if len(clear) else 0


def _touched(skids: Floats) -> NDArray[np.bool_]:
    """(N,) where the skids may stand on the ground, and what comes close before and after."""
    near = skids < CLEAR
    return np.asarray(uniform_filter1d(near.astype(float), 2 * round(AFTERMATH / STEP) + 1) > 1e-9)


def _cut(m: Motion, nodes: int) -> Motion:
    last = int(m.first[nodes])
    return Motion(
        m.step, m.t[:nodes], m.first[: nodes + 1], m.kinds[:last], m.times[:last], m.values[:last], m.stds[:last],
        m.decay, m.way[:nodes], m.rows[:last], m.gains[:last], m.answers[:last], m.position[:nodes],
        m.velocity[:nodes], m.attitude[:nodes],
    )  # fmt: skip


def _late(vehicle: Vehicle) -> frozenset[str]:
    """Topics whose stamps the file knows to be late."""
    late = {topic: fitted.numbers.get("delay", 0.0) for topic, fitted in vehicle.sensors.items()}
    if "pad" in late and "down" in vehicle.cameras:
        late["pad"] += vehicle.cameras["down"].stamp_delay
    return frozenset(topic for topic, delay in late.items() if delay)


def _echoes(tables: Mapping[str, Table], vehicle: Vehicle, motion: Motion) -> tuple[int, int]:
    """Samples of the ranger when the ground was well beyond its reach, and how many of them claimed an echo."""
    if "sonar" not in tables or "sonar" not in vehicle.sensors:
        return 0, 0
    table = tables["sonar"]
    t = np.asarray(table["t"], float)
    height = np.interp(t, motion.t, motion.position[:, 2])
    beyond = (height > vehicle.sensors["sonar"].numbers["greatest_range"] + 0.5) & (t <= motion.t[-1])
    return int(beyond.sum()), int((beyond & (np.asarray(table["valid"], float) > 0)).sum())


def attitude_angles(attitude: Floats) -> Floats:
    """(N, 3) roll, pitch, heading [rad]."""
    return np.array([angles(q) for q in attitude])

"""A quadrotor flown blind: a rigid body in full attitude, rotors, a battery, a pilot; written apart from the simulator.

The equations are those of a vehicle file of kind `multirotor`, and what an effect adds to them in forms of its own:
`OTHERWISE` names the numbers that no vehicle file has.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from sim.multirotor import Multirotor
from tests.blind.plans import Doublet, FlightPlan, Leg

Floats = NDArray[np.float64]
Columns = dict[str, dict[str, Floats]]

TICK = 0.002  # [s]
EVERY = 5  # ticks a row of the log
TOPPLED = 1.0  # [rad]
WARM = 3.0  # [s] that the pilot trims before the log begins
LINE = 64  # ticks of the line of commands

# of an effect, beside the numbers of a vehicle file; by default none of them does anything
OTHERWISE: Mapping[str, float] = {
    "sag_power": 0.0,  # thrust as a power of the voltage over the reference
    "sag_hold": 0.0,  # [s] for which a voltage acts before the next one does
    "second_lag": 0.0,  # [s] of a lag behind the lag
    "frame": 0.0,  # [s] between commands that are handed on
    "frames": 0.0,  # by how many of them late
    "curve": 0.0,  # power by which thrust differs from its table about the hover
    "drag_factor": 0.0,  # N at 1 m/s of a drag by a power of speed
    "drag_power": 1.5,
    "shake": 0.0,  # by how much more the inertial sensor is shaken
    "torque_kept": 0.0,  # of what thrust a damaged rotor loses, the share that its torque keeps
    "cushion": 0.0,  # share of thrust gained at the ground
    "cushion_height": 0.5,  # [m]
    "speed_lift": 0.0,  # [N s^2/m^2]
}
_AT = {name: i for i, name in enumerate(OTHERWISE)}
(_SAG_POWER, _SAG_HOLD, _SECOND_LAG, _FRAME, _FRAMES, _CURVE, _DRAG_FACTOR, _DRAG_POWER, _SHAKE, _KEPT, _CUSHION,
 _CUSHION_HEIGHT, _SPEED_LIFT) = range(len(OTHERWISE))  # fmt: skip


class Toppled(RuntimeError):
    """It fell over."""


@dataclass(frozen=True)
class Air:
    """What gusts do, standard deviations."""

    force: float = 0.12  # [m/s^2]
    moment: float = 0.5  # [rad/s^2]
    tau: float = 0.5  # [s]


@dataclass(frozen=True)
class Sensing:
    """White noise, a sample each."""

    force: float = 0.15  # [m/s^2]
    rate: float = 0.005  # [rad/s]
    place: float = 0.01  # [m]
    speed: float = 0.02  # [m/s]
    angle: float = 0.002  # [rad]
    voltage: float = 0.002  # share
    rotor: float = 0.002  # share


def fly(
    plan: FlightPlan,
    nominal: Multirotor,
    numbers: Mapping[str, float],
    otherwise: Mapping[str, float],
    rng: np.random.Generator,
    stress: bool = False,
) -> Columns:
    """The measured columns by topic; `nominal` is what the pilot knows, `numbers` and `otherwise` what flies."""
    count = nominal.rotors
    air, sensing = Air(), Sensing()
    gust = 2.0 if stress else 1.0
    other = np.array([{**OTHERWISE, **otherwise}[name] for name in OTHERWISE])
    arms, tables = _arms(nominal, numbers), _tables(nominal)
    each = _each(nominal, numbers)
    reference = numbers["terms.battery_sag.reference"]
    battery = np.array([
        numbers["terms.battery_sag.sag"], reference,
        reference * rng.uniform(1.07, 1.09), reference * rng.uniform(8e-4, 1.6e-3), reference * rng.uniform(0.04, 0.06),
    ])  # fmt: skip
    body = np.array([
        numbers["mass"], *(numbers[f"inertia.{i}"] for i in range(3)), numbers["terms.motor.tau"],
        numbers["terms.motor.delay"], numbers["terms.drag.area"], numbers["terms.drag.linear"],
        numbers["terms.yaw_trim.arm"], numbers["terms.yaw_trim.per_volt"], numbers["terms.thrust.scale"],
        numbers.get("terms.inflow.climb", 0.0), numbers.get("terms.inflow.ahead", 0.0),
    ])  # fmt: skip
    known = np.array([nominal.mass, *(nominal.numbers[f"inertia.{i}"].value for i in range(3))])
    legs = np.array([(g.at_s, g.east, g.north, g.height, g.heading, g.rate, g.speed) for g in plan.legs])
    kicks = np.array([(d.at_s, AXES.index(d.control), d.size, d.half_s) for d in plan.doublets]).reshape(-1, 4)
    ticks = round((plan.duration_s + WARM) / TICK)
    rows = _fly(
        legs, kicks, np.array(plan.start_m), tables, arms, each, body, battery, other, known, _allocation(nominal),
        np.array([gust * air.force, gust * air.moment, air.tau]), np.array([sensing.place, sensing.speed,
        sensing.angle, sensing.rate]), rng.standard_normal((ticks, 6)), rng.standard_normal((ticks, 12)),
    )  # fmt: skip
    return _columns(rows, nominal, count, sensing, 1.0 + other[_SHAKE], rng, stress)


AXES = ("collective", "lateral", "longitudinal", "tail")


def _tables(nominal: Multirotor) -> Floats:
    """(N, K, 2) command and thrust of each rotor; of one by speed, the share of its top speed."""
    if not nominal.by_speed:
        return np.array(nominal.tables)
    most = 2.5 * nominal.mass * GRAVITY / nominal.rotors
    u = np.linspace(0.0, 1.0, 21)
    return np.array([np.column_stack([u, most * u**2])] * nominal.rotors)


def _arms(nominal: Multirotor, numbers: Mapping[str, float]) -> Floats:
    """(N, 2) rotors about the centre of mass."""
    centre = [numbers[f"terms.cg_offset.{a}"] + numbers[f"terms.payload.{a}"] for a in "xy"]
    return np.asarray(nominal.positions[:, :2] - np.array(centre))


def _each(nominal: Multirotor, numbers: Mapping[str, float]) -> Floats:
    """(N, 2) thrust over that of the table, torque over thrust with its sign to the left."""
    scale = [numbers[f"rotors.{i}.thrust_scale"] for i in range(nominal.rotors)]
    torque = [-nominal.spins[i] * numbers[f"rotors.{i}.torque"] for i in range(nominal.rotors)]
    return np.column_stack([scale, torque])


def _allocation(nominal: Multirotor) -> Floats:
    """(N, 4) thrusts for force and moments, as the pilot knows the vehicle."""
    x, y = nominal.positions[:, 0], nominal.positions[:, 1]
    torque = np.array([nominal.numbers[f"rotors.{i}.torque"].value for i in range(nominal.rotors)])
    return np.asarray(np.linalg.pinv(np.array([np.ones_like(x), y, -x, -nominal.spins * torque])))


@njit(cache=True)
def _fly(  # type: ignore[no-untyped-def]
    legs, kicks, start, tables, arms, each, body, battery, other, known, allocation, air, noise, white, read
):
    n = len(arms)
    ticks = len(white)
    rows = np.zeros((ticks // EVERY, 20 + 2 * n))
    place, speed, rate, r = start.copy(), np.zeros(3), np.zeros(3), np.eye(3)
    first = math.pi / 2 - legs[0, 4]
    r[0, 0], r[0, 1], r[1, 0], r[1, 1] = math.cos(first), -math.sin(first), math.sin(first), math.cos(first)
    heading, ahead = first, start.copy()
    mass, inertia = body[0], body[1:4]
    hover = known[0] * GRAVITY / n
    line = np.full((LINE, n), np.interp(hover, tables[0, :, 1], tables[0, :, 0]))
    lag = np.full(n, hover)
    late = np.full(n, hover)
    puff, trim_a, trim_m = np.zeros(6), np.zeros(3), np.zeros(3)
    keep = math.exp(-TICK / air[2])
    fresh = math.sqrt(1.0 - keep * keep)
    lift = mass / (known[0] * body[10] * each[:, 0].mean())
    trim_a[2] = GRAVITY * (lift - 1.0)  # it is let go trimmed
    for i in range(n):
        thrust = lift * hover * each[i, 0]
        trim_m -= np.array([arms[i, 1], -arms[i, 0], each[i, 1] + body[8]]) * thrust / known[1:]
    begin = allocation @ np.array([
        known[0] * (GRAVITY + trim_a[2]), known[1] * trim_m[0], known[2] * trim_m[1], known[3] * trim_m[2]])
    for i in range(n):
        lag[i] = late[i] = min(max(begin[i], 0.0), tables[i, -1, 1])
    level, drawn, used, held = hover * n, 1.0, 0.0, battery[1]
    held_at = -1e9
    effective = np.zeros(n)
    for k in range(ticks):
        t = k * TICK - WARM
        # the pilot, by what it is told
        leg = 0
        for i in range(len(legs)):
            if legs[i, 0] <= t:
                leg = i
        turned = math.pi / 2 - legs[leg, 4] - heading
        heading += min(max(turned, -0.7 * TICK), 0.7 * TICK)
        for axis in range(3):
            most = legs[leg, 5 if axis == 2 else 6] * TICK
            ahead[axis] += min(max(legs[leg, 1 + axis] - ahead[axis], -most), most)
        told_place, told_speed = place + noise[0] * read[k, :3], speed + noise[1] * read[k, 3:6]
        told_rate = rate + noise[3] * read[k, 9:12]
        error = 1.2 * (ahead - told_place) - told_speed
        trim_a += TICK * 0.5 * error
        wish = 1.8 * error + trim_a
        for axis in range(2):
            wish[axis] = min(max(wish[axis], -2.5), 2.5)
        kick = np.zeros(4)
        for i in range(len(kicks)):
            since = t - kicks[i, 0]
            if 0.0 <= since < 2.0 * kicks[i, 3]:
                kick[int(kicks[i, 1])] += kicks[i, 2] if since < kicks[i, 3] else -kicks[i, 2]
        wish[2] += GRAVITY + kick[0]
        up = wish / math.sqrt(wish[0] ** 2 + wish[1] ** 2 + wish[2] ** 2)
        up_body = r.T @ up
        off = np.array([-up_body[1], up_body[0], 0.0]) + noise[2] * read[k, 6:9]
        yaw = math.atan2(r[1, 0], r[0, 0])
        off[2] += math.atan2(math.sin(heading - yaw), math.cos(heading - yaw))
        gain, damping = np.array([80.0, 80.0, 6.0]), np.array([16.0, 16.0, 4.0])
        trim_m += TICK * np.array([200.0, 200.0, 4.0]) * off
        twist = gain * off - damping * told_rate + trim_m + kick[1:]
        wanted = allocation @ np.array([
            known[0] * (wish @ r[:, 2]), known[1] * twist[0], known[2] * twist[1], known[3] * twist[2]])  # fmt: skip
        now = line[k % LINE]
        for i in range(n):
            now[i] = min(max(np.interp(wanted[i], tables[i, :, 1], tables[i, :, 0]), 0.0), 1.0)
        # what becomes of the commands
        back = round(body[5] / TICK)
        if other[_FRAME] > 0.0:
            period = round(other[_FRAME] / TICK)
            back = k % period + int(other[_FRAMES]) * period
        sent = line[(k - min(back, LINE - 1)) % LINE]
        if k < LINE:
            sent = now
        total, moment = 0.0, np.zeros(3)
        volts = battery[2] - battery[3] * used - battery[4] * drawn
        if t - held_at >= other[_SAG_HOLD]:
            held, held_at = volts, t
        low = held - battery[1]
        sagged = (1.0 + battery[0] * low) * (max(held, 0.1) / battery[1]) ** other[_SAG_POWER]
        height = max(place[2], 0.0)
        drift = r.T @ speed
        for i in range(n):
            wants = np.interp(sent[i], tables[i, :, 0], tables[i, :, 1])
            lag[i] += (wants - lag[i]) * (1.0 - math.exp(-TICK / body[4]) if body[4] > 0.0 else 1.0)
            late[i] += (lag[i] - late[i]) * (
                1.0 - math.exp(-TICK / other[_SECOND_LAG]) if other[_SECOND_LAG] > 0.0 else 1.0
            )
            thrust = late[i] * (late[i] / hover + 1e-9) ** other[_CURVE] * body[10] * sagged
            thrust *= max(1.0 - body[11] * drift[2], 0.0)
            torque = each[i, 1] * thrust * (each[i, 0] + other[_KEPT] * (1.0 - each[i, 0]))
            thrust *= each[i, 0]
            thrust *= 1.0 + other[_CUSHION] * math.exp(-height / other[_CUSHION_HEIGHT])
            effective[i] = late[i]
            total += thrust
            moment[0] += (arms[i, 1] + body[12] * drift[1]) * thrust
            moment[1] -= (arms[i, 0] + body[12] * drift[0]) * thrust
            moment[2] += torque
        moment[2] += (body[8] + body[9] * (volts - battery[1])) * total
        drawn += (TICK / 0.05) * ((max(total, 0.0) / level) ** 1.5 - drawn)
        used += TICK * drawn
        # the body
        along = r.T @ speed
        fast = math.sqrt(along[0] ** 2 + along[1] ** 2 + along[2] ** 2)
        resist = 0.5 * 1.225 * body[6] * fast + body[7]
        if other[_DRAG_FACTOR] > 0.0 and fast > 1e-6:
            resist += other[_DRAG_FACTOR] * fast ** (other[_DRAG_POWER] - 1.0)
        for i in range(6):
            puff[i] = keep * puff[i] + fresh * white[k, i] * (air[0] if i < 3 else air[1])
        force = puff[:3] - resist / mass * along
        force[2] += (total + other[_SPEED_LIFT] * (along[0] ** 2 + along[1] ** 2)) / mass
        spin = inertia * rate
        turn = puff[3:] + (moment - np.array([
            rate[1] * spin[2] - rate[2] * spin[1], rate[2] * spin[0] - rate[0] * spin[2],
            rate[0] * spin[1] - rate[1] * spin[0]])) / inertia  # fmt: skip
        acceleration = r @ force
        acceleration[2] -= GRAVITY
        if k % EVERY == 0:
            row = rows[k // EVERY]
            row[0], row[1:4], row[4:7] = t, force, rate
            row[7:10], row[10:13], row[13:16] = place, speed, acceleration
            row[16] = math.atan2(r[2, 1], r[2, 2])  # right side down
            row[17] = math.asin(min(max(r[2, 0], -1.0), 1.0))  # nose up
            row[18], row[19] = yaw, volts
            for i in range(n):
                row[20 + i], row[20 + n + i] = now[i], effective[i]
        rate = rate + TICK * turn
        speed = speed + TICK * acceleration
        place = place + TICK * speed
        angle = TICK * math.sqrt(rate[0] ** 2 + rate[1] ** 2 + rate[2] ** 2)
        if angle > 1e-12:
            axis = rate * (TICK / angle)
            cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
            r = r @ (np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross))
    return rows


def _columns(
    rows: Floats, nominal: Multirotor, n: int, sensing: Sensing, shake: float, rng: np.random.Generator, stress: bool
) -> Columns:
    rows = rows[rows[:, 0] > -0.5 * TICK]
    if not np.isfinite(rows).all() or np.abs(rows[:, 16:18]).max() > TOPPLED:
        raise Toppled("the flight came to nothing")
    t, many = rows[:, 0].copy(), len(rows)
    rough = 2.0 if stress else 1.0

    def noisy(values: Floats, std: float) -> Floats:
        found = values + rough * std * rng.standard_normal(values.shape)
        if stress:  # a fiftieth are outliers
            found = found + (rng.random(many) < 0.02) * 10.0 * std * rng.standard_normal(many)
        return np.asarray(found)

    heading = np.mod(np.pi / 2 - rows[:, 18], 2.0 * np.pi)
    imu = {name: noisy(rows[:, 1 + i], shake * (sensing.force if i < 3 else sensing.rate))
           for i, name in enumerate(("fx", "fy", "fz", "wx", "wy", "wz"))}  # fmt: skip
    estimate: dict[str, Floats] = {"t": t}
    for i, name in enumerate(("e", "n", "u", "ve", "vn", "vu")):
        estimate[name] = noisy(rows[:, 7 + i], sensing.place if i < 3 else sensing.speed)
    for name, angle in (("roll", rows[:, 16]), ("pitch", rows[:, 17]), ("heading", heading)):
        estimate[name] = noisy(angle, sensing.angle)
    estimate["heading"] = np.mod(estimate["heading"], 2.0 * np.pi)
    voltage = rows[:, 19] * (1.0 + sensing.voltage * rng.standard_normal(many))
    found: Columns = {"imu": {"t": t, **imu}, "estimate": estimate, "battery": {"t": t, "voltage": voltage}}
    if nominal.by_speed:
        speeds = np.sqrt(rows[:, 20 + n :] / nominal.coefficients)
        speeds *= 1.0 + sensing.rotor * rng.standard_normal(speeds.shape)
        found["rotor"] = {"t": t, **{f"speed{i + 1}": speeds[:, i] for i in range(n)}}
        found["reference"] = estimate
        del found["estimate"]
    else:
        found["controls"] = {"t": t, **{f"m{i + 1}": rows[:, 20 + i] for i in range(n)}}
    return found


def _size(nominal: Multirotor) -> float:
    """How large its world is: 1 for one that fits a hand, 4 for one that does not."""
    return 1.0 if float(np.abs(nominal.positions).max()) < 0.1 else 4.0


def ladder(rng: np.random.Generator, duration_s: float, size: float) -> FlightPlan:
    """Hovers at several heights."""
    heights = size * rng.permutation([0.35, 0.6, 0.9, 1.3, 0.5]) * rng.uniform(0.9, 1.1, 5)
    heading = float(rng.uniform(0.0, 2.0 * math.pi))
    legs = [Leg(duration_s * i / 5, 0.0, 0.0, float(h), heading, 0.3 * size) for i, h in enumerate(heights)]
    return FlightPlan("ladder", duration_s, (0.0, 0.0, float(heights[0])), tuple(legs))


def box(rng: np.random.Generator, duration_s: float, size: float) -> FlightPlan:
    """A square, flown fast."""
    side, height, first = size * rng.uniform(0.8, 1.3), size * rng.uniform(0.6, 1.0), rng.uniform(0.0, 2.0 * math.pi)
    legs = []
    for i in range(8):
        x, y = [(0, 0), (1, 0), (1, 1), (0, 1)][i % 4]
        east = side * (x * math.cos(first) - y * math.sin(first))
        north = side * (x * math.sin(first) + y * math.cos(first))
        legs.append(Leg(duration_s * i / 8, east, north, height, first, 0.3 * size, 0.6 * size))
    return FlightPlan("box", duration_s, (0.0, 0.0, height), tuple(legs))


def doublets(rng: np.random.Generator, duration_s: float, size: float) -> FlightPlan:
    """Kicks to thrust and the three moments."""
    height = size * rng.uniform(0.7, 1.1)
    legs = (Leg(0.0, 0.0, 0.0, height, float(rng.uniform(0.0, 2.0 * math.pi))),)
    train = []
    for k, at in enumerate(np.arange(1.0, duration_s - 2.0, 1.6)):
        axis = AXES[k % 4]
        most = {"collective": 2.0, "tail": 4.0}.get(axis, 12.0)
        train.append(Doublet(float(at), axis, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.0) * most),
                             float(rng.uniform(0.15, 0.3))))  # fmt: skip
    return FlightPlan("doublets", duration_s, (0.0, 0.0, height), legs, tuple(train))


def turn(rng: np.random.Generator, duration_s: float, size: float) -> FlightPlan:
    """Full turns in hover."""
    height, first, sense = size * rng.uniform(0.6, 1.0), rng.uniform(0.0, 2.0 * math.pi), float(rng.choice([-1.0, 1.0]))
    legs = [Leg(duration_s * i / 8, 0.0, 0.0, height, first + sense * 0.5 * math.pi * i) for i in range(8)]
    return FlightPlan("turn", duration_s, (0.0, 0.0, height), tuple(legs))


def landing(rng: np.random.Generator, duration_s: float, size: float) -> FlightPlan:
    """From above down to a hand's breadth over the ground."""
    top, low = size * rng.uniform(0.9, 1.3), 0.25 * size
    legs = [Leg(0.0, 0.2 * size, 0.0, top), Leg(0.2 * duration_s, 0.0, 0.0, 0.6 * top, rate=0.12 * size),
            Leg(0.5 * duration_s, 0.0, 0.0, low, rate=0.08 * size)]  # fmt: skip
    return FlightPlan("landing", duration_s, (0.2 * size, 0.0, top), tuple(legs))


_PLANS: Mapping[str, Any] = {plan.__name__: plan for plan in (ladder, box, doublets, turn, landing)}
NAMES = tuple(_PLANS)


def plan_of(name: str, nominal: Multirotor, rng: np.random.Generator, duration_s: float) -> FlightPlan:
    """A plan drawn for a vehicle of this size."""
    plan: FlightPlan = _PLANS[name](rng, duration_s, _size(nominal))
    return plan

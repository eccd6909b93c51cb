"""A plain flight of a multirotor: a rigid body, its rotors with lag, a battery, and a pilot of nested loops.

For tests and rehearsals: no ground but the height 0 that it starts above, no wind but a gust of forces and moments.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from sim.multirotor.file import Multirotor
from sim.multirotor.model import Inputs, answer

Floats = NDArray[np.float64]

STEP = 0.005  # [s]
WARM = 3.0  # [s] that the pilot trims before the log begins


@dataclass(frozen=True)
class Battery:
    """Voltage under load: what is left of the charge less what the current drops."""

    full: float = 4.0  # [V]
    fall: float = 0.01  # [V/s] in hover
    drop: float = 0.4  # [V] in hover


@dataclass(frozen=True)
class Noise:
    """Standard deviations, a sample each."""

    force: float = 0.15  # [m/s^2] of the inertial sensor
    rate: float = 0.005  # [rad/s]
    gust_force: float = 0.15  # [m/s^2]
    gust_moment: float = 1.0  # [rad/s^2]
    gust_tau: float = 0.5  # [s]


def fly(
    craft: Multirotor,
    rng: np.random.Generator,
    duration: float = 30.0,
    truth: Mapping[str, float] | None = None,
    battery: Battery | None = None,
    noise: Noise | None = None,
    thrust: Callable[[float, Floats], Floats] | None = None,
) -> dict[str, dict[str, Floats]]:
    """Fly a hover with small doublets; the measured columns by topic (imu, controls, battery, estimate).

    Args:
        craft: what flies, and what its pilot knows.
        rng: draws noise and gusts.
        duration: [s].
        truth: numbers by key that differ from those of the file.
        battery: how the voltage goes.
        noise: of sensors and air.
        thrust: (t, commands) -> commands as they act, for effects that the model does not have.
    """
    battery, noise = battery or Battery(), noise or Noise()
    numbers = craft.values(truth)
    count = round((duration + WARM) / STEP)
    mix = _mixer(craft)
    level = _hover(craft)
    keep = np.exp(-STEP / max(numbers["terms.motor.tau"], 1e-3))
    lagged = dict(numbers) | {"terms.motor.tau": 0.0, "terms.motor.delay": 0.0}
    late = np.full((count, craft.rotors), level)
    angle, rate, place, speed = np.zeros(3), np.zeros(3), np.array([0.0, 0.0, 1.0]), np.zeros(3)
    start = Inputs(STEP, np.full((1, craft.rotors), level), np.array([battery.full - battery.drop]), np.zeros((1, 3)))
    trim = np.array([GRAVITY, 0.0, 0.0, 0.0]) - answer(craft, lagged, start)[0, 2:]  # it has flown before
    acting, gust = np.full(craft.rotors, level), np.zeros(6)
    white = np.sqrt(1.0 - np.exp(-2.0 * STEP / noise.gust_tau))
    scale = np.array([noise.gust_force] * 3 + [noise.gust_moment] * 3)
    rows = np.zeros((count, 6 + craft.rotors + 1 + 12))
    shift = round(numbers["terms.motor.delay"] / STEP)
    for k in range(count):
        t = k * STEP
        goal = 0.15 * np.sign(np.sin(2.0 * np.pi * t / 6.0)) * np.array([1.0, 1.0, 0.5]) + [0.0, 0.0, 1.0]
        wish = 1.5 * (goal - place) - 2.0 * speed
        lean = np.array([-wish[1], wish[0], 0.0]) / GRAVITY  # about x and y, small angles
        error = np.concatenate([[wish[2]], 70.0 * (lean - angle) - 15.0 * rate])
        trim += STEP * error * np.array([0.5, 0.8, 0.8, 0.8])
        command = np.clip(level + mix @ (error + trim), 0.0, 1.0)
        late[k] = command
        sent = late[max(k - shift, 0)]
        acting = keep * acting + (1.0 - keep) * (sent if thrust is None else thrust(t, sent))
        volts = battery.full - battery.fall * t - battery.drop * float(np.mean(sent)) / level
        turn = np.array([speed[0], speed[1], speed[2]])
        out = answer(craft, lagged, Inputs(STEP, acting[None], np.array([volts]), turn[None]))[0]
        gust = np.exp(-STEP / noise.gust_tau) * gust + white * scale * rng.standard_normal(6)
        force, moment = out[:3] + gust[:3], out[3:] + gust[3:]
        acceleration = np.array([force[0] + force[2] * angle[1], force[1] - force[2] * angle[0], force[2] - GRAVITY])
        rows[k] = np.concatenate([force, rate, command, [volts], place, speed, angle, acceleration])
        rate = rate + STEP * moment
        angle = angle + STEP * rate
        speed = speed + STEP * acceleration
        place = place + STEP * speed
    return _tables(rows[round(WARM / STEP) :], craft.rotors, noise, rng)


def _tables(rows: Floats, rotors: int, noise: Noise, rng: np.random.Generator) -> dict[str, dict[str, Floats]]:
    t = STEP * np.arange(len(rows))
    shaken = rows[:, :6] + rng.standard_normal((len(rows), 6)) * ([noise.force] * 3 + [noise.rate] * 3)
    state = rows[:, 7 + rotors :]
    names = ("e", "n", "u", "ve", "vn", "vu", "roll", "pitch", "heading", "ae", "an", "au")
    signs = np.array([1.0] * 7 + [-1.0, -1.0] + [1.0] * 3)
    zero = np.array([0.0] * 8 + [np.pi / 2] + [0.0] * 3)
    return {
        "imu": {"t": t, **dict(zip(("fx", "fy", "fz", "wx", "wy", "wz"), shaken.T, strict=True))},
        "controls": {"t": t, **{f"m{i + 1}": rows[:, 6 + i] for i in range(rotors)}},
        "battery": {"t": t, "voltage": rows[:, 6 + rotors] + 0.002 * rng.standard_normal(len(rows))},
        "estimate": {"t": t, **{n: c for n, c in zip(names, (zero + signs * state).T, strict=True)}},
    }


def _hover(craft: Multirotor) -> float:
    """The command at which the rotors carry the weight."""
    grid = np.linspace(0.05, 0.95, 181)
    still = np.zeros((len(grid), 3))
    steady = craft.values({"terms.motor.tau": 0.0, "terms.motor.delay": 0.0})
    volts = np.full(len(grid), steady["terms.battery_sag.reference"])
    lift = answer(craft, steady, Inputs(STEP, np.repeat(grid[:, None], craft.rotors, axis=1), volts, still))[:, 2]
    return float(np.interp(GRAVITY, lift, grid))


def _mixer(craft: Multirotor) -> Floats:
    """(N, 4) commands for an acceleration up and three angular accelerations."""
    level = _hover(craft)
    steady = craft.values({"terms.motor.tau": 0.0, "terms.motor.delay": 0.0})
    volts, still = np.full(2, steady["terms.battery_sag.reference"]), np.zeros((2, 3))
    columns = []
    for i in range(craft.rotors):
        commands = np.full((2, craft.rotors), level)
        commands[1, i] += 0.01
        out = answer(craft, steady, Inputs(STEP, commands, volts, still))
        columns.append((out[1, 2:] - out[0, 2:]) / 0.01)
    return np.asarray(np.linalg.pinv(np.column_stack(columns)))

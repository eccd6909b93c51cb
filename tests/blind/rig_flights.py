"""A pan and tilt head moved blind: Lagrange's equations of a fork and a cradle, written apart from the simulator.

    J(q) = Js + Ix sin^2 q + Iz cos^2 q + m a^2,  a = c cos q - h sin q
    J p'' + J'(q) p' q' = torque about the fork
    (Iy + m (c^2 + h^2)) q'' - J'(q)/2 p'^2 + m g a = torque about the hinge

p: pan; q: tilt, nose up; c, h: the cradle's centre of mass forward of the hinge and above it. Dry friction takes what
it takes to stop a joint and no more than it has.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from sim.rig import Rig

Floats = NDArray[np.float64]
Columns = dict[str, dict[str, Floats]]

TICK = 0.0005  # [s]
EVERY = 20  # ticks a row of the log
HELD = 40  # ticks for which an input stands
SHAKEN = 0.01  # of the usual torque: what the air and the bearings do, which remember for a second

# of an effect, beside the numbers of a vehicle file, by joint or input; by default none of them does anything
OTHERWISE: Mapping[str, float] = {
    "extra_stiction": 0.0,  # [N m] Stribeck: at rest, beside the file's own
    "extra_speed": 0.1,  # [rad/s] over which it is lost
    "second_lag": 0.0,  # [s] behind the lag
    "soft": 0.0,  # [input] below which an input fades smoothly
    "expo": 0.0,  # share of an input that goes by its square
    "cubic": 0.0,  # [N m/rad^3] of a cable
    "cogging": 0.0,  # [N m] of poles
    "poles": 7.0,
    "churning": 0.0,  # [N m s^2/rad^2]
}


@dataclass(frozen=True)
class Course:
    """What goes in: a value of every input for each HELD ticks."""

    name: str
    values: Floats  # (M, I)


def fly(
    course: Course,
    rig: Rig,
    numbers: Mapping[str, float],
    otherwise: Mapping[str, float],
    rng: np.random.Generator,
    stress: bool = False,
) -> Columns:
    """The measured columns by topic; `otherwise`: `<joint or input>.<name>` of OTHERWISE."""
    ticks = len(course.values) * HELD
    fork, cradle = (rig.model.body(i).name for i in (1, 2))
    pan, tilt = rig.joints

    def given(owner: str, name: str) -> float:
        return otherwise.get(f"{owner}.{name}", OTHERWISE[name])

    def of(key: str, otherwise_value: float) -> float:
        return numbers.get(key, otherwise_value)

    model = rig.model
    body = np.array([
        of(f"bodies.{fork}.inertia.2", model.body(1).inertia[2]), of(f"bodies.{cradle}.mass", model.body(2).mass[0]),
        of(f"bodies.{cradle}.centre.0", model.body(2).ipos[0]), of(f"bodies.{cradle}.centre.2", model.body(2).ipos[2]),
        *(of(f"bodies.{cradle}.inertia.{i}", model.body(2).inertia[i]) for i in range(3)),
    ])  # fmt: skip
    gains = np.array([[of(f"inputs.{i}.torque.{j}", 0.0) for i in rig.inputs] for j in rig.joints])
    inputs = np.array([
        [numbers[f"terms.actuator_lag.{i}.tau"], numbers[f"terms.actuator_lag.{i}.delay"], given(i, "second_lag"),
         numbers[f"terms.input_nonlinearity.{i}.deadband"], numbers[f"terms.input_nonlinearity.{i}.exponent"],
         given(i, "soft"), given(i, "expo")] for i in rig.inputs
    ])  # fmt: skip
    joints = np.array([
        [*(numbers[f"terms.joint_friction.{j}.{n}"] for n in ("viscous", "coulomb", "stiction", "speed")),
         *(numbers[f"terms.joint_stiffness.{j}.{n}"] for n in ("stiffness", "cubic", "centre")),
         *(given(j, n) for n in ("extra_stiction", "extra_speed", "cubic", "cogging", "poles", "churning"))]
        for j in (pan, tilt)
    ])  # fmt: skip
    usual = np.abs(course.values @ gains.T).mean(axis=0) * (2.0 if stress else 1.0)
    states = _run(
        np.repeat(course.values, HELD, axis=0), body, gains, inputs, joints, SHAKEN * usual,
        rng.standard_normal((ticks, 2)),
    )  # fmt: skip
    if not np.isfinite(states).all():
        raise RuntimeError("the run came to nothing")
    t = TICK * EVERY * np.arange(len(states))
    noise = np.array([rig.noise[j] for j in rig.joints]) * (2.0 if stress else 1.0)
    angles = states[:, :2] + noise * rng.standard_normal((len(t), 2))
    if stress:  # a fiftieth are outliers
        angles += (rng.random(angles.shape) < 0.02) * 10.0 * noise * rng.standard_normal(angles.shape)
    sent = TICK * HELD * np.arange(len(course.values))
    return {
        "joints": {"t": t, **{j: angles[:, i] for i, j in enumerate(rig.joints)}},
        "controls": {"t": sent, **{name: course.values[:, i] for i, name in enumerate(rig.inputs)}},
    }


@njit(cache=True)
def _run(sent, body, gains, inputs, joints, shaken, white):  # type: ignore[no-untyped-def]
    ticks, count = sent.shape
    states = np.zeros((ticks // EVERY, 4))
    lag, late = sent[0].copy(), sent[0].copy()
    puff = np.zeros(2)
    keep = math.exp(-TICK)
    fresh = math.sqrt(1.0 - keep * keep)
    inner, mass, c, h, ix, iy, iz = body
    # at rest where the cradle's weight hangs still
    angle, rate = np.zeros(2), np.zeros(2)
    angle[1] = math.atan2(-c, -h) if c != 0.0 or h != 0.0 else 0.0
    torque, free, inertia = np.zeros(2), np.zeros(2), np.zeros(2)
    for k in range(ticks):
        if k % EVERY == 0:
            states[k // EVERY, :2], states[k // EVERY, 2:] = angle, rate
        torque[:] = 0.0
        for i in range(count):
            tau, delay, second, dead, power, soft, expo = inputs[i]
            u = sent[max(k - round(delay / TICK), 0), i]
            before = late[i]
            lag[i] += (u - lag[i]) * (1.0 - math.exp(-TICK / tau) if tau > 0.0 else 1.0)
            late[i] += (lag[i] - late[i]) * (1.0 - math.exp(-TICK / second) if second > 0.0 else 1.0)
            acts = 0.5 * (before + late[i])
            size = max(abs(acts) - dead, 0.0) ** power
            if soft > 0.0:
                size *= size * size / (size * size + soft * soft)
            size = size * (1.0 - expo) + expo * size * size
            for j in range(2):
                torque[j] += gains[j, i] * (size if acts > 0.0 else -size)
        s, z = math.sin(angle[1]), math.cos(angle[1])
        arm = c * z - h * s
        inertia[0] = inner + ix * s * s + iz * z * z + mass * arm * arm
        inertia[1] = iy + mass * (c * c + h * h)
        bend = 2.0 * (ix - iz) * s * z + 2.0 * mass * arm * (-c * s - h * z)
        torque[0] -= bend * rate[0] * rate[1]
        torque[1] += 0.5 * bend * rate[0] * rate[0] - mass * GRAVITY * arm
        for j in range(2):
            viscous, dry, stuck, over, spring, cube, centre, more, more_over, cable, cog, poles, churn = joints[j]
            puff[j] = keep * puff[j] + fresh * shaken[j] * white[k, j]
            off = angle[j] - centre
            torque[j] += puff[j] - viscous * rate[j] - churn * abs(rate[j]) * rate[j] - spring * off
            torque[j] += cog * math.sin(poles * angle[j]) - (cube + cable) * off * off * off
            free[j] = rate[j] + TICK * torque[j] / inertia[j]
            grip = dry + stuck * math.exp(-((rate[j] / over) ** 2)) + more * math.exp(-abs(rate[j]) / more_over)
            most = TICK * grip / inertia[j]
            before = rate[j]
            rate[j] = free[j] - min(max(free[j], -most), most)
            angle[j] += 0.5 * TICK * (before + rate[j])
    return states


def staircase(rng: np.random.Generator, duration_s: float, size: Floats) -> Floats:
    """Steps of every input, held for some seconds."""
    return _steps(rng, duration_s, size, 1.5, 3.0)


def box(rng: np.random.Generator, duration_s: float, size: Floats) -> Floats:
    """One input after the other, there and back."""
    rows = round(duration_s / (TICK * HELD))
    t = TICK * HELD * np.arange(rows)
    period = rng.uniform(5.0, 8.0)
    phase = (t / period) % 1.0
    first = np.where(phase < 0.25, 1.0, np.where((phase >= 0.5) & (phase < 0.75), -1.0, 0.0))
    second = np.where((phase >= 0.25) & (phase < 0.5), 1.0, np.where(phase >= 0.75, -1.0, 0.0))
    return np.asarray(np.column_stack([first, second]) * size * rng.uniform(0.7, 1.0, 2))


def doublets(rng: np.random.Generator, duration_s: float, size: Floats) -> Floats:
    """Doublets of both inputs, sizes and lengths drawn, with rests between."""
    rows = round(duration_s / (TICK * HELD))
    found = np.zeros((rows, 2))
    for i in range(2):
        at = rng.uniform(0.5, 1.5)
        while at < duration_s - 2.0:
            half, high = rng.uniform(0.2, 0.8), rng.choice([-1.0, 1.0]) * rng.uniform(0.4, 1.0) * size[i]
            a, b, c = (round(s / (TICK * HELD)) for s in (at, at + half, at + 2.0 * half))
            found[a:b, i], found[b:c, i] = high, -high
            at += 2.0 * half + rng.uniform(0.5, 1.5)
    return found


def sweep(rng: np.random.Generator, duration_s: float, size: Floats) -> Floats:
    """Sines that grow faster."""
    rows = round(duration_s / (TICK * HELD))
    t = TICK * HELD * np.arange(rows)
    found = np.zeros((rows, 2))
    for i in range(2):
        low, high = rng.uniform(0.1, 0.2), rng.uniform(1.0, 2.0)
        phase = low * t + 0.5 * (high - low) * t**2 / duration_s
        found[:, i] = size[i] * rng.uniform(0.7, 1.0) * np.sin(2.0 * np.pi * phase + rng.uniform(0.0, 6.28))
    return found


def _steps(rng: np.random.Generator, duration_s: float, size: Floats, short: float, long: float) -> Floats:
    rows = round(duration_s / (TICK * HELD))
    found = np.zeros((rows, 2))
    for i in range(2):
        at = 0.0
        while at < duration_s:
            a = round(at / (TICK * HELD))
            found[a:, i] = size[i] * rng.uniform(-1.0, 1.0)
            at += rng.uniform(short, long)
    return found


_PLANS: Mapping[str, Any] = {plan.__name__: plan for plan in (staircase, box, doublets, sweep)}
NAMES = tuple(_PLANS)
SIZE = (1.0, 1.5)  # [V] of the inputs, as drawn


def plan_of(name: str, rng: np.random.Generator, duration_s: float) -> Course:
    """A course of the inputs."""
    return Course(name, _PLANS[name](rng, duration_s, rng.uniform(*SIZE, 2)))

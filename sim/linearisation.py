"""Trim of a model, and its linear form about that trim.

The plant that the gain design gets: rigid body, rotor and actuators, continuous in time, the servos' pure delay kept
apart. The rotation of the earth, contact and the burning of fuel are left out.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE, density_at
from flightlog.constants import GRAVITY
from flightlog.rotations import matrix, quaternion
from flightlog.signals import Controls
from sim.pipeline import Pipeline
from sim.terms.contract import SIGNALS

Floats = NDArray[np.float64]

_TICK = 0.002  # [s] while coming to rest
_REST = 1500  # ticks: more than twenty of the slowest time constant, 0.13 s of the flybar
_INSTANT = 1e-6  # [s] over which a derivative is taken
FORCE_TOLERANCE = 1e-6  # [N]

# The slow parts of the model that a linear plant keeps; the others (delay lines, burnt fuel) stay as they are.
LAGS = (
    "engine.speed",  # [rad/s]
    "engine.throttle",  # [1]
    "main_rotor.inflow",  # [m/s]
    "flapping.back",  # [rad]
    "flapping.right",  # [rad]
    "servo.collective",  # [rad]
    "servo.lateral",  # [rad]
    "servo.longitudinal",  # [rad]
    "servo.tail",  # [rad]
    "servo.throttle",  # [1]
)
BODY = ("roll", "pitch", "heading", "wx", "wy", "wz", "vx", "vy", "vz")


@dataclass(frozen=True, eq=False)
class Trim:
    """A steady flight."""

    controls: Controls  # as sent [rad], [0..1]
    roll: float  # [rad]
    pitch: float  # [rad]
    heading: float  # [rad]
    velocity: Floats  # (3,) [m/s] ENU over the ground
    wind: Floats  # (3,) [m/s] ENU, where the air moves to
    inertia: Floats  # (3,) [kg m^2] principal, body axes
    signals: np.void  # all that runs through the pipeline, at rest
    state: Floats  # of the pipeline, at rest


@dataclass(frozen=True, eq=False)
class LinearModel:
    """d(dx)/dt = A dx + B du about a trim, dx and du being differences from it.

    States, in this order: roll, pitch, heading [rad]; wx, wy, wz [rad/s] about body x forward, y left, z up; vx, vy,
    vz [m/s] over the ground in body axes; then those of LAGS that the model has, by `term.state`. Inputs: the controls
    as sent [rad], throttle [0..1], already late by `delay`.
    """

    A: Floats  # (n, n)
    B: Floats  # (n, 5)
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    delay: Floats  # (5,) [s] pure delay of each input, not in A and B

    def indices(self, *names: str) -> list[int]:
        """Where these states stand; ValueError for a name that the model does not have."""
        return [self.state_names.index(name) for name in names]


def trim(
    pipeline: Pipeline,
    inertia: ArrayLike,
    *,
    velocity: ArrayLike = (0.0, 0.0, 0.0),
    wind: ArrayLike = (0.0, 0.0, 0.0),
    height: float = 10.0,
    heading: float = 0.0,
    surface_pressure: float = SURFACE_PRESSURE,
    surface_temperature: float = SURFACE_TEMPERATURE,
    rotor_speed: float | None = None,
) -> Trim:
    """Controls, roll and pitch that hold a velocity over the ground with the rotor at its nominal speed.

    inertia (3,) [kg m^2]; velocity, wind (3,) [m/s] ENU; height [m] of the body origin above the ground; heading
    [rad]; surface pressure [Pa] and temperature [K]. The pipeline is left as it was. ValueError where there is no such
    flight.
    """
    moving, air = np.array(velocity, dtype=float), np.array(wind, dtype=float)
    speed = float(pipeline.geometry["nominal_speed"]) if rotor_speed is None else rotor_speed
    s = pipeline.signals()
    s["height"] = height
    s["density"] = density_at(height, surface_pressure, surface_temperature)
    s["rotor_speed"] = speed
    start, numbers = pipeline.state.copy(), pipeline.parameters.copy()
    has_engine = pipeline.state_index("engine.speed") >= 0
    unknowns = 7 if has_engine else 6  # without an engine there is neither throttle nor rotor acceleration

    def come_to_rest(unknown: Floats, share: float = 1.0) -> Floats:
        """What is left of forces, moments and rotor acceleration at that share of the airspeed."""
        collective, lateral, longitudinal, tail, roll, pitch = unknown[:6]
        throttle = unknown[6] if has_engine else 0.0
        r = matrix(quaternion(roll, pitch, heading))
        s["velocity"], s["up"] = r.T @ (share * (moving - air)), r[2]
        s["collective"], s["lateral"], s["longitudinal"], s["tail"] = collective, lateral, longitudinal, tail
        s["throttle"] = throttle
        pipeline.state[:] = start
        pipeline.settle(s, _TICK, _REST, speed)
        residual = np.concatenate([s["force"] - s["mass"] * GRAVITY * s["up"], s["moment"], [s["rotor_acceleration"]]])
        return residual[:unknowns]

    guess = np.array([0.08, 0.0, 0.0, 0.0, 0.05, 0.0, 0.3])[:unknowns]
    try:
        if "fuel" in {term.name for term in pipeline.terms}:
            pipeline.set_parameter("fuel", "rate", 0.0)  # nothing steady about a falling mass
        found = root(come_to_rest, guess, method="hybr", tol=1e-12)
        residual = come_to_rest(found.x)
        if not np.all(np.abs(residual) < FORCE_TOLERANCE):  # far from hover the guess leads astray: fly there slowly
            for share in np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(moving - air))):
                found = root(come_to_rest, guess, args=(share,), method="hybr", tol=1e-12)
                residual, guess = come_to_rest(found.x, share), found.x
                if not np.all(np.abs(residual) < FORCE_TOLERANCE):
                    residual = come_to_rest(found.x)
                    break
        state = pipeline.state.copy()
    finally:
        pipeline.state[:] = start
        pipeline.parameters[:] = numbers
    if not np.all(np.abs(residual) < FORCE_TOLERANCE):
        raise ValueError(
            f"no trim at {np.hypot(*(moving - air)[:2]):.1f} m/s airspeed: within the controls' limits there remain "
            f"{np.abs(residual[:3]).max():.2g} N, {np.abs(residual[3:6]).max():.2g} N m"
        )
    collective, lateral, longitudinal, tail, roll, pitch = (float(value) for value in found.x[:6])
    throttle = float(found.x[6]) if has_engine else 0.0
    return Trim(
        Controls(collective, lateral, longitudinal, tail, throttle),
        roll,
        pitch,
        heading,
        moving,
        air,
        np.array(inertia, dtype=float),
        s.copy(),
        state,
    )


def linearise(pipeline: Pipeline, trim: Trim) -> LinearModel:
    """The plant about a trim, by central differences; the pipeline is left as it was."""
    lags = [name for name in LAGS if pipeline.state_index(name) >= 0]
    index = [pipeline.state_index(name) for name in lags]
    names = {term.name: [parameter.name for parameter in term.parameters] for term in pipeline.terms}
    delay = np.zeros(5)
    start, numbers = pipeline.state.copy(), pipeline.parameters.copy()
    if "servo" in names:
        late = pipeline.parameters[pipeline.spans[[term.name for term in pipeline.terms].index("servo"), 2] :]
        delay[:4] = late[names["servo"].index("delay")]
        delay[4] = late[names["servo"].index("throttle_delay")]

    s = pipeline.signals()

    def derivative(x: Floats, u: Floats) -> Floats:
        roll, pitch, heading = x[:3]
        rates, body_velocity = x[3:6], x[6:9]
        r = matrix(quaternion(roll, pitch, heading))
        for name in SIGNALS.fields or ():
            s[name] = trim.signals[name]
        s["velocity"], s["rates"], s["up"] = body_velocity - r.T @ trim.wind, rates, r[2]
        for _ in range(3):  # torques and inflow reach the head of the pipeline one and two instants later
            for name, value in zip(Controls._fields, u, strict=True):
                s[name] = value
            pipeline.state[:] = trim.state
            pipeline.state[index] = x[9:]
            pipeline.run(s, _INSTANT)
        lag_rates = (pipeline.state[index] - x[9:]) / _INSTANT
        # with p = wx, q = -wy, r = -wz these are the Euler angles' rates of any textbook
        turn = -rates[1] * math.sin(roll) - rates[2] * math.cos(roll)
        angle_rates = (
            rates[0] + turn * math.tan(pitch),
            -rates[1] * math.cos(roll) + rates[2] * math.sin(roll),
            turn / math.cos(pitch),
        )
        spin = (s["moment"] - np.cross(rates, trim.inertia * rates)) / trim.inertia
        acceleration = s["force"] / s["mass"] - GRAVITY * s["up"] - np.cross(rates, body_velocity)
        return np.concatenate([angle_rates, spin, acceleration, lag_rates])

    r = matrix(quaternion(trim.roll, trim.pitch, trim.heading))
    x0 = np.concatenate([(trim.roll, trim.pitch, trim.heading), np.zeros(3), r.T @ trim.velocity, trim.state[index]])
    u0 = np.array(trim.controls)
    try:
        # a second stage of the servos counts as part of the first: late by the same time
        for term, name in (("servo", "delay"), ("servo", "throttle_delay"), ("servo", "second"), ("fuel", "rate")):
            if term in names:
                pipeline.set_parameter(term, name, 0.0)
        a = _differences(lambda x: derivative(x, u0), x0)
        b = _differences(lambda u: derivative(x0, u), u0)
    finally:
        pipeline.state[:] = start
        pipeline.parameters[:] = numbers
    return LinearModel(a, b, (*BODY, *lags), Controls._fields, delay)


def _differences(function, at: Floats) -> Floats:  # type: ignore[no-untyped-def]
    """Jacobian (m, n) of `function` at `at` (n,), by central differences."""
    columns = []
    for i in range(len(at)):
        step = np.zeros(len(at))
        step[i] = 1e-4 * max(1.0, abs(at[i]))
        columns.append((function(at + step) - function(at - step)) / (2.0 * step[i]))
    return np.stack(columns, axis=-1)

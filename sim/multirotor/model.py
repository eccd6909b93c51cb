"""The model of a multirotor along commands: thrusts, and what they make of force and moment.

    T_i = s_i s F_i(command) (1 + sag (V - V_ref)) (1 - climb v_z),   tau dT/dt = F - T
    m f = (0, 0, sum T_i) - (rho/2 area |v| + linear) v
    I_x w_x' = sum (y_i - c_y) T_i,   I_y w_y' = -sum (x_i - c_x) T_i,   I_z w_z' = -sum spin_i k_i T_i + a sum T_i

c: centre of mass less what thrust moves forward in forward flight (`ahead` v: blades that advance lift more, and flap);
k: torque over thrust; a: arm of the yaw trim. Body axes; gyroscopic moments are left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE, density_at
from sim.multirotor.file import Multirotor

Floats = NDArray[np.float64]

AIR = density_at(0.0, SURFACE_PRESSURE, SURFACE_TEMPERATURE)  # [kg/m^3]


@dataclass(frozen=True, eq=False)
class Inputs:
    """What drives the model, M samples at equal steps."""

    step: float  # [s]
    commands: Floats  # (M, N) 0..1, or measured speeds [rad/s] where thrust is from speed
    voltage: Floats  # (M,) [V] of the battery under load; NaN where not known
    velocity: Floats  # (M, 3) [m/s] against the air, body axes; zeros where not known


def thrusts(craft: Multirotor, numbers: Mapping[str, float], inputs: Inputs) -> Floats:
    """Thrust of each rotor (M, N) [N]."""
    commands = inputs.commands
    delay = numbers["terms.motor.delay"]
    if delay > 0.0:
        at = np.arange(len(commands)) - delay / inputs.step
        commands = np.column_stack([np.interp(at, np.arange(len(commands)), c) for c in commands.T])
    if craft.by_speed:
        found = craft.coefficients * commands**2
    else:
        found = np.column_stack([np.interp(c, *t.T) for c, t in zip(commands.T, craft.tables, strict=True)])
    tau = numbers["terms.motor.tau"]
    if tau > 0.0:
        keep = np.exp(-inputs.step / tau)  # along straight lines from sample to sample: neither early nor late
        here = 1.0 - (1.0 - keep) * tau / inputs.step
        found, _ = lfilter([here, 1.0 - keep - here], [1.0, -keep], found, axis=0, zi=(1.0 - here) * found[:1])
    scale = np.array([numbers[f"rotors.{i}.thrust_scale"] for i in range(craft.rotors)])
    low = np.nan_to_num(inputs.voltage - numbers["terms.battery_sag.reference"])
    sagged = np.maximum(1.0 + numbers["terms.battery_sag.sag"] * low, 0.0)
    climbing = np.maximum(1.0 - numbers["terms.inflow.climb"] * inputs.velocity[:, 2], 0.0)
    return np.asarray(numbers["terms.thrust.scale"] * scale * found * (sagged * climbing)[:, None])


def answer(craft: Multirotor, numbers: Mapping[str, float], inputs: Inputs) -> Floats:
    """Specific force [m/s^2] and angular acceleration [rad/s^2] (M, 6), body axes."""
    thrust = thrusts(craft, numbers, inputs)
    total = thrust.sum(axis=1)
    speed = np.linalg.norm(inputs.velocity, axis=1)
    drag = 0.5 * AIR * numbers["terms.drag.area"] * speed + numbers["terms.drag.linear"]
    force = -drag[:, None] * inputs.velocity
    force[:, 2] += total
    x, y = craft.positions[:, 0], craft.positions[:, 1]
    torque = np.array([numbers[f"rotors.{i}.torque"] for i in range(craft.rotors)])
    ahead = numbers["terms.inflow.ahead"] * inputs.velocity[:, :2].T
    centre = [
        numbers[f"terms.cg_offset.{axis}"] + numbers[f"terms.payload.{axis}"] - moved
        for axis, moved in zip("xy", ahead, strict=True)
    ]
    low = np.nan_to_num(inputs.voltage - numbers["terms.battery_sag.reference"])
    askew = numbers["terms.yaw_trim.arm"] + numbers["terms.yaw_trim.per_volt"] * low
    moment = np.column_stack([
        thrust @ y - centre[1] * total,
        -(thrust @ x - centre[0] * total),
        -thrust @ (craft.spins * torque) + askew * total,
    ])  # fmt: skip
    inertia = np.array([numbers[f"inertia.{axis}"] for axis in range(3)])
    return np.hstack([force / numbers["mass"], moment / inertia])

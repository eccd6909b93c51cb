"""The helicopter as gain design sees it: matrices about hover, handed in, and their sampled form."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete

from flightlog.signals import Controls

Floats = NDArray[np.float64]

SAMPLE_TIME = 0.004  # [s] the pilot's period: the rate of the IMU, 250 Hz


@dataclass(frozen=True, eq=False)
class LinearPlant:
    """dx/dt = A x + B u about a trimmed hover, x and u being differences from it; SI units, body axes.

    States by name: roll, pitch, heading, wx, wy, wz, vx, vy, vz (body origin, body axes) and lags named
    `term.state`: engine.speed (the main rotor's), engine.throttle, main_rotor.inflow, flapping.back, flapping.right,
    servo.<control>. Lags may be missing; the rigid body and engine.speed may not.
    """

    A: Floats  # (n, n)
    B: Floats  # (n, 5)
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]  # collective, lateral, longitudinal, tail, throttle
    delay: Floats  # (5,) [s] pure delay from a control as sent to the servo's first motion, not in A and B
    trim: Controls
    trim_roll: float  # [rad]
    trim_pitch: float  # [rad]
    lower: Controls  # stops of the controls
    upper: Controls
    rotor_speed: float  # [rad/s] at trim
    tail_pitch: float  # [rad] pitch of the tail rotor's blades at trim, towards holding the engine's torque
    rotor_radius: float  # [m]
    induced_velocity: float  # [m/s] at trim
    hub_height: float  # [m] above the body origin
    skid_height: float  # [m] body origin above the skids' plane

    def states(self, *names: str) -> list[int]:
        """Where these states stand; those that the model does not have are left out."""
        return [self.state_names.index(name) for name in names if name in self.state_names]

    def inputs(self, *names: str) -> list[int]:
        """Where these inputs stand."""
        return [self.input_names.index(name) for name in names]


def sample(a: Floats, b: Floats, delay: float, period: float = SAMPLE_TIME) -> tuple[Floats, Floats]:
    """The exact sampled form of dx/dt = a x + b u(t - delay) under held inputs: (n + m k, n + m k), (n + m k, k).

    The state is lengthened by the inputs still under way: z = [x, u(j-1), ..., u(j-m)]. With a delay of d + f
    periods, 0 <= f < 1, x sees u(j-d-1) during the first share f of a period and u(j-d) for the rest.
    """
    n, inputs = b.shape
    whole = int(np.floor(delay / period + 1e-9))
    part = max(delay - whole * period, 0.0)
    if part < 1e-9:
        part = 0.0
    moved, late = _held(a, b, period - part)
    effects = {whole: late}  # what an input sent so many periods ago does to x
    if part:
        first, early = _held(a, b, part)
        effects[whole + 1] = moved @ early
        moved = moved @ first
    history = max(effects)
    size = n + history * inputs
    full, drive = np.zeros((size, size)), np.zeros((size, inputs))
    full[:n, :n] = moved
    for age, effect in effects.items():
        if age == 0:
            drive[:n] = effect
        else:
            full[:n, n + (age - 1) * inputs : n + age * inputs] = effect
    if history:
        drive[n : n + inputs] = np.eye(inputs)
        full[n + inputs :, n:-inputs] = np.eye(size - n - inputs)
    return full, drive


def _held(a: Floats, b: Floats, period: float) -> tuple[Floats, Floats]:
    ad, bd, *_ = cont2discrete((a, b, np.eye(len(a)), np.zeros_like(b)), period)
    return ad, bd

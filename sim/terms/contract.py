"""The small contract that every term of the model obeys.

The model is a pipeline: command -> servo -> rotor speed -> inflow -> thrust -> wrench. A term declares the stage it
acts on, its parameters and the names of its own states; its kernel reads and writes the signals that run through
the pipeline. One compiled kernel serves one instant at 500 Hz and whole logs.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

import numba
import numpy as np
from numba import types

from sim.parameters import Parameter

# What runs through the pipeline, one record an instant. SI, body axes (x forward, y left, z up).
SIGNALS = np.dtype(
    [
        ("time", "f8"),  # [s]
        # controls [rad], [0..1]: as sent at the pipeline's entry, as they stand at the swash plate behind the servos
        ("collective", "f8"),
        ("lateral", "f8"),
        ("longitudinal", "f8"),
        ("tail", "f8"),
        ("throttle", "f8"),
        # the vehicle's motion, set before the first stage
        ("velocity", "f8", (3,)),  # [m/s] of the body origin against the air, body axes
        ("rates", "f8", (3,)),  # [rad/s] wx, wy, wz: wy > 0 is nose down, wz > 0 turns left
        ("up", "f8", (3,)),  # the world's up in body axes
        ("height", "f8"),  # [m] body origin above the ground
        ("density", "f8"),  # [kg/m^3]
        # the rotor
        ("rotor_speed", "f8"),  # [rad/s]
        ("rotor_acceleration", "f8"),  # [rad/s^2]
        ("engine_torque", "f8"),  # [N m] at the main shaft
        ("rotor_torque", "f8"),  # [N m] that the main rotor takes from its shaft
        ("tail_torque", "f8"),  # [N m] that the tail rotor takes, at the main shaft
        ("ground", "f8"),  # [1] induced velocity in ground effect over that out of it; 1 at the first stage
        ("inflow", "f8"),  # [m/s] induced velocity at the disc, ground effect included
        ("thrust", "f8"),  # [N] main rotor
        ("flap_back", "f8"),  # [rad] tip-path plane tilted back against the shaft
        ("flap_right", "f8"),  # [rad] tip-path plane tilted right against the shaft
        ("tail_thrust", "f8"),  # [N] > 0 pushes the tail so that the nose turns right
        ("mass", "f8"),  # [kg] at this instant; the vehicle's own at the first stage
        # what comes out, about the body origin; zero at the first stage
        ("force", "f8", (3,)),  # [N] body axes, gravity and contact excluded
        ("moment", "f8", (3,)),  # [N m] body axes
    ],
    align=True,
)

# What more than one term needs to know of the vehicle.
GEOMETRY = np.dtype(
    [
        ("mass", "f8"),  # [kg] at t = 0
        ("rotor_radius", "f8"),  # [m]
        ("rotor_solidity", "f8"),  # [1] b c / (pi R)
        ("rotor_direction", "f8"),  # +1 counter-clockwise seen from above, -1 clockwise
        ("nominal_speed", "f8"),  # [rad/s] of the main rotor
        ("hub", "f8", (3,)),  # [m] body axes
        ("tail_hub", "f8", (3,)),  # [m] body axes
        ("skid_height", "f8"),  # [m] body origin above the skids' plane
    ],
    align=True,
)

_signals = numba.from_dtype(SIGNALS)
_geometry = numba.from_dtype(GEOMETRY)
_vector = types.Array(types.float64, 1, "C")
KERNEL = types.void(_signals, _geometry, _vector, _vector, types.float64)

Kernel = Callable[[np.void, np.void, np.ndarray, np.ndarray, float], None]


def kernel(function: Kernel) -> Kernel:
    """Compile a term's kernel `f(s, v, x, p, dt)`.

    s: SIGNALS record, read and written. v: GEOMETRY record, read. x: the term's own states, brought dt [s] further
    in place. p: the term's parameters in their declared order, read.
    """
    written_down = Path(function.__code__.co_filename).is_file()  # nothing to cache by where typed at a prompt
    return numba.njit(KERNEL, cache=written_down)(function)


class Stage(IntEnum):
    """Where in the pipeline a term acts; within a stage, terms act in the order of the vehicle file."""

    COMMAND = 0  # controls as sent -> controls as the servos get them
    SERVO = 1  # -> controls at the swash plate
    MASS = 2  # what the vehicle weighs at this instant
    ROTOR_SPEED = 3
    INFLOW = 4  # what changes the air through the disc
    THRUST = 5
    FLAPPING = 6
    WRENCH = 7  # -> force and moment
    BALANCE = 8  # what needs the whole force


@dataclass(frozen=True)
class Term:
    """One effect of the model."""

    name: str
    stage: Stage
    kernel: Kernel
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...] = ()
    source: str = ""
    initial: tuple[float, ...] = field(default=())  # of the states; zeros where empty

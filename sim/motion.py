"""One physics tick of the model: the vehicle's motion in, the generalised force on its free joint out."""


import numba
from numba import types

from flightlog.atmosphere import density_at, pressure_at, temperature_at
from flightlog.constants import GRAVITY
from flightlog.rotations import matrix
from sim.kernel_call import ADDRESSES
from sim.pipeline import run
from sim.terms.contract import GEOMETRY, SIGNALS

BEYOND = 1e9  # in SI, whatever it is: no position, speed or force of a flight comes near

_signals = numba.from_dtype(SIGNALS)
_geometry = numba.from_dtype(GEOMETRY)
_vector = types.Array(types.float64, 1, "C")
_spans = types.Array(types.int64, 2, "C")


@numba.njit(cache=True)
def sense_motion(s, qpos, qvel, wind, surface_pressure, surface_temperature):  # type: ignore[no-untyped-def]
    """Fill the signals that describe the motion; returns the rotation (3, 3), body to world.

    qpos (7,), qvel (6,): free joint as MuJoCo has it (velocity ENU, rates in body axes). wind (3,) [m/s] ENU, where
    the air moves to.
    """
    r = matrix(qpos[3:7])
    for axis in range(3):
        s.velocity[axis] = (
            r[0, axis] * (qvel[0] - wind[0]) + r[1, axis] * (qvel[1] - wind[1]) + r[2, axis] * (qvel[2] - wind[2])
        )
        s.rates[axis] = qvel[3 + axis]
        s.up[axis] = r[2, axis]
    s.height = qpos[2]
    s.density = density_at(qpos[2], surface_pressure, surface_temperature)
    return r


@numba.njit(cache=True)
def finite(qpos, qvel, rotor_speed):  # type: ignore[no-untyped-def]
    """Whether these are still numbers that a machine could have: neither NaN nor beyond all bounds."""
    total = abs(rotor_speed)
    for value in qpos:
        total += abs(value)
    for value in qvel:
        total += abs(value)
    return total < BEYOND


@numba.njit(
    types.boolean(
        ADDRESSES, _spans, types.Array(_signals, 1, "C"),
        types.Array(_geometry, 1, "C"), _vector, _vector, types.float64, _vector, _vector, _vector, types.float64,
        types.float64, types.UniTuple(types.float64, 5), _vector, _vector,
    ),
    cache=True,
)  # fmt: skip
def advance(  # type: ignore[no-untyped-def]
    kernels, spans, signals, geometry, x, p, dt, qpos, qvel, wind, surface_pressure, surface_temperature, controls,
    turns, qfrc,
):  # fmt: skip
    """Run the model for dt [s] at the motion in qpos, qvel and write its force into qfrc (nv,).

    signals, geometry: records as arrays of one, which are cheaper to hand over. turns (nv,): what each joint behind
    the free one turns for one turn of the main rotor; their speeds are set in qvel. False where a result is no number
    that a flight comes near.
    """
    s = signals[0]
    r = sense_motion(s, qpos, qvel, wind, surface_pressure, surface_temperature)
    s.time += dt
    s.collective, s.lateral, s.longitudinal, s.tail, s.throttle = controls
    run(kernels, spans, s, geometry[0], x, p, dt)
    for axis in range(3):
        # MuJoCo's free joint takes its force in world axes and its moment in body axes
        qfrc[axis] = r[axis, 0] * s.force[0] + r[axis, 1] * s.force[1] + r[axis, 2] * s.force[2]
        qfrc[3 + axis] = s.moment[axis]
    for joint in range(6, len(turns)):
        qvel[joint] = turns[joint] * s.rotor_speed
    return finite(qfrc, qvel, s.rotor_speed)


@numba.njit(cache=True)
def observe(  # type: ignore[no-untyped-def]
    signals, qpos, qvel, before, since, surface_pressure, surface_temperature, position, quaternion, rotation, velocity,
    rates, specific_force, spin,
):  # fmt: skip
    """Bring what is known of the motion up to qpos (7,), qvel (6,).

    Returns rotor speed [rad/s], thrust [N], inflow [m/s], and the air's pressure [Pa] and temperature [K] there.
    before (6,): qvel of `since` [s] ago. Specific force (3,) [m/s^2] and angular acceleration `spin` (3,) [rad/s^2]
    are means over that time in body axes: what an integrating IMU sees, and free of the integrator's internals.
    """
    r = matrix(qpos[3:7])
    rotation[:] = r
    fx = (qvel[0] - before[0]) / since
    fy = (qvel[1] - before[1]) / since
    fz = (qvel[2] - before[2]) / since + GRAVITY
    for axis in range(3):
        specific_force[axis] = fx * r[0, axis] + fy * r[1, axis] + fz * r[2, axis]
        spin[axis] = (qvel[3 + axis] - before[3 + axis]) / since
        position[axis] = qpos[axis]
        velocity[axis] = qvel[axis]
        rates[axis] = qvel[3 + axis]
    for i in range(4):
        quaternion[i] = qpos[3 + i]
    pressure = pressure_at(qpos[2], surface_pressure, surface_temperature)
    s = signals[0]
    return s.rotor_speed, s.thrust, s.inflow, pressure, temperature_at(qpos[2], surface_temperature)

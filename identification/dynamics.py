"""What the vehicle's model says about force, moment and rotor, beside what was measured.

The model runs along the log: motion, rotor speed and controls as measured go in, force and moment come out. A small
filter then takes out what the wind's gusts explain; what is left over are innovations, white where the model is right.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from flightlog.atmosphere import density_at
from flightlog.rotations import matrix
from sim.pipeline import Pipeline, run, settle
from sim.terms.contract import GEOMETRY, KERNEL, SIGNALS
from sim.wind.mean import mean_speed

Floats = NDArray[np.float64]

CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z", "rotor.speed")
UNITS = ("m/s^2", "m/s^2", "m/s^2", "rad/s^2", "rad/s^2", "rad/s^2", "rad/s")
FORCE, MOMENT, ROTOR = 0, 3, 6

SETTLE_TICK, SETTLE_TICKS = 0.004, 250  # [s]: five of the slowest lag
GROWING = ("fuel.burnt",)  # states that start with the flight and do not settle

_signals = numba.from_dtype(SIGNALS)
_geometry = numba.from_dtype(GEOMETRY)
_vector = types.Array(types.float64, 1, "C")
_table = types.Array(types.float64, 2, "C")
_spans = types.Array(types.int64, 2, "C")
_counts = types.Array(types.int64, 1, "C")


@numba.njit(
    types.void(
        types.ListType(types.FunctionType(KERNEL)), _spans, types.Array(_signals, 1, "C"),
        types.Array(_geometry, 1, "C"), _vector, _vector, types.int64, _counts, _vector, _table, _table, _vector,
        _table, _vector, _vector, _vector, _vector, types.float64, types.float64, _table,
    ),
    cache=True,
    nogil=True,
)  # fmt: skip
def along(
    kernels, spans, signals, geometry, x, p, held, edges, t, motion, rates, rotor, controls, wind, puff, inertia, arm,
    surface_pressure, surface_temperature, out,
):  # fmt: skip
    """Run the model along a log.

    held: number of the state that is the rotor's speed, kept at what was measured (< 0: none). edges (N + 1,): sample
    at which each node begins. t (S,), motion (S, 10), rates (S, 3), rotor (S,), controls (S, 5). wind (3,) at 10 m,
    ENU, with the usual profile over the height; puff (3,) the same everywhere.
    inertia (3,); arm (3,) of the inertial sensor. out (N, 7): mean specific force at the inertial sensor, angular
    acceleration, rotor acceleration.
    """
    s = signals[0]
    v = geometry[0]
    spin = np.empty(3)
    before = np.full(3, np.nan)
    for n in range(len(edges) - 1):
        for k in range(7):
            out[n, k] = 0.0
        for i in range(edges[n], edges[n + 1]):
            dt = t[i] - t[i - 1] if i > 0 else t[1] - t[0]
            r = matrix(motion[i, 6:10])
            share = mean_speed(motion[i, 2], 1.0)
            ax = motion[i, 3] - share * wind[0] - puff[0]
            ay = motion[i, 4] - share * wind[1] - puff[1]
            az = motion[i, 5] - share * wind[2] - puff[2]
            for axis in range(3):
                s.velocity[axis] = r[0, axis] * ax + r[1, axis] * ay + r[2, axis] * az
                s.rates[axis] = rates[i, axis]
                s.up[axis] = r[2, axis]
            s.height = motion[i, 2]
            s.density = density_at(motion[i, 2], surface_pressure, surface_temperature)
            s.time += dt
            s.collective, s.lateral, s.longitudinal, s.tail, s.throttle = (
                controls[i, 0], controls[i, 1], controls[i, 2], controls[i, 3], controls[i, 4]
            )  # fmt: skip
            if held >= 0:
                x[held] = rotor[i]
            else:
                s.rotor_speed = rotor[i]
            run(kernels, spans, s, v, x, p, dt)
            wx, wy, wz = rates[i, 0], rates[i, 1], rates[i, 2]
            fx, fy, fz = s.force[0], s.force[1], s.force[2]
            mx = s.moment[0] - (inertia[2] - inertia[1]) * wy * wz
            my = s.moment[1] - (inertia[0] - inertia[2]) * wz * wx
            mz = s.moment[2] - (inertia[1] - inertia[0]) * wx * wy
            spin[0], spin[1], spin[2] = mx / inertia[0], my / inertia[1], mz / inertia[2]
            dot = wx * arm[0] + wy * arm[1] + wz * arm[2]
            square = wx * wx + wy * wy + wz * wz
            ax = fx / s.mass + spin[1] * arm[2] - spin[2] * arm[1] + wx * dot - square * arm[0]
            ay = fy / s.mass + spin[2] * arm[0] - spin[0] * arm[2] + wy * dot - square * arm[1]
            az = fz / s.mass + spin[0] * arm[1] - spin[1] * arm[0] + wz * dot - square * arm[2]
            if np.isnan(before[0]):
                before[0], before[1], before[2] = ax, ay, az
            # a sample of force is the mean since the last one, a sample of rate is of its instant
            out[n, 0] += 0.5 * (before[0] + ax)
            out[n, 1] += 0.5 * (before[1] + ay)
            out[n, 2] += 0.5 * (before[2] + az)
            before[0], before[1], before[2] = ax, ay, az
            out[n, 3] += spin[0]
            out[n, 4] += spin[1]
            out[n, 5] += spin[2]
            out[n, 6] += s.rotor_acceleration
        count = max(edges[n + 1] - edges[n], 1)
        for k in range(7):
            out[n, k] /= count


@numba.njit(cache=True)
def innovations(model, measured, gust, step, keep, gust_std, process, noise, gains, spreads, out):
    """Take out what gusts explain; returns twice the negative log-likelihood.

    In and out:

        model (N, 7): see `along`. measured (N, 7): mean force, rate and rotor speed of the node; NaN: none.
        gust (N, 7, 3): change of the model's answer by a gust [1/s or 1/(m s)], world axes.
        step [s], keep: factor of the gust a node. gust_std (3,) [m/s]. process (7,), noise (7,): standard deviations
            of what the model leaves open (of rates and rotor speed a node) and of the measurement.
        gains (N, 7, 7), spreads (N, 7), out (N, 7): written; out: innovations in units of the measurement.
    """
    x = np.zeros(7)
    cov = np.zeros((7, 7))
    for i in range(3):
        cov[i, i] = gust_std[i] ** 2
        cov[3 + i, 3 + i] = 1.0
    cov[6, 6] = 100.0
    begun = np.zeros(4)
    f = np.eye(7)
    row = np.empty(7)
    total = 0.0
    for n in range(len(model)):
        for i in range(3):
            f[i, i] = keep
        for i in range(4):
            for j in range(3):
                f[3 + i, j] = step * gust[n, 3 + i, j] * keep
        x = f @ x
        for i in range(4):
            x[3 + i] += step * model[n, 3 + i]
        cov = f @ cov @ f.T
        for i in range(3):
            q = (1.0 - keep * keep) * gust_std[i] ** 2
            cov[i, i] += q
            for a in range(4):
                turn = step * gust[n, 3 + a, i]
                cov[3 + a, i] += turn * q
                cov[i, 3 + a] += turn * q
                for b in range(4):
                    cov[3 + a, 3 + b] += turn * step * gust[n, 3 + b, i] * q
        for i in range(4):
            cov[3 + i, 3 + i] += process[3 + i] ** 2
        for k in range(7):
            spreads[n, k] = np.inf
            out[n, k] = 0.0
            for i in range(7):
                gains[n, k, i] = 0.0
            if not np.isfinite(measured[n, k]):
                continue
            if k >= 3 and begun[k - 3] == 0.0:  # the first reading is where the count begins
                begun[k - 3] = 1.0
                x[k] = measured[n, k]
                cov[k, :] = 0.0
                cov[:, k] = 0.0
                cov[k, k] = noise[k] ** 2
                continue
            row[:] = 0.0
            if k < 3:
                for j in range(3):
                    row[j] = gust[n, k, j]
            else:
                row[k] = 1.0
            value = row @ x
            if k < 3:
                value += model[n, k]
            ph = cov @ row
            s2 = row @ ph + noise[k] ** 2
            nu = measured[n, k] - value
            spreads[n, k] = np.sqrt(s2)
            out[n, k] = nu
            total += nu * nu / s2 + np.log(s2)
            for i in range(7):
                gains[n, k, i] = ph[i] / s2
                x[i] += ph[i] / s2 * nu
            for i in range(7):
                for j in range(7):
                    cov[i, j] -= ph[i] * ph[j] / s2
    return total


@dataclass(frozen=True, eq=False)
class Drive:
    """What drives the model along one flight: S inertial samples, N nodes."""

    edges: NDArray[np.int64]  # (N + 1,)
    t: Floats  # (S,)
    motion: Floats  # (S, 10) position, velocity, quaternion
    rates: Floats  # (S, 3) smoothed over a turn of the rotor
    rotor: Floats  # (S,) [rad/s] smoothed
    controls: Floats  # (S, 5)
    arm: Floats  # (3,) of the inertial sensor
    surface_pressure: float
    surface_temperature: float


def answer(
    pipeline: Pipeline, parameters: Floats, mass: float, inertia: Floats, drive: Drive, wind: Floats, puff: Floats
) -> Floats:
    """The model's answer (N, 7) along a flight with these `parameters`; the pipeline itself is not touched."""
    state = pipeline.state.copy()
    signals = np.zeros(1, dtype=SIGNALS)
    signals[0] = pipeline.signals()
    s = signals[0]
    r = matrix(drive.motion[0, 6:10])
    s["velocity"], s["up"] = r.T @ (drive.motion[0, 3:6] - wind), r[2]
    s["height"] = drive.motion[0, 2]
    s["density"] = density_at(drive.motion[0, 2], drive.surface_pressure, drive.surface_temperature)
    s["rotor_speed"] = drive.rotor[0]
    for k, name in enumerate(("collective", "lateral", "longitudinal", "tail", "throttle")):
        s[name] = drive.controls[0, k]
    geometry = np.zeros(1, dtype=GEOMETRY)
    geometry[0] = pipeline.geometry
    geometry[0]["mass"] = mass
    held = pipeline.state_index("engine.speed")
    settle(
        pipeline.kernels, pipeline.spans, s, geometry[0], state, parameters, SETTLE_TICK, SETTLE_TICKS, held,
        float(drive.rotor[0]),
    )  # fmt: skip
    for name in GROWING:
        index = pipeline.state_index(name)
        if index >= 0:
            state[index] = pipeline.state[index]
    s["time"] = 0.0
    out = np.empty((len(drive.edges) - 1, 7))
    along(
        pipeline.kernels, pipeline.spans, signals, geometry, state, parameters, held, drive.edges, drive.t,
        drive.motion, drive.rates, drive.rotor, drive.controls, wind, puff, inertia, drive.arm,
        drive.surface_pressure, drive.surface_temperature, out,
    )  # fmt: skip
    # what is measured is the mean of a node, so what lies between two is half of each
    out[1:, 3:] = 0.5 * (out[1:, 3:] + out[:-1, 3:])
    return out

"""What the vehicle's model says about force, moment and rotor, beside what was measured.

The model runs along the log: motion, rotor speed and controls as measured go in, force and moment come out. A small
filter then takes out what the wind's gusts explain; what is left over are innovations, white where the model is right.
"""

import numba
import numpy as np
from numba import types
from numpy.typing import NDArray

from identification.grid import CONTROLS, DENSITY, HEIGHT, ROTATION, ROTOR, VELOCITY, Grid
from sim.kernel_call import ADDRESSES
from sim.pipeline import Pipeline, run, settle
from sim.terms.contract import GEOMETRY, SIGNALS

Floats = NDArray[np.float64]

RESTART = -1.0  # for a spread: a reading that says where the count of rate or rotor speed begins

CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z", "rotor.speed")
UNITS = ("m/s^2", "m/s^2", "m/s^2", "rad/s^2", "rad/s^2", "rad/s^2", "rad/s")

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
        ADDRESSES, _spans, types.Array(_signals, 1, "C"),
        types.Array(_geometry, 1, "C"), _vector, _vector, types.int64, _counts, _table, _vector, _table, _vector,
        _vector, _table,
    ),
    cache=True,
    nogil=True,
)  # fmt: skip
def along(kernels, spans, signals, geometry, x, p, held, edges, ticks, wind, puff, inertia, arm, out):
    """Run the model along a grid.

    held: number of the state that is the rotor's speed, kept at what was measured (< 0: none). edges (N + 1,), ticks
    (T, 27): see `grid`. wind (3,) at 10 m, ENU, with the usual profile over the height; puff (N, 3) of each node, at
    every height.
    inertia (3,); arm (3,) of the inertial sensor. out (N, 7): mean specific force at the inertial sensor, change of
    the node's mean rate and rotor speed against the node before, a second.
    """
    s = signals[0]
    v = geometry[0]
    spin = np.empty(3)
    w = np.zeros(4)  # rate and rotor speed, integrated
    mean = np.empty(4)
    before = np.zeros(4)
    for n in range(len(edges) - 1):
        for k in range(7):
            out[n, k] = 0.0
        mean[:] = 0.0
        seen = 0.0
        span = 0.0
        for i in range(edges[n], edges[n + 1]):
            row = ticks[i]
            dt = row[0]
            ax = row[1] - row[15] * wind[0] - puff[n, 0]
            ay = row[2] - row[15] * wind[1] - puff[n, 1]
            az = row[3] - row[15] * wind[2] - puff[n, 2]
            for axis in range(3):
                s.velocity[axis] = row[4 + axis] * ax + row[7 + axis] * ay + row[10 + axis] * az
                s.rates[axis] = row[16 + axis]
                s.up[axis] = row[10 + axis]
            s.height = row[13]
            s.density = row[14]
            s.time += dt
            s.collective, s.lateral, s.longitudinal, s.tail, s.throttle = row[20], row[21], row[22], row[23], row[24]
            if held >= 0:
                x[held] = row[19]
            else:
                s.rotor_speed = row[19]
            run(kernels, spans, s, v, x, p, dt)
            wx, wy, wz = row[16], row[17], row[18]
            mx = s.moment[0] - (inertia[2] - inertia[1]) * wy * wz
            my = s.moment[1] - (inertia[0] - inertia[2]) * wz * wx
            mz = s.moment[2] - (inertia[1] - inertia[0]) * wx * wy
            spin[0], spin[1], spin[2] = mx / inertia[0], my / inertia[1], mz / inertia[2]
            dot = wx * arm[0] + wy * arm[1] + wz * arm[2]
            square = wx * wx + wy * wy + wz * wz
            out[n, 0] += dt * (s.force[0] / s.mass + spin[1] * arm[2] - spin[2] * arm[1] + wx * dot - square * arm[0])
            out[n, 1] += dt * (s.force[1] / s.mass + spin[2] * arm[0] - spin[0] * arm[2] + wy * dot - square * arm[1])
            out[n, 2] += dt * (s.force[2] / s.mass + spin[0] * arm[1] - spin[1] * arm[0] + wz * dot - square * arm[2])
            span += dt
            # a sample of force is a mean, one of rate is of its instant; a tachometer counts pulses over a time
            mean[3] += dt * (w[3] + 0.5 * dt * s.rotor_acceleration)
            w[3] += dt * s.rotor_acceleration
            for k in range(3):
                w[k] += dt * spin[k]
                mean[k] += row[25] * (w[k] - row[26] * dt * spin[k])
            seen += row[25]
        span = max(span, 1e-9)
        for k in range(3):
            out[n, k] /= span
            mean[k] /= max(seen, 1.0)
        mean[3] /= span
        for k in range(4):
            out[n, 3 + k] = 0.0 if n == 0 else (mean[k] - before[k]) / span
            before[k] = mean[k]


@numba.njit(cache=True, nogil=True)
def innovations(
    model, measured, gust, sooner, follow, fresh, step, keep, gust_std, process, noise, gains, spreads, out,
):
    """Take out what gusts explain; returns twice the negative log-likelihood.

    In and out:

        model (N, 7): see `along`. measured (N, 7): mean force, rate and rotor speed of the node; NaN: none.
        gust (N, 7, 3): change of the model's answer by a lasting gust [1/s or 1/(m s)], world axes.
        sooner (N, 3): what an upward gust changes the force by beyond that until the rotor's inflow has followed.
        follow (4, 2), fresh (4, 4): over a node, how (gust, what the inflow has followed) at its end and in its mean
            come from those before, and the covariance of what is new in a gust whose steps have variance one.
        step [s]; keep (N, 3): factor of the gust a node. gust_std (N, 3) [m/s]. process (7,), noise (7,): standard
            deviations of what the model leaves open (of rates and rotor speed a node) and of the measurement.
        gains (N, 7, 10), spreads (N, 7), out (N, 7): written; out: innovations in units of the measurement. A spread
            of inf: nothing measured; of RESTART: a reading from which the count begins.

    The mean rate of a node is another than that of the one before by what blew on either, half each. Where no force is
    measured (on the ground), rates and rotor speed are followed anew from the next reading on.
    """
    x = np.zeros(10)  # gust (3), rate (3), rotor speed; upwards: followed by the inflow, mean gust and mean followed
    cov = np.zeros((10, 10))
    for i in range(3):
        cov[i, i] = gust_std[0, i] ** 2
        cov[3 + i, 3 + i] = 1.0
    cov[6, 6] = 100.0
    up = np.array([2, 7, 8, 9])
    for i in up:
        for j in up:
            cov[i, j] = gust_std[0, 2] ** 2
    begun = np.zeros(4)
    f = np.eye(10)
    for i in range(1, 4):
        f[up[i], up[i]] = 0.0
        f[up[i], 2], f[up[i], 7] = follow[i, 0], follow[i, 1]
    row = np.empty(10)
    total = 0.0
    for n in range(len(model)):
        if not np.isfinite(measured[n, 0]):
            begun[:] = 0.0
        for i in range(3):
            f[i, i] = keep[n, i]
        for i in range(4):
            for j in range(3):
                f[3 + i, j] = 0.5 * step * gust[n, 3 + i, j] * (1.0 + keep[n, j])
        x = f @ x
        for i in range(4):
            x[3 + i] += step * model[n, 3 + i]
        cov = f @ cov @ f.T
        for i in range(3):
            q = (1.0 - keep[n, i] ** 2) * gust_std[n, i] ** 2
            cov[i, i] += q
            for a in range(4):
                turn = 0.5 * step * gust[n, 3 + a, i]
                cov[3 + a, i] += turn * q
                cov[i, 3 + a] += turn * q
                for b in range(4):
                    cov[3 + a, 3 + b] += turn * 0.5 * step * gust[n, 3 + b, i] * q
        q = (1.0 - keep[n, 2] ** 2) * gust_std[n, 2] ** 2
        for i in range(4):
            for j in range(4):
                if i > 0 or j > 0:
                    cov[up[i], up[j]] += fresh[i, j] * q
        for a in range(4):
            for j in range(1, 4):
                cov[3 + a, up[j]] += 0.5 * step * gust[n, 3 + a, 2] * fresh[0, j] * q
                cov[up[j], 3 + a] = cov[3 + a, up[j]]
        for i in range(4):
            cov[3 + i, 3 + i] += process[3 + i] ** 2
        for k in range(7):
            spreads[n, k] = np.inf
            out[n, k] = 0.0
            for i in range(10):
                gains[n, k, i] = 0.0
            if not np.isfinite(measured[n, k]):
                continue
            if k >= 3 and begun[k - 3] == 0.0:  # the first reading is where the count begins
                begun[k - 3] = 1.0
                x[k] = measured[n, k]
                cov[k, :] = 0.0
                cov[:, k] = 0.0
                cov[k, k] = noise[k] ** 2
                spreads[n, k] = RESTART
                continue
            row[:] = 0.0
            if k < 3:
                row[0], row[1] = gust[n, k, 0], gust[n, k, 1]
                row[8], row[9] = gust[n, k, 2] + sooner[n, k], -sooner[n, k]
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
            for i in range(10):
                gains[n, k, i] = ph[i] / s2
                x[i] += ph[i] / s2 * nu
            for i in range(10):
                for j in range(10):
                    cov[i, j] -= ph[i] * ph[j] / s2
    return total


def answer(
    pipeline: Pipeline, parameters: Floats, geometry: NDArray[np.void], inertia: Floats, arm: Floats, grid: Grid,
    wind: Floats, puff: Floats,
) -> Floats:  # fmt: skip
    """The model's answer (N, 7) along a grid with these `parameters`; the pipeline itself is not touched.

    geometry (1,) GEOMETRY; inertia (3,) [kg m^2]; arm (3,) [m] of the inertial sensor; wind (3,): see `along`; puff
    (3,) or (N, 3).
    """
    first = grid.table[0]
    state = pipeline.state.copy()
    signals = np.zeros(1, dtype=SIGNALS)
    signals[0] = pipeline.signals()
    s = signals[0]
    r = first[ROTATION : ROTATION + 9].reshape(3, 3)
    s["velocity"], s["up"] = r.T @ (first[VELOCITY : VELOCITY + 3] - wind), r[2]
    s["height"], s["density"], s["rotor_speed"] = first[HEIGHT], first[DENSITY], first[ROTOR]
    for k, name in enumerate(("collective", "lateral", "longitudinal", "tail", "throttle")):
        s[name] = first[CONTROLS + k]
    held = pipeline.state_index("engine.speed")
    settle(
        pipeline.kernels, pipeline.spans, s, geometry[0], state, parameters, SETTLE_TICK, SETTLE_TICKS, held,
        float(first[ROTOR]),
    )  # fmt: skip
    for name in GROWING:
        index = pipeline.state_index(name)
        if index >= 0:
            state[index] = pipeline.state[index]
    s["time"] = 0.0
    out = np.empty((len(grid.edges) - 1, 7))
    puff = np.zeros((len(out), 3)) + puff
    along(
        pipeline.kernels, pipeline.spans, signals, geometry, state, parameters, held, grid.edges, grid.table, wind,
        puff, inertia, arm, out,
    )  # fmt: skip
    return out

"""What a small change of the measurements, or of the model, does to a filter's innovations.

Along a recorded way both filters are linear, so the change follows by the same gains, for many candidates at once.
"""

import numba
import numpy as np

from identification.kinematics import B_G, PHI, STATES, V, transition


@numba.njit(cache=True, nogil=True)
def sensor_signatures(way, rows, gains, answers, first, step, decay, dz, df, dw, begin):
    """Whitened change of the innovations (M, C) of `kinematics.track`.

    way, rows, gains, answers, first, decay: as there; step [s] of a node. dz (M, C): change of every scalar
    measurement; df, dw (N, 3, C): change of the inertial sensor's force and rate, mean of the node, body axes;
    begin (STATES, C): of what the filter believes at the start.
    """
    measured, columns = dz.shape
    out = np.zeros((measured, columns))
    x = begin.copy()
    change = np.empty(columns)
    for n in range(len(first) - 1):
        r = way[n, 3:12].copy().reshape(3, 3)
        transition(step, way[n, :3], way[n, 12:15], r, decay, x)
        for c in range(columns):
            for i in range(3):
                push = 0.0
                turn = 0.0
                for j in range(3):
                    push += r[i, j] * df[n, j, c]
                    turn += r[i, j] * dw[n, j, c]
                x[V + i, c] += step * push
                x[i, c] += 0.5 * step * step * push
                x[PHI + i, c] += step * turn
        for m in range(first[n], first[n + 1]):
            weight = answers[m, 2]
            if weight == 0.0:
                continue
            for c in range(columns):
                change[c] = dz[m, c]
            for j in range(3):  # a rate that is read too much is a bias that was not taken off
                h = rows[m, B_G + j]
                if h != 0.0:
                    for c in range(columns):
                        change[c] += h * dw[n, j, c]
            for i in range(STATES):
                h = rows[m, i]
                if h != 0.0:
                    for c in range(columns):
                        change[c] -= h * x[i, c]
            scale = np.sqrt(weight) / answers[m, 1]
            for c in range(columns):
                out[m, c] = scale * change[c]
            for i in range(STATES):
                g = gains[m, i]
                if g != 0.0:
                    for c in range(columns):
                        x[i, c] += g * change[c]
    return out


@numba.njit(cache=True, nogil=True)
def drive_signatures(gust, sooner, follow, gains, spreads, step, keep, model, measured):
    """Whitened change of the innovations (N, 7, C) of `dynamics.innovations` by changed model or measurement.

    gust (N, 7, 3), sooner (N, 3), follow: what a gust does to the model's force, angular and rotor acceleration, and
    how soon, see there. gains (N, 7, 10) of each scalar, spreads (N, 7) standard deviations of the innovations (inf:
    not used, negative: the count begins there).
    keep (N, 3): factor of the gust a node.
    model (N, 7, C): change of the model's answer. measured (N, 7, C): change of force, rate and rotor speed measured.
    """
    nodes, _, columns = model.shape
    out = np.zeros((nodes, 7, columns))
    x = np.zeros((10, columns))  # as there
    for n in range(nodes):
        for c in range(columns):
            up, followed = x[2, c], x[7, c]
            for i in range(1, 4):
                x[6 + i, c] = follow[i, 0] * up + follow[i, 1] * followed
            for i in range(4):
                push = model[n, 3 + i, c]
                for j in range(3):
                    push += 0.5 * gust[n, 3 + i, j] * (1.0 + keep[n, j]) * x[j, c]
                x[3 + i, c] += step * push
            for i in range(3):
                x[i, c] *= keep[n, i]
        for k in range(7):
            if spreads[n, k] < 0.0:
                for c in range(columns):
                    x[k, c] = measured[n, k, c]
            if spreads[n, k] < 0.0 or not np.isfinite(spreads[n, k]):
                continue
            for c in range(columns):
                change = measured[n, k, c]
                if k < 3:
                    change -= model[n, k, c]
                    change -= gust[n, k, 0] * x[0, c] + gust[n, k, 1] * x[1, c] + gust[n, k, 2] * x[8, c]
                    change -= sooner[n, k] * (x[8, c] - x[9, c])
                else:
                    change -= x[k, c]
                out[n, k, c] = change / spreads[n, k]
                for i in range(10):
                    x[i, c] += gains[n, k, i] * change
    return out

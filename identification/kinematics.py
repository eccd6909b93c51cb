"""What the sensors say about the motion, whatever drives it: an error-state Kalman filter along a log.

The inertial sensor drives the motion; every other sensor corrects it, scalar by scalar. What is recorded of the way is
all that is linear about it (gains, rows, innovations), so that the effect of any small change of any measurement on
the innovations follows without running the filter again (`whitening`).

Error state, world axes: position, velocity, attitude (R = exp(phi) R^), then what the sensors' makers declare as
unknown: accelerometer and gyro bias, barometer bias and drift, GPS bias and wander, magnetometer bias, scale of the
ranger, scale and tilt of the down camera, what its errors of x, y, z and angle have in common for some seconds, in
units of the deviation that it states itself, the turn of the inertial sensor's case and the scale of its rates.
"""

import math

import numba
import numpy as np

from flightlog.constants import GRAVITY
from flightlog.rotations import from_vector, matrix, multiply

P, V, PHI, B_A, B_G = 0, 3, 6, 9, 12
BARO_BIAS, BARO_DRIFT, GPS_BIAS, GPS_WANDER, MAG = 15, 16, 17, 20, 23
SONAR_SCALE, CAMERA_SCALE, CAMERA_TILT, PAD_SLOW = 26, 27, 28, 30
CASE, RATE_SCALE = 34, 37
STATES = 40

# kinds of scalar measurement
GPS, GPS_V, BARO, SONAR, FIELD, PAD, PAD_ANGLE = 0, 3, 6, 7, 8, 11, 14
KINDS = 15
CHANNELS = (
    "gps.e", "gps.n", "gps.u", "gps.ve", "gps.vn", "gps.vu", "baro.altitude", "sonar.range", "mag.mx", "mag.my",
    "mag.mz", "pad.x", "pad.y", "pad.z", "pad.angle",
)  # fmt: skip

GATE, HUBER = 6.0, 3.0  # standard deviations: not used beyond the first, weighted down beyond the second
PATIENCE = 8  # readings of a kind beyond the gate, after which it is the filter that is wrong


@numba.njit(cache=True)
def _cross(a, b):
    c = np.empty(3)
    c[0] = a[1] * b[2] - a[2] * b[1]
    c[1] = a[2] * b[0] - a[0] * b[2]
    c[2] = a[0] * b[1] - a[1] * b[0]
    return c


@numba.njit(cache=True)
def predict(kind, dt, p, v, q, w, extra, setup, field, row):
    """What the sensor of `kind` should read in the state (p, v, q, rate w), and its row (STATES,).

    dt [s]: how much later that is than the state that the row is taken for. extra: biases (9,): baro, gps (3), mag (3),
    sonar scale, camera scale. setup (6, 3): lever arms of gps, sonar, baro
    and camera; row 4 [ranger's half beam, downwash of the barometer [m], -], row 5 unused.
    """
    row[:] = 0.0
    r = matrix(q)
    px, py, pz = p[0], p[1], p[2]
    if kind < BARO:
        axis = kind % 3
        if kind < GPS_V:
            arm = r @ setup[0]
            row[P + axis] = 1.0
            row[V + axis] = dt
            here = px if axis == 0 else (py if axis == 1 else pz)
            value = here + arm[axis] + extra[1 + axis]
            row[GPS_BIAS + axis] = 1.0
            row[GPS_WANDER + axis] = 1.0
        else:
            arm = r @ _cross(w, setup[0])
            row[V + axis] = 1.0
            value = v[axis] + arm[axis]
            # what the gyro reads too much turns the arm as well
            row[B_G] = r[axis, 1] * setup[0, 2] - r[axis, 2] * setup[0, 1]
            row[B_G + 1] = r[axis, 2] * setup[0, 0] - r[axis, 0] * setup[0, 2]
            row[B_G + 2] = r[axis, 0] * setup[0, 1] - r[axis, 1] * setup[0, 0]
        # d(R l) = phi x (R l)
        if axis == 0:
            row[PHI + 1], row[PHI + 2] = arm[2], -arm[1]
        elif axis == 1:
            row[PHI], row[PHI + 2] = -arm[2], arm[0]
        else:
            row[PHI], row[PHI + 1] = arm[1], -arm[0]
        return value
    if kind == BARO:
        arm = r @ setup[2]
        row[P + 2], row[V + 2] = 1.0, dt
        row[PHI], row[PHI + 1] = arm[1], -arm[0]
        row[BARO_BIAS] = row[BARO_DRIFT] = 1.0
        return pz + arm[2] + extra[0]
    if kind == SONAR:
        arm = r @ setup[1]
        tilt = max(0.0, math.acos(min(1.0, max(-1.0, r[2, 2]))) - setup[4, 0])
        scale = (1.0 + extra[7]) / math.cos(tilt)
        row[P + 2], row[V + 2] = scale, scale * dt
        row[PHI], row[PHI + 1] = arm[1] * scale, -arm[0] * scale
        value = (pz + arm[2]) * scale
        row[SONAR_SCALE] = value
        return value
    if kind < PAD:
        axis = kind - FIELD
        value = extra[4 + axis]
        for j in range(3):
            value += r[j, axis] * field[j]
        # d(R^T b) = R^T (b x phi)
        row[PHI] = r[1, axis] * field[2] - r[2, axis] * field[1]
        row[PHI + 1] = -r[0, axis] * field[2] + r[2, axis] * field[0]
        row[PHI + 2] = r[0, axis] * field[1] - r[1, axis] * field[0]
        row[MAG + axis] = 1.0
        return value
    if kind == PAD_ANGLE:
        # azimuth of the mark's axis (north) less that of the nose, which points up or down a little
        rise = r[2, 0] / (r[0, 0] ** 2 + r[1, 0] ** 2)
        row[PHI], row[PHI + 1], row[PHI + 2] = -rise * r[0, 0], -rise * r[1, 0], 1.0
        return -math.atan2(r[0, 0], r[1, 0])
    # the pad's centre in camera axes: x right = -left, y down in the picture = backward, z down
    away = np.empty(3)
    away[0], away[1], away[2] = -px, -py, -pz
    body = r.T @ away - setup[3]
    axis = kind - PAD
    of = 1 if axis == 0 else (0 if axis == 1 else 2)
    value = -body[of]
    for j in range(3):
        row[P + j] = r[j, of]
        row[V + j] = r[j, of] * dt
    row[PHI] = -(r[1, of] * away[2] - r[2, of] * away[1])
    row[PHI + 1] = -(-r[0, of] * away[2] + r[2, of] * away[0])
    row[PHI + 2] = -(r[0, of] * away[1] - r[1, of] * away[0])
    if axis == 2:
        row[CAMERA_SCALE] = value
        row[CAMERA_TILT], row[CAMERA_TILT + 1] = body[1], body[0]
        value *= 1.0 + extra[8]
    elif axis == 0:
        row[CAMERA_TILT] = -body[2]
    else:
        row[CAMERA_TILT + 1] = -body[2]
    return value


@numba.njit(cache=True)
def _back_then(late, share, i, end, p, v, q, w, motion, at_p, at_v):
    """Attitude (4,) `late` [s] after inertial sample i, `share` of the way to the next; out: position, velocity then.

    p, v, q: the state after sample `end`, with all that measurements have changed since; motion (S, 10): as the
    inertial samples alone led from one to the next. w (3,): rate.
    """
    turn = np.empty(3)
    following = min(i + 1, end)
    for k in range(3):
        gained = share * (motion[following, 3 + k] - motion[i, 3 + k])
        at_v[k] = v[k] + motion[i, 3 + k] - motion[end, 3 + k] + gained
        at_p[k] = p[k] + motion[i, k] - motion[end, k] + late * (at_v[k] - 0.5 * gained)
        turn[k] = w[k] * late
    undone = motion[end, 6:].copy()
    undone[1:] *= -1.0
    return multiply(multiply(q, multiply(undone, motion[i, 6:])), from_vector(turn))


@numba.njit(cache=True)
def transition(step, f, w, r, decay, x):
    """The error state's columns `x` (STATES, C) over a node of `step` [s].

    f (3,): force in world axes, w (3,): rate in body axes, r (3, 3): body to world. A case turned by m reads f + f x m
    and w + w x m.
    """
    e0 = r[0, 0] * f[0] + r[1, 0] * f[1] + r[2, 0] * f[2]
    e1 = r[0, 1] * f[0] + r[1, 1] * f[1] + r[2, 1] * f[2]
    e2 = r[0, 2] * f[0] + r[1, 2] * f[1] + r[2, 2] * f[2]
    for c in range(x.shape[1]):
        a0, a1, a2 = x[PHI, c], x[PHI + 1, c], x[PHI + 2, c]
        m0, m1, m2 = x[CASE, c], x[CASE + 1, c], x[CASE + 2, c]
        b0 = x[B_A, c] + e1 * m2 - e2 * m1
        b1 = x[B_A + 1, c] + e2 * m0 - e0 * m2
        b2 = x[B_A + 2, c] + e0 * m1 - e1 * m0
        # dv' = phi x f - R b_a, dphi' = -R b_g
        d0 = a1 * f[2] - a2 * f[1] - (r[0, 0] * b0 + r[0, 1] * b1 + r[0, 2] * b2)
        d1 = a2 * f[0] - a0 * f[2] - (r[1, 0] * b0 + r[1, 1] * b1 + r[1, 2] * b2)
        d2 = a0 * f[1] - a1 * f[0] - (r[2, 0] * b0 + r[2, 1] * b1 + r[2, 2] * b2)
        x[P, c] += step * (x[V, c] + 0.5 * step * d0)
        x[P + 1, c] += step * (x[V + 1, c] + 0.5 * step * d1)
        x[P + 2, c] += step * (x[V + 2, c] + 0.5 * step * d2)
        x[V, c] += step * d0
        x[V + 1, c] += step * d1
        x[V + 2, c] += step * d2
        g0 = x[B_G, c] + x[RATE_SCALE, c] * w[0] + w[1] * m2 - w[2] * m1
        g1 = x[B_G + 1, c] + x[RATE_SCALE + 1, c] * w[1] + w[2] * m0 - w[0] * m2
        g2 = x[B_G + 2, c] + x[RATE_SCALE + 2, c] * w[2] + w[0] * m1 - w[1] * m0
        for i in range(3):
            x[PHI + i, c] -= step * (r[i, 0] * g0 + r[i, 1] * g1 + r[i, 2] * g2)
        for i in range(B_A, STATES):
            x[i, c] *= decay[i]


@numba.njit(cache=True, nogil=True)
def track(
    imu_t, imu, edges, first, kinds, times, values, stds, slow, shifts, start, setup, field, prior, noise, decay, way,
    motion, rows, gains, answers,
):
    """Filter a log; returns the biases (STATES,) at its end and their variances.

    In and out:

        imu_t (S,), imu (S, 6): inertial samples. edges (N + 1,): the sample at which each node begins.
        first (N + 1,): the measurement at which each node's begin; kinds, times, values, stds (M,).
        slow (M,): deviation of what a measurement's errors have in common for some seconds.
        shifts (M,): what the model adds to the prediction beside the state (downwash of the barometer) [unit].
        start (10,): position, velocity, quaternion. setup, field: see `predict`.
        prior, noise, decay (STATES,): variance at the start, variance added a node, factor a node.
        way (N, 15), out: force (3) in world axes and rotation (9) of the node, mean rate (3) in body axes.
        motion (S, 10), out: position, velocity, quaternion after each inertial sample.
        rows, gains (M, STATES), answers (M, 3), out: innovation, its standard deviation, weight (0: not used).
    """
    p, v, q = start[:3].copy(), start[3:6].copy(), start[6:10].copy()
    biases = np.zeros(STATES)
    cov = np.diag(prior)
    extra = np.zeros(9)
    row = np.empty(STATES)
    at_p, at_v, at_w = np.empty(3), np.empty(3), np.empty(3)
    shut = np.zeros(KINDS, dtype=np.int64)
    nodes = len(edges) - 1
    t = imu_t[edges[0]]
    for n in range(nodes):
        begin = t
        force = np.zeros(3)
        rate = np.zeros(3)
        middle = matrix(q)
        count = 0
        for i in range(edges[n], edges[n + 1]):
            dt = imu_t[i] - t
            t = imu_t[i]
            w = np.empty(3)
            turn = np.empty(3)
            before = max(i - 1, 0)  # a sample of the rate is of its instant
            for k in range(3):
                w[k] = 0.5 * (imu[before, 3 + k] + imu[i, 3 + k]) - biases[B_G + k]
            seen = _cross(w, biases[CASE : CASE + 3])
            for k in range(3):
                w[k] -= seen[k] + biases[RATE_SCALE + k] * w[k]
                turn[k] = w[k] * dt
            half = matrix(multiply(q, from_vector(0.5 * turn)))
            q = multiply(q, from_vector(turn))
            q /= math.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
            push = imu[i, :3] - biases[B_A : B_A + 3]
            f = half @ (push - _cross(push, biases[CASE : CASE + 3]))
            for k in range(3):
                force[k] += f[k]
                rate[k] += w[k]
                a = f[k] - (GRAVITY if k == 2 else 0.0)
                p[k] += dt * (v[k] + 0.5 * dt * a)
                v[k] += dt * a
            motion[i, :3], motion[i, 3:6], motion[i, 6:] = p, v, q
            count += 1
            if 2 * count <= edges[n + 1] - edges[n]:
                middle = half
        count = max(count, 1)
        force /= count
        rate /= count
        step = t - begin
        way[n, :3], way[n, 12:15] = force, rate
        way[n, 3:12] = middle.ravel()
        transition(step, force, rate, middle, decay, cov)
        cov = np.ascontiguousarray(cov.T)
        transition(step, force, rate, middle, decay, cov)
        for i in range(STATES):
            cov[i, i] += noise[i]
        end = edges[n + 1] - 1
        here = min(edges[n], end)
        for m in range(first[n], first[n + 1]):
            kind = kinds[m]
            while here < end and imu_t[here + 1] <= times[m] + 1e-9:
                here += 1
            late, following = times[m] - imu_t[here], min(here + 1, end)
            share = min(max(late / (imu_t[following] - imu_t[here]), -1.0), 1.0) if following > here else 0.0
            for k in range(3):
                at_w[k] = imu[here, 3 + k] + share * (imu[following, 3 + k] - imu[here, 3 + k]) - biases[B_G + k]
            seen = _cross(at_w, biases[CASE : CASE + 3])
            for k in range(3):
                at_w[k] -= seen[k] + biases[RATE_SCALE + k] * at_w[k]
            at_q = _back_then(late, share, here, end, p, v, q, at_w, motion, at_p, at_v)
            extra[0] = biases[BARO_BIAS] + biases[BARO_DRIFT]
            for k in range(3):
                extra[1 + k] = biases[GPS_BIAS + k] + biases[GPS_WANDER + k]
                extra[4 + k] = biases[MAG + k]
            extra[7], extra[8] = biases[SONAR_SCALE], biases[CAMERA_SCALE]
            value = predict(kind, times[m] - t, at_p, at_v, at_q, at_w, extra, setup, field, row) + shifts[m]
            if PAD <= kind < PAD_ANGLE:
                for k in range(2):
                    value += row[CAMERA_TILT + k] * biases[CAMERA_TILT + k]
            if kind >= PAD:
                row[PAD_SLOW + kind - PAD] = slow[m]
                value += slow[m] * biases[PAD_SLOW + kind - PAD]
            innovation = values[m] - value
            if kind == PAD_ANGLE:
                innovation -= math.pi * round(innovation / math.pi)
            ph = cov @ row
            s = math.sqrt(row @ ph + stds[m] ** 2)
            size = abs(innovation) / s
            shut[kind] = 0 if size <= GATE else shut[kind] + 1
            lost = kind != SONAR and shut[kind] > PATIENCE  # a ranger may well speak nonsense for long
            weight = 1.0 if size <= HUBER else (HUBER / size if size <= GATE or lost else 0.0)
            answers[m, 0], answers[m, 1], answers[m, 2] = innovation, s, weight
            gain = ph * (weight / (s * s))
            rows[m], gains[m] = row, gain
            if weight == 0.0:
                continue
            # Joseph's form for a gain of which only a share is taken
            for i in range(STATES):
                for j in range(STATES):
                    cov[i, j] += gain[i] * gain[j] * s * s - gain[i] * ph[j] - ph[i] * gain[j]
            dx = gain * innovation
            for k in range(3):
                p[k] += dx[P + k]
                v[k] += dx[V + k]
            q = multiply(from_vector(dx[PHI : PHI + 3]), q)
            for i in range(B_A, STATES):
                biases[i] += dx[i]
        for i in range(B_A, STATES):
            biases[i] *= decay[i]
    return biases, np.diag(cov).copy()

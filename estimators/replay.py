"""What the delayed filter does, compiled: its memory is one record, and every function here works on that record.

See `estimators.delayed_kalman` for what it means. Measurements are scalars; epochs and measurements lie in order of
time, and stamps closer than a nanosecond are one instant.
"""

import math
from functools import lru_cache

import numba
import numpy as np

SOFT_GATE = 2.0  # [standard deviations] beyond it the gain is reduced; Lei 2012 equation 27
HARD_GATE = 5.0  # beyond it a measurement has no weight
TRUST = 1.0  # [s] a reference that was accepted within this time vouches for the filter
LONGEST_STEP = 0.1  # [s] longer gaps are crossed in several steps
AHEAD = 0.02  # [s] stamps this far ahead of the last epoch wait for theirs; later ones are impossible
SAME = 1e-9  # [s] stamps closer than this are the same instant

# outcomes of `insert`
TAKEN, STALE, FUTURE, DUPLICATE, NOT_FINITE = range(5)


@lru_cache(maxsize=32)  # one object for each type: comparing equal ones costs a call of the compiled functions 2 us
def memory_type(n: int, inputs: int, components: int, topics: int, epochs: int) -> np.dtype:
    """One record with all that the filter remembers."""
    square, rows = (n, n), (n, inputs)
    model: list[tuple[str, str, tuple[int, ...]]]
    model = [(name, "f8", square) for name in ("a1", "a2", "a3", "q1", "q2", "q3", "w1", "w2", "w3")]
    model += [(name, "f8", rows) for name in ("g1", "g2", "g3")]
    model += [("start", "f8", (n,)), ("states", "i8", ()), ("inputs", "i8", ())]
    model += [(name, "i8", (components,)) for name in ("topic", "patience", "jump", "reference", "copies")]
    work = [("x", "f8", (n,)), ("p", "f8", square), ("f", "f8", square), ("fp", "f8", square), ("gain", "f8", (n,))]
    epoch = [("t", "f8"), ("u", "f8", (inputs,)), ("noise", "f8"), ("x", "f8", (n,)), ("p", "f8", square)]
    epoch += [("rejections", "i8", (components,)), ("resets", "i8", (components,)), ("accepted", "f8", (topics,))]
    measurement = [("t", "f8"), ("component", "i8"), ("z", "f8"), ("variance", "f8"), ("row", "f8", (n,))]
    measurement += [("residual", "f8"), ("spread", "f8"), ("weight", "f8"), ("fresh", "i8")]
    return np.dtype(
        [
            ("epochs", "i8"),  # so far; number k lies at k modulo the ring's length
            ("stored", "i8"),  # measurements
            ("dirty", "f8"),  # [s] from here on all is to be computed anew
            ("rejected", "i8", (components,)),
            ("model", np.dtype(model, align=True)),
            ("work", np.dtype(work, align=True)),
            ("ring", np.dtype(epoch, align=True), (epochs,)),
            ("store", np.dtype(measurement, align=True), (epochs,)),
        ],
        align=True,
    )


@numba.njit(cache=True, error_model="numpy")
def _propagate(model, work, x, p, u, noise, dt):
    """Bring x (n,), p (n, n) `dt` [s] further, in place; third order in dt."""
    n, m = model.states, model.inputs
    f, fp = work.f, work.fp
    steps = max(1, math.ceil(dt / LONGEST_STEP - 1e-9))
    dt = dt / steps
    for _ in range(steps):
        for i in range(n):
            for j in range(n):
                f[i, j] = dt * (model.a1[i, j] + dt * (model.a2[i, j] + dt * model.a3[i, j]))
            f[i, i] += 1.0
        for i in range(n):
            s = 0.0
            for j in range(n):
                s += f[i, j] * x[j]
            for j in range(m):
                s += dt * (model.g1[i, j] + dt * (model.g2[i, j] + dt * model.g3[i, j])) * u[j]
            work.gain[i] = s
        x[:] = work.gain
        for i in range(n):
            for j in range(n):
                s = 0.0
                for k in range(n):
                    s += f[i, k] * p[k, j]
                fp[i, j] = s
        for i in range(n):
            for j in range(i + 1):
                s = 0.0
                for k in range(n):
                    s += fp[i, k] * f[j, k]
                s += dt * (model.q1[i, j] + dt * (model.q2[i, j] + dt * model.q3[i, j]))
                s += noise * dt * (model.w1[i, j] + dt * (model.w2[i, j] + dt * model.w3[i, j]))
                p[i, j] = s
                p[j, i] = s


@numba.njit(cache=True, error_model="numpy")
def _project(n, p, row, gain):
    """Put P H' into `gain`; returns H P H'."""
    total = 0.0
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += p[i, j] * row[j]
        gain[i] = s
        total += row[i] * s
    return total


@numba.njit(cache=True, error_model="numpy")
def _vouched(model, epoch, component, t):
    """Whether a reference of another topic was accepted lately."""
    for c in range(model.topic.shape[0]):
        topic = model.topic[c]
        if model.reference[c] and topic != model.topic[component] and t - epoch.accepted[topic] <= TRUST:
            return True
    return False


@numba.njit(cache=True, error_model="numpy")
def _copy(model, work, m):
    """A state becomes what the row of `m` says of all, as it is now."""
    x, p, gain, k = work.x, work.p, work.gain, model.copies[m.component]
    n = model.states
    variance = _project(n, p, m.row, gain) + m.variance
    value = 0.0
    for i in range(n):
        value += m.row[i] * x[i]
    for i in range(n):
        p[i, k] = gain[i]
        p[k, i] = gain[i]
    x[k], p[k, k] = value, variance
    m.residual, m.spread, m.weight = 0.0, variance, 1.0


@numba.njit(cache=True, error_model="numpy")
def _update(model, work, epoch, m):
    """Correct the state in `work` by the measurement `m`; counters in `epoch`."""
    x, p, row, gain, c = work.x, work.p, m.row, work.gain, m.component
    if model.copies[c] >= 0:
        _copy(model, work, m)
        return
    n = model.states
    explained = _project(n, p, row, gain)
    residual = m.z
    for i in range(n):
        residual -= row[i] * x[i]
    spread = explained + m.variance
    m.residual, m.spread = residual, spread
    ratio = abs(residual) / math.sqrt(spread)
    weight = 1.0 if ratio <= SOFT_GATE else SOFT_GATE / ratio
    declared = False
    if ratio > HARD_GATE:
        epoch.rejections[c] += 1
        weight = 0.0
        if epoch.rejections[c] >= model.patience[c]:
            if model.jump[c] >= 0:
                p[model.jump[c], model.jump[c]] += residual * residual
                declared = True
            elif explained > 0.0 and not _vouched(model, epoch, c, m.t):
                # begin anew from here, as unsure as at the start
                p[:, :] = 0.0
                for i in range(n):
                    p[i, i] = model.start[i]
                declared = True
    if declared:
        weight = 1.0
        epoch.resets[c] += 1
        spread = _project(n, p, row, gain) + m.variance
    m.weight = weight
    if weight == 0.0:
        return
    epoch.rejections[c] = 0
    epoch.accepted[model.topic[c]] = m.t
    # Joseph's form P = (I - K H) P (I - K H)' + K R K', the rank-one products taken one after the other
    fp = work.fp
    for i in range(n):
        k = weight * gain[i] / spread
        x[i] += k * residual
        for j in range(n):
            fp[i, j] = p[i, j] - k * gain[j]  # gain is still P H', so this is P - K H P
    for i in range(n):
        s = 0.0
        for j in range(n):
            s += fp[i, j] * row[j]
        ki = weight * gain[i] / spread
        for j in range(n):
            kj = weight * gain[j] / spread
            p[i, j] = fp[i, j] - s * kj + ki * m.variance * kj
    for i in range(n):
        for j in range(i):
            mean = 0.5 * (p[i, j] + p[j, i])
            p[i, j] = mean
            p[j, i] = mean


@numba.njit(cache=True, error_model="numpy")
def _replay(memory, first):
    """Compute the epochs from number `first` on anew; the one before it stands."""
    head = memory[0]
    ring, store, model, work = head.ring, head.store, head.model, head.work
    size = ring.shape[0]
    x, p = work.x, work.p
    last = ring[(first - 1) % size]
    x[:] = last.x
    p[:, :] = last.p
    t = last.t
    i = head.stored
    while i > 0 and store[i - 1].t > t + SAME:
        i -= 1
    for number in range(first, head.epochs):
        epoch, before = ring[number % size], ring[(number - 1) % size]
        epoch.rejections[:] = before.rejections
        epoch.resets[:] = before.resets
        epoch.accepted[:] = before.accepted
        while i < head.stored and store[i].t <= epoch.t + SAME:
            m = store[i]
            if m.t > t + SAME:
                _propagate(model, work, x, p, epoch.u, epoch.noise, m.t - t)
                t = m.t
            _update(model, work, epoch, m)
            if m.fresh:
                m.fresh = 0
                if m.weight == 0.0:
                    head.rejected[m.component] += 1
            i += 1
        if epoch.t > t + SAME:
            _propagate(model, work, x, p, epoch.u, epoch.noise, epoch.t - t)
        t = epoch.t
        epoch.x[:] = x
        epoch.p[:, :] = p


@numba.njit(cache=True, error_model="numpy")
def refresh(memory):
    """Replay from the earliest measurement that came in since the last time."""
    head = memory[0]
    ring = head.ring
    size = ring.shape[0]
    first = head.epochs
    while first > 1 and first - 1 > head.epochs - size and ring[(first - 1) % size].t + SAME >= head.dirty:
        first -= 1
    head.dirty = math.inf
    if first < head.epochs:
        _replay(memory, first)


@numba.njit(cache=True, error_model="numpy")
def advance(memory, t, u, noise):
    """A new epoch at `t`, reached with the inputs `u` (m,); False where it does not lie ahead."""
    head = memory[0]
    ring = head.ring
    size = ring.shape[0]
    if not t > ring[(head.epochs - 1) % size].t:
        return False
    epoch = ring[head.epochs % size]
    epoch.t, epoch.noise = t, noise
    for i in range(u.shape[0]):
        epoch.u[i] = u[i]
    head.epochs += 1
    head.dirty = min(head.dirty, t)
    refresh(memory)
    return True


@numba.njit(cache=True, error_model="numpy")
def insert(memory, t, component, row, z, variance):
    """Put a measurement where it belongs in time; one of the outcomes above."""
    head = memory[0]
    ring, store = head.ring, head.store
    size, capacity = ring.shape[0], store.shape[0]
    if not (math.isfinite(t) and math.isfinite(z) and math.isfinite(variance) and variance > 0.0):
        return NOT_FINITE
    oldest = ring[max(0, head.epochs - size) % size].t
    if t <= oldest + SAME:
        return STALE
    if t > ring[(head.epochs - 1) % size].t + AHEAD:
        return FUTURE
    # order of ties: by component, so that the order of arrival does not matter
    i = head.stored
    while i > 0 and (store[i - 1].t > t or (store[i - 1].t == t and store[i - 1].component > component)):
        i -= 1
    if i > 0 and store[i - 1].t == t and store[i - 1].component == component:
        return DUPLICATE
    if head.stored == capacity:
        drop = 0
        while drop < capacity and store[drop].t <= oldest + SAME:
            drop += 1
        drop = max(drop, 1)  # a flood: the oldest has had its effect on all states but those of a replay
        for j in range(drop, capacity):
            store[j - drop] = store[j]
        head.stored -= drop
        i = max(0, i - drop)
    for j in range(head.stored, i, -1):
        store[j] = store[j - 1]
    m = store[i]
    m.t, m.component, m.z, m.variance, m.fresh, m.weight = t, component, z, variance, 1, 0.0
    for j in range(row.shape[0]):
        m.row[j] = row[j]
    head.stored += 1
    head.dirty = min(head.dirty, t)
    return TAKEN


@numba.njit(cache=True, error_model="numpy")
def state_at(memory, t):
    """(x, P) at the time `t`: of the last epoch not after it, brought forward; measurements in between are left out."""
    head = memory[0]
    ring = head.ring
    size = ring.shape[0]
    number = head.epochs - 1
    while number > 0 and number > head.epochs - size and ring[number % size].t > t:
        number -= 1
    epoch = ring[number % size]
    x, p = epoch.x.copy(), epoch.p.copy()
    n = head.model.states
    if t > epoch.t:
        source = ring[min(number + 1, head.epochs - 1) % size]
        _propagate(head.model, head.work, x, p, source.u, source.noise, min(t - epoch.t, 1.0))
    return x[:n], p[:n, :n]

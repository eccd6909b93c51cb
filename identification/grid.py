"""What drives the model along a flight, laid out tick by tick: motion, rotor speed and controls as measured.

Two grids: the fine one has the simulator's own tick and is what answers are taken from; the coarse one has four times
its step and serves derivatives, which need not be exact.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d

from flightlog.atmosphere import density_at
from sim.schedule import TICK
from sim.wind.mean import sheared_speed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

STRIDE = 2  # inertial samples to a step of the coarse grid
# columns of a grid; SEEN: 1 where the tick ends with a sample of the rate; EARLY: the share that the tick's beginning
# has in that sample
DT, VELOCITY, ROTATION, HEIGHT, DENSITY, SHARE, RATES, ROTOR, CONTROLS, SEEN, EARLY = (
    0, 1, 4, 13, 14, 15, 16, 19, 20, 25, 26,
)  # fmt: skip
COLUMNS = 27


@dataclass(frozen=True, eq=False)
class Grid:
    """T ticks of N nodes."""

    edges: Ints  # (N + 1,) tick at which each node begins
    table: Floats  # (T, COLUMNS)


@dataclass(frozen=True, eq=False)
class Drive:
    """One flight's grids."""

    fine: Grid
    coarse: Grid
    arm: Floats  # (3,) of the inertial sensor
    surface_pressure: float
    surface_temperature: float


@dataclass(frozen=True, eq=False)
class Course:
    """What was measured, by inertial sample (S,)."""

    t: Floats
    motion: Floats  # (S, 10) position, velocity, quaternion after each sample
    rates: Floats  # (S, 3) without the rotor's shake
    rotor: Floats  # (S,) [rad/s]
    sent_t: Floats  # (C,) [s]
    sent: Floats  # (C, 5) controls in force from then on


def smooth(values: Floats, samples: int) -> Floats:
    """Mean over a turn of `samples`, centred (the ends count half), with its smear of slow changes taken back.

    2 S - S^2 keeps the zeros of the mean S at the turn's harmonics and errs by the square of what S errs.
    """
    weights = np.ones(samples + 1)
    weights[[0, -1]] = 0.5
    weights /= weights.sum()
    once = convolve1d(values, weights, axis=0, mode="nearest")
    return np.asarray(2.0 * once - convolve1d(once, weights, axis=0, mode="nearest"))


def lay(
    course: Course, edges: Ints, pressure: float, temperature: float, coarse: bool, shear: float = 1.0
) -> Grid:
    """A grid from a course; edges (N + 1,): inertial sample at which each node begins; shear: of the mean wind.

    A node's ticks are those that end with one of its samples or between it and the sample before.
    """
    t, last = course.t, int(edges[-1])
    step = float(np.median(np.diff(t)))
    if coarse:
        counts = -(-np.diff(edges) // STRIDE)
        node = np.repeat(np.arange(len(counts)), counts)
        place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        ends = np.minimum(edges[node] + STRIDE * (place + 1), edges[node + 1]) - 1
        end_t = t[ends]
        begin_t = np.concatenate([[t[0] - step], end_t[:-1]])
        middle = end_t - 0.5 * (end_t - begin_t) - 0.5 * TICK
        seen, early = np.ones(len(ends)), np.full(len(ends), 0.25)
    else:
        parts = max(1, min(8, round(step / TICK)))
        share = np.arange(1, parts + 1) / parts
        before = np.concatenate([[t[0] - step], t[: last - 1]])
        end_t = (before[:, None] + (t[:last] - before)[:, None] * share).ravel()
        begin_t = np.concatenate([[before[0]], end_t[:-1]])
        middle = begin_t  # the simulator's forces are those of where the tick begins
        seen = np.tile(np.arange(1, parts + 1) == parts, last).astype(float)
        early = np.zeros(len(seen))
        counts = np.diff(edges) * parts
    table = np.empty((len(end_t), COLUMNS))
    table[:, DT] = end_t - begin_t
    index = np.clip(np.searchsorted(t, middle), 1, len(t) - 1)
    part = np.clip((middle - t[index - 1]) / (t[index] - t[index - 1]), 0.0, 1.0)[:, None]
    motion = course.motion[index - 1] * (1.0 - part) + course.motion[index] * part
    table[:, VELOCITY : VELOCITY + 3] = motion[:, 3:6]
    turned = motion[:, 6:10] / np.linalg.norm(motion[:, 6:10], axis=1)[:, None]
    table[:, ROTATION : ROTATION + 9] = rotations(turned)
    table[:, HEIGHT] = motion[:, 2]
    table[:, DENSITY] = density_at(motion[:, 2], pressure, temperature)
    table[:, SHARE] = [sheared_speed(height, 1.0, shear) for height in motion[:, 2]]
    table[:, RATES : RATES + 3] = course.rates[index - 1] * (1.0 - part) + course.rates[index] * part
    table[:, ROTOR] = np.interp(middle, t, course.rotor)
    held = np.clip(np.searchsorted(course.sent_t, begin_t + 1e-9, side="right") - 1, 0, len(course.sent_t) - 1)
    table[:, CONTROLS : CONTROLS + 5] = course.sent[held]
    if coarse:  # two controls fall into a step: their mean
        late = np.clip(np.searchsorted(course.sent_t, end_t - step + 1e-9, side="right") - 1, 0, len(course.sent_t) - 1)
        table[:, CONTROLS : CONTROLS + 5] = 0.5 * (course.sent[held] + course.sent[late])
    table[:, SEEN], table[:, EARLY] = seen, early
    return Grid(np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), table)


def turned(grid: Grid, rates: Floats) -> Grid:
    """The grid with more rate: (N, 3) means of the nodes, body axes."""
    edges = grid.edges
    ends = np.cumsum(grid.table[:, DT])
    bounds = np.concatenate([[0.0], ends])[edges]
    middle = 0.5 * (bounds[1:] + bounds[:-1])
    table = grid.table.copy()
    for axis in range(3):
        table[:, RATES + axis] += np.interp(ends - 0.5 * table[:, DT], middle, rates[:, axis])
    return Grid(edges, table)


def sheared(grid: Grid, more: float) -> Grid:
    """The grid with `more` shear of the usual profile."""
    table = grid.table.copy()
    table[:, SHARE] += more * (np.array([sheared_speed(height, 1.0, 1.0) for height in table[:, HEIGHT]]) - 1.0)
    return Grid(grid.edges, table)


def rotations(q: Floats) -> Floats:
    """(T, 9) rotation matrices, row by row, of quaternions (T, 4)."""
    w, x, y, z = q.T
    return np.column_stack([
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ])  # fmt: skip

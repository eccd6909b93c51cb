"""What a log says of itself before it is filtered: echoes that stand alone, a receiver that stands far off the mark.

The filter of the motion is linear about what it believes, and a gate keeps out what it does not believe. Both need a
beginning that is nearly right also where a sensor is far from it.
"""

import numpy as np
from numpy.typing import NDArray

from flightlog.camera import DOWN
from flightlog.rotations import matrix
from identification import kinematics as k

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COMPANY, NEIGHBOURS, NEAR = 2, 2, 0.3  # [m] echoes that must be as near, of so many to either side
FEWEST = 20  # readings of the mark
FAR = 3.0  # standard deviations as declared, beyond which a receiver's error is taken from the mark
OPEN = 0.35  # [m] that attitude and the receiver's wander leave open in it


def lonely(heard: NDArray[np.bool_], values: Floats) -> NDArray[np.bool_]:
    """(N,) echoes that fewer than COMPANY of the samples next to them confirm: from nowhere, in all likelihood."""
    known = np.where(heard, values, np.nan)
    company = np.zeros(len(known), int)
    for shift in (*range(-NEIGHBOURS, 0), *range(1, NEIGHBOURS + 1)):
        other = np.full(len(known), np.nan)
        if shift > 0:
            other[shift:] = known[:-shift]
        else:
            other[:shift] = known[-shift:]
        company += np.abs(other - known) < NEAR
    return heard & (company < COMPANY)


def displaced(
    t: Floats, samples: Floats, kinds: Ints, times: Floats, values: Floats, setup: Floats, std: Floats
) -> tuple[Floats, Floats] | None:
    """Error (3,) [m] of a receiver's position at t[0] by the mark, and its standard deviation (3,); None where usual.

    t (S,), samples (S, 10): motion as first filtered, of which the attitude is used. kinds, times, values (M,): the
    measurements. setup: see `kinematics.predict`. std (3,) [m] of the error as declared.
    """
    seen, fixes = [kinds == k.PAD + i for i in range(3)], [kinds == k.GPS + i for i in range(3)]
    counts = {int(at.sum()) for at in seen}
    if len(counts) != 1 or min(counts) < FEWEST or min(int(at.sum()) for at in fixes) < 2:
        return None
    when, mark = times[seen[0]], np.column_stack([values[at] for at in seen])
    turns = [matrix(samples[i, 6:]) for i in np.clip(np.searchsorted(t, when), 0, len(t) - 1)]
    antenna = np.array([
        r @ (setup[0] - DOWN @ row - setup[3]) for r, row in zip(turns, mark, strict=True)
    ])  # fmt: skip
    fix = np.column_stack([np.interp(when, times[at], values[at]) for at in fixes])
    off, since = fix - antenna, when - t[0]
    half = since <= np.median(since)
    early, late = np.median(off[half], axis=0), np.median(off[~half], axis=0)
    apart = float(np.median(since[~half]) - np.median(since[half]))
    slope = (late - early) / max(apart, 1e-9)
    first = early - slope * float(np.median(since[half])) if apart > 2.0 else np.median(off, axis=0)
    if np.all(np.abs(first) < FAR * std) or np.any(np.abs(late - early) > 0.5 * np.abs(first).max()):
        return None
    return np.asarray(first), np.asarray(np.hypot(OPEN, np.abs(slope) * float(since[0])))

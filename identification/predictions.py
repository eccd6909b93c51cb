"""How far models get away from what was measured, set upon it every now and then: as in the file, refitted, extended.

A rig runs freely from its inputs. A helicopter is set upon the measured motion and goes where the model's force and
moment take it, both along the measured motion: within a few seconds what that leaves out is of second order.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightlog.rotations import matrix
from identification.beginning import SETTLED
from identification.bench import Bench
from identification.diagnosis import Diagnosis
from identification.free_run import rig_runs
from identification.helicopter import HelicopterBench
from identification.refit import Refit
from identification.report.unforeseen import best, foreseen
from identification.rig import RigBench
from identification.verdict import Prediction

Floats = NDArray[np.float64]

HORIZONS = (0.1, 0.5, 2.0, 5.0)  # [s]
RIG_HORIZONS = (0.5, 2.0, 5.0, 10.0)
EVERY = 2.5  # [s] the longest wait for a new start


def predictions(diagnosis: Diagnosis, heldout: Bench | None = None) -> Sequence[Prediction]:
    """Of the flights that were fitted, or of others; nothing for a bench whose motion the model does not run.

    Refitted: everything that may be off anyway, no cause; extended: with the causes that were found.
    """
    search = diagnosis.search
    bench: object = heldout if heldout is not None else diagnosis.bench
    refitted, extended = search.null, search.fit(diagnosis.causes)
    nominal = replace(refitted, at={}, step={key: 0.0 for key in refitted.step})
    fits = (nominal, refitted, extended)
    if isinstance(bench, RigBench):
        return list(_rig(bench, fits, heldout is not None))
    if isinstance(bench, HelicopterBench):
        return list(_helicopter(bench, fits, heldout is not None))
    return []


def _rig(bench: RigBench, fits: Sequence[Refit], heldout: bool) -> Iterator[Prediction]:
    values = [best(bench.nominal, fit) for fit in fits]
    courses = [nodes.course for flight in bench._flights for nodes in flight]
    for horizon in RIG_HORIZONS:
        long = [course for course in courses if len(course.angles) * course.dt >= horizon]
        if not long:
            return
        every = min(EVERY, horizon)
        errors = [
            np.concatenate([rig_runs(bench.vehicle, c, horizon, every, changes).errors for c in long])
            for changes in values
        ]
        for j, joint in enumerate(bench.vehicle.joints):
            yield _of(f"joints.{joint}", horizon, every, [e[:, :, j] for e in errors], heldout)


def _helicopter(bench: HelicopterBench, fits: Sequence[Refit], heldout: bool) -> Iterator[Prediction]:
    flights = range(len(bench.names))
    lacking = [[_lacking(bench, i, fit) for i in flights] for fit in fits]
    for horizon in HORIZONS:
        step = bench.flights[0].motion.step
        length, every = max(1, round(horizon / step)), min(EVERY, horizon)
        apart = max(1, round(every / step))
        ends: Mapping[str, list[Floats]] = {name: [] for name in ("velocity", "position", "rates")}
        begin = round(SETTLED / step)
        for of_fit in lacking:
            parts = [[part[s : s + length] for s in range(begin, len(part) - length, apart)] for part in of_fit]
            runs = np.array([run for one in parts for run in one])  # (runs, length, 6)
            if not len(runs):
                return
            moved = np.cumsum(runs, axis=1) * step
            ends["velocity"].append(moved[:, -1, :3])
            ends["position"].append(moved[:, :, :3].sum(axis=1) * step)
            ends["rates"].append(moved[:, -1, 3:])
        for name, errors in ends.items():
            yield _of(name, horizon, every, errors, heldout)


def _lacking(bench: HelicopterBench, flight: int, fit: Refit) -> Floats:
    """(N, 6) by which the model's acceleration in world axes and its angular one in body axes differ."""
    item = bench.flights[flight]
    answer = foreseen(bench, flight, fit)
    turning = np.zeros_like(item.measured[:, 3:6])
    turning[1:] = np.diff(item.measured[:, 3:6], axis=0) / item.motion.step
    rotation = np.array([matrix(q) for q in item.motion.attitude])
    force = np.einsum("nij,nj->ni", rotation, np.nan_to_num(answer[:, :3] - item.measured[:, :3]))
    return np.hstack([force, np.nan_to_num(answer[:, 3:6] - turning)])


def _of(channel: str, horizon: float, every: float, errors: Sequence[Floats], heldout: bool) -> Prediction:
    rms = [float(np.sqrt(np.mean(np.square(part)))) for part in errors]
    return Prediction(channel, horizon, every, rms[0], rms[1], rms[2], heldout)

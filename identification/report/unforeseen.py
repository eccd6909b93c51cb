"""What was measured less what the model says of it along the measured motion: inverse dynamics, in physical units."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.bench import Bench
from identification.dynamics import CHANNELS, UNITS
from identification.evidence import WINDY
from identification.helicopter import HelicopterBench
from identification.refit import Refit
from identification.report.drivers import drivers

Floats = NDArray[np.float64]

MEMORY = 5.0  # [s] of gusts: rows nearer than this to each other tell the same
BINS = 10
SIGMAS = 2.0


@dataclass(frozen=True, eq=False)
class Unforeseen:
    """One channel along one flight."""

    unit: str
    t: Floats  # (N,) [s]
    values: Floats  # (N,)


@dataclass(frozen=True, eq=False)
class Curve:
    """Means of one channel over one driver, all flights together."""

    channel: str
    unit: str
    driver: str
    label: str
    middles: Floats  # (B,)
    before: Floats  # (B,)
    after: Floats  # (B,)
    band: Floats  # (B,) scatter of a mean by gusts and noise

    @property
    def taken(self) -> float:
        """How much nearer to nothing the means have come, in squares of their scatter."""
        return float(np.sum((self.before**2 - self.after**2) / self.band**2))


def unforeseen(bench: Bench, flight: int, fit: Refit) -> Mapping[str, Unforeseen]:
    """By channel, at a refit's best values; empty for a bench that does not tell."""
    flown = helicopter(bench)
    if flown is not None:
        item = flown.flights[flight]
        left = item.measured.copy()
        left[1:, 3:] = np.diff(item.measured[:, 3:], axis=0) / item.motion.step  # rates and rotor speed
        left -= foreseen(flown, flight, fit)
        return {name: Unforeseen(UNITS[i], item.motion.t[1:], left[1:, i]) for i, name in enumerate(CHANNELS[:6])}
    own = getattr(bench, "unforeseen", None)  # {channel: (unit, t, values)}
    given = {} if own is None else own(flight, best(bench.nominal, fit))
    return {name: Unforeseen(*item) for name, item in given.items()}


def helicopter(bench: object) -> HelicopterBench | None:
    """The bench, if it is one of a helicopter."""
    return bench if isinstance(bench, HelicopterBench) else None


def best(nominal: Mapping[str, float], fit: Refit) -> dict[str, float]:
    """A refit's best values, by key."""
    return dict(fit.at) | {key: fit.at.get(key, nominal[key]) + step for key, step in fit.step.items()}


def foreseen(bench: HelicopterBench, flight: int, fit: Refit) -> Floats:
    """(N, 7) what the inertial sensor and the tachometer should say: the model, the mean wind, the sensor's errors."""
    sheet, values = bench.sheets[flight], best(bench.nominal, fit)
    knobs = {key: value for key, value in values.items() if key in bench.model.knobs}
    errors = {key: value - bench.nominal[key] for key, value in values.items() if key not in knobs}
    rows = bench.rows(flight, fit.at)
    residual = rows.residual + rows.local @ rows.at - sum(rows.signatures[key] * s for key, s in fit.step.items())
    scaled = rows.local * rows.local_std
    solved = rows.local_std * np.linalg.solve(np.eye(scaled.shape[1]) + scaled.T @ scaled, scaled.T @ residual)
    shared = [errors.get(key, 0.0) for key in WINDY]
    wind = np.array([*(solved[:2] + bench.vehicle.wind[:2] + shared), 0.0])
    return np.asarray(sheet.settled(knobs, errors, solved, wind).answer)


def curves(bench: Bench, before: Refit, after: Refit) -> Sequence[Curve]:
    """Every channel over every driver; those first from which most is taken."""
    flights = range(len(bench.names))
    old, new = ([unforeseen(bench, i, fit) for i in flights] for fit in (before, after))
    along = [drivers(bench, i) for i in flights]
    found = []
    for channel in old[0]:
        values = [np.concatenate([one[channel].values for one in many]) for many in (old, new)]
        step = float(np.median(np.diff(old[0][channel].t)))
        for driver, about in along[0].items():
            x = np.concatenate([a[driver].at(o[channel].t) for a, o in zip(along, old, strict=True)])
            curve = _binned(x, values, step)
            if curve is not None:
                found.append(Curve(channel, old[0][channel].unit, driver, about.label, *curve))
    return sorted(found, key=lambda c: -c.taken)


def _binned(x: Floats, values: Sequence[Floats], step: float) -> tuple[Floats, Floats, Floats, Floats] | None:
    good = np.isfinite(x) & np.isfinite(values[0]) & np.isfinite(values[1])
    if np.count_nonzero(good) < 4 * BINS:
        return None
    x, before, after = x[good], values[0][good], values[1][good]
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
    if len(edges) < 4:
        return None
    which = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(which, minlength=len(edges) - 1), 1)
    means = [np.bincount(which, v, len(edges) - 1) / count for v in (x, before, after)]
    told = np.maximum(count * step / MEMORY, 1.0)
    return means[0], means[1], means[2], SIGMAS * float(after.std()) / np.sqrt(told)

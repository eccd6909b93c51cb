"""What was measured less what the model says of it along the measured motion: inverse dynamics, in physical units."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from identification.beginning import SETTLED
from identification.bench import Bench
from identification.dynamics import CHANNELS, UNITS
from identification.evidence import WINDY
from identification.helicopter import HelicopterBench
from identification.multirotor.bench import MultirotorBench
from identification.refit import Refit
from identification.report.drivers import drivers
from identification.report.means import Course, binned, course
from identification.rig import RigBench
from identification.stack import Rows

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Unforeseen:
    """One channel along one flight, evenly in time; NaN where nothing was judged."""

    unit: str
    t: Floats  # (N,) [s]
    values: Floats  # (N,)


def at_rest(bench: Bench, fit: Refit, keys: Collection[str]) -> Refit:
    """The same causes at their best values, these numbers being as in the file; linear about where the fit went."""
    stack = fit.stack
    prior = dict(bench.tolerances) | {key: bench.spreads[key] for key in fit.values}
    std = np.array([0.0 if key in keys else prior.get(key, 0.0) for key in stack.keys])
    moved = np.array([fit.at[key] - bench.nominal[key] if key in fit.at else 0.0 for key in stack.keys])
    used = np.flatnonzero(std > 0.0)
    d = std[used]
    pull = d * (stack.score + stack.information @ moved)[used]
    inner = np.eye(len(used)) + d[:, None] * stack.information[np.ix_(used, used)] * d
    steps = d * np.linalg.solve(inner, pull) - moved[used]
    return replace(
        fit, at={key: value for key, value in fit.at.items() if key not in keys},
        step={stack.keys[i]: float(step) for i, step in zip(used, steps, strict=True)},
    )  # fmt: skip


class Linear(Protocol):
    """A bench of whatever vehicle."""

    def rows(self, flight: int, changes: Mapping[str, float]) -> Rows:
        """See `Bench.rows`."""
        ...


def unforeseen(bench: object, flight: int, fit: Refit) -> Mapping[str, Unforeseen]:
    """By channel, at a refit's best values; empty for a bench whose model answers neither force nor acceleration."""
    if isinstance(bench, HelicopterBench):
        item = bench.flights[flight]
        left = item.measured.copy()
        left[1:, 3:] = np.diff(item.measured[:, 3:], axis=0) / item.motion.step  # rates and rotor speed
        left -= foreseen(bench, flight, fit)
        left[item.motion.t < item.motion.t[0] + SETTLED] = np.nan
        return {name: Unforeseen(UNITS[i], item.motion.t[1:], left[1:, i]) for i, name in enumerate(CHANNELS[:6])}
    if isinstance(bench, MultirotorBench):
        return _multirotor(bench, flight, fit)
    return _rig(bench, flight, fit) if isinstance(bench, RigBench) else {}


def _multirotor(bench: MultirotorBench, flight: int, fit: Refit) -> Mapping[str, Unforeseen]:
    local, (columns, _) = followed(bench, flight, fit), bench._local(flight)
    found = {}
    for c, (seen, left) in enumerate(
        zip(bench.flights[flight].seen, bench._residual(flight, best(bench.nominal, fit)), strict=True)
    ):
        own = sum(size * column[c] for size, column in zip(local, columns, strict=True))
        about = bench.channels[seen.channel]
        found[about.name] = Unforeseen(about.unit, bench.flights[flight].t, left - own)
    return found


def _rig(bench: RigBench, flight: int, fit: Refit) -> Mapping[str, Unforeseen]:
    joints, stretches = list(bench.vehicle.joints), bench._flights[flight]
    defects = bench._defects(flight, best(bench.nominal, fit))
    t = np.concatenate([n.course.t[n.rows[:-1]] for n in stretches])
    lacking = np.concatenate(
        [-d[:, len(joints) :] / (n.length * n.course.dt) for d, n in zip(defects, stretches, strict=True)]
    )
    return {f"joints.{name}": Unforeseen("rad/s^2", t, lacking[:, i]) for i, name in enumerate(joints)}


def helicopter(bench: object) -> HelicopterBench | None:
    """The bench, if it is one of a helicopter."""
    return bench if isinstance(bench, HelicopterBench) else None


def best(nominal: Mapping[str, float], fit: Refit) -> dict[str, float]:
    """A refit's best values, by key."""
    return dict(fit.at) | {key: fit.at.get(key, nominal[key]) + step for key, step in fit.step.items()}


def followed(bench: Linear, flight: int, fit: Refit) -> Floats:
    """(L,) what belongs to one flight alone, where a refit's best values leave it."""
    rows = bench.rows(flight, fit.at)
    residual = rows.residual + rows.local @ rows.at - sum(rows.signatures[key] * s for key, s in fit.step.items())
    scaled = rows.local * rows.local_std
    solved = np.linalg.solve(np.eye(scaled.shape[1]) + scaled.T @ scaled, scaled.T @ residual)
    return np.asarray(rows.local_std * solved)


def foreseen(bench: HelicopterBench, flight: int, fit: Refit) -> Floats:
    """(N, 7) what the inertial sensor and the tachometer should say: the model, the mean wind, the sensor's errors."""
    sheet, values = bench.sheets[flight], best(bench.nominal, fit)
    knobs = {key: value for key, value in values.items() if key in bench.model.knobs}
    errors = bench.errors(values)
    solved = followed(bench, flight, fit)
    shared = [errors.get(key, 0.0) for key in WINDY]
    wind = np.array([*(solved[:2] + bench.vehicle.wind[:2] + shared), 0.0])
    return np.asarray(sheet.settled(knobs, errors, solved, wind).answer)


def lacking(bench: object) -> Sequence[str]:
    """Channels of `unforeseen`."""
    if isinstance(bench, HelicopterBench):
        return CHANNELS[:6]
    return [c.name for c in bench.channels.values()] if isinstance(bench, MultirotorBench | RigBench) else []


def curves(bench: Bench, before: Refit, after: Refit, channels: Collection[str]) -> Sequence[Course]:
    """Each of these channels, as far as it is one of a force, a moment or an acceleration, over every driver."""
    if not set(channels) & set(lacking(bench)):
        return []
    flights = range(len(bench.names))
    old, new = ([unforeseen(bench, i, fit) for i in flights] for fit in (before, after))
    along = [drivers(bench, i) for i in flights]
    found = []
    for channel, first in old[0].items():
        if channel not in channels:
            continue
        was, now = ([one[channel].values for one in many] for many in (old, new))
        good = [np.isfinite(a) & np.isfinite(b) for a, b in zip(was, now, strict=True)]
        was, now = ([np.where(g, v, np.nan) for g, v in zip(good, many, strict=True)] for many in (was, now))
        step = float(np.median(np.diff(first.t)))
        for driver, about in along[0].items():
            x = [a[driver].at(o[channel].t) for a, o in zip(along, old, strict=True)]
            bins = binned(x, [g & np.isfinite(part) for g, part in zip(good, x, strict=True)], about.near)
            if bins is not None:
                std = bins.scatter(now, step)
                found.append(course(channel, first.unit, driver, about.label, bins, was, now, std))
    return found

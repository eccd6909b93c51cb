"""Errors of a sensor that the other sensors speak against.

A gyro that reads a yaw rate 5 % too large turns the heading away from what magnetometer and mark say of it. Where they
do not find it so, and force and moment alone ask for it, the model is what is wrong.

Not where they find it too, only smaller: what a camera 85 ms late does is far from linear, and what is taken for it at
first is more than it does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from identification.bench import Bench
from identification.causes.contract import Cause
from identification.left_over import left_over
from identification.refit import Refit
from identification.stack import Rows, stack

Floats = NDArray[np.float64]

AGAINST = 10.0  # [nats] by which the sensors among themselves are likelier without it
AGREED = 0.25  # of its size, that the sensors find by themselves


def overruled(bench: Bench, cause: Cause, without: Refit, within: Refit) -> bool:
    """Whether the sensors of the motion are so much likelier without a cause that is an error of one of them."""
    sensors = getattr(bench, "sensor_channels", None)
    if sensors is None or cause.changes is None:
        return False
    cost = {}
    for name, fit in (("without", without), ("within", within)):
        parts = [left[np.isin(rows.channel, sensors)] for rows, left in left_over(bench, fit)]
        cost[name] = 0.5 * sum(float(part @ part) for part in parts)
    return cost["within"] - cost["without"] > AGAINST and _agreed(bench, cause, within) < AGREED


def _agreed(bench: Bench, cause: Cause, within: Refit) -> float:
    """Share of the cause's size that the sensors find without force and moment, by what they can tell."""
    sensors = getattr(bench, "sensor_channels", ())
    own = [p.key for p in cause.parameters]
    prior = {**bench.tolerances, **{key: bench.spreads[key] for key in within.values}}
    keys = [key for key, std in prior.items() if std > 0.0]
    flights = [_of(bench.rows(i, within.at), sensors) for i in range(len(bench.names))]
    s = stack(flights, keys)
    std = np.array([prior[key] for key in keys])
    moved = np.array([within.at.get(key, bench.nominal[key]) - bench.nominal[key] for key in keys])
    covariance = np.linalg.inv(s.information + np.diag(std**-2.0))
    mean = covariance @ (s.score + s.information @ moved)
    at = [keys.index(key) for key in own]
    size = np.array([within.values[key] - bench.nominal[key] for key in own])
    weight = np.linalg.solve(covariance[np.ix_(at, at)], size)
    return float(weight @ mean[at] / (weight @ size))


def _of(rows: Rows, channels: Sequence[int]) -> Rows:
    """The rows of some channels."""
    kept = np.isin(rows.channel, channels)
    return replace(
        rows, residual=rows.residual[kept], signatures={key: rows.signatures[key][kept] for key in rows.signatures},
        local=rows.local[kept], channel=rows.channel[kept], t=rows.t[kept], square=None,
    )  # fmt: skip

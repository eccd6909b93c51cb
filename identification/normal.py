"""A vehicle's numbers refitted to flights that are known to be good. Terms are never added."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.tables import Table
from identification import extension
from identification.bench import Bench
from identification.diagnosis import open_bench
from identification.refit import refit
from identification.stack import Stack

Floats = NDArray[np.float64]

Logs = Mapping[str, Mapping[str, Table]]


def refit_to(vehicle: Any, logs: Logs, path: Path) -> Any:
    """The vehicle with every toleranced number at its best values on these flights, written to `path`.

    Tolerances become what these flights leave open. A kind of vehicle whose bench has `nominal_fit()` decides itself
    which numbers its flights can tell. Raises UserError for a log that cannot carry it.
    """
    bench = open_bench(logs, vehicle)
    own = getattr(bench, "nominal_fit", None)
    keys, values, covariance = own() if own is not None else _null(bench)
    delta = extension.Delta(
        values=dict(zip(keys, values, strict=True)),
        causes=dict.fromkeys(keys, "normal flights"),
        units={key: bench.units[key] for key in keys},
        covariance=covariance,
        visited={},
    )
    return extension.write(vehicle, delta, {name: "" for name in logs}, path)


def _null(bench: Bench) -> tuple[list[str], list[float], Floats]:
    """Toleranced numbers of a bench with nothing wrong: keys, best values, covariance."""
    found = refit(bench, [])
    keys = [key for key, std in bench.tolerances.items() if std > 0.0]
    values = [found.at.get(key, bench.nominal[key]) + found.step[key] for key in keys]
    return keys, values, posterior(found.stack, keys, bench.tolerances)


def posterior(stack: Stack, keys: Sequence[str], std: Mapping[str, float]) -> Floats:
    """Covariance (K, K) of these numbers under independent priors."""
    where = stack.index(keys)
    scale = np.array([std[key] for key in keys])
    inner = np.eye(len(keys)) + scale[:, None] * stack.information[np.ix_(where, where)] * scale
    return np.asarray(scale[:, None] * np.linalg.inv(inner) * scale)

"""What the balances leave open, channel by channel: coloured noise as an autoregression, its inverse as a whitener."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz, toeplitz

Floats = NDArray[np.float64]

ORDER = 3  # nodes, where nothing else is said
RIDGE = 1e-3  # of the variance, white, so that a differentiated signal has an inverse
BLOCK = 14  # nodes that are averaged to see what slow noise the autoregression has missed

Spans = Sequence[tuple[int, int]]


@dataclass(frozen=True, eq=False)
class Autoregression:
    """r_t = sum a_i r_(t-i) + std e_t."""

    lags: Floats  # (P,) autocovariance from lag 0 on
    coefficients: Floats  # (P,)
    std: float

    @cached_property
    def _start(self) -> Floats:
        """(P, P) what whitens the first P values."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(toeplitz(self.lags))))

    def whiten(self, values: Floats, spans: Spans) -> Floats:
        """Rows (K, ...) -> (K, ...), each stretch for itself; its first rows as the stationary process has them."""
        found = np.empty_like(values)
        for a, b in spans:
            own = values[a:b]
            left = own.copy()
            for lag, coefficient in enumerate(self.coefficients, 1):
                left[lag:] -= coefficient * own[:-lag]
            found[a:b] = left / self.std
            head = min(len(self.lags), b - a)
            found[a : a + head] = np.tensordot(self._start[:head, :head], own[:head], axes=1)
        return found


def fit(parts: Sequence[Floats], spans: Sequence[Spans], order: int = ORDER) -> Autoregression:
    """By Yule and Walker from the residuals (K_i,) of several flights, each about nothing."""
    stretches = [part[a:b] for part, of in zip(parts, spans, strict=True) for a, b in of]
    total = sum(len(part) for part in stretches)
    lags = sum(np.array([part[lag:] @ part[: len(part) - lag] for lag in range(order + 1)]) for part in stretches)
    lags = np.asarray(lags, float) / total
    lags[0] = max(lags[0] * (1.0 + RIDGE), 1e-12)
    coefficients = np.asarray(solve_toeplitz(lags[:-1], lags[1:]))
    std = float(np.sqrt(max(lags[0] - coefficients @ lags[1:], 1e-12)))
    found = Autoregression(lags[:-1], coefficients, std)
    white = [found.whiten(part, of) for part, of in zip(parts, spans, strict=True)]
    more = max(_slow([w[a:b] for w, of in zip(white, spans, strict=True) for a, b in of]), 1.0)
    return Autoregression(lags[:-1] * more**2, coefficients, std * more)


def white(parts: Sequence[Floats], spans: Sequence[Spans], order: int = ORDER) -> Autoregression:
    """To begin with: as large as neighbours differ by, so that a slow course is not taken for noise."""
    steps = np.concatenate([np.diff(part[a:b]) for part, of in zip(parts, spans, strict=True) for a, b in of])
    std = max(float(np.sqrt(np.mean(steps**2) / 2.0)), 1e-6)
    return Autoregression(np.r_[std**2, np.zeros(order - 1)], np.zeros(order), std)


def _slow(parts: Sequence[Floats]) -> float:
    """Standard deviation of the means of blocks over what white noise would have; that of single nodes where larger."""
    means = np.concatenate([part[: len(part) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1) for part in parts])
    single = np.concatenate(parts)
    return float(max(np.sqrt(np.mean(means**2) * BLOCK), single.std())) if len(means) else float(single.std())

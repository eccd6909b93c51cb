"""Where one explanation beats another: the channel, and the part of the flights, in which the evidence accrues."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from identification.bench import Bench
from identification.left_over import left_over
from identification.search import Names, Search
from identification.stack import Rows
from identification.verdict import LostBecause

Floats = NDArray[np.float64]

Curves = Sequence[tuple[Floats, Floats]]  # by flight: times [s] and values


@runtime_checkable
class Driven(Protocol):
    """A bench that can say what residuals may depend on."""

    def courses(self) -> Sequence[tuple[str, str, Curves]]:
        """Name, unit and course of each."""
        ...


BANDS = 4  # into which each driver is cut, with equally many rows


def lost(search: Search, best: Names, loser: str) -> LostBecause | None:
    """Why the set `best` beats the best that the loser can do alone; None where the loser was never refitted."""
    if (loser,) not in search.refits:
        return None
    bench = search.bench
    winner, other = left_over(bench, search.fit(best)), left_over(bench, search.fit((loser,)))
    gain = [0.5 * (b**2 - a**2) for (_, a), (_, b) in zip(winner, other, strict=True)]
    by_channel = {
        number: sum(float(part[rows.channel == number].sum()) for part, (rows, _) in zip(gain, winner, strict=True))
        for number in bench.channels
    }
    number = max(by_channel, key=lambda n: by_channel[n])
    return LostBecause(bench.channels[number].name, _region(bench, number, [rows for rows, _ in winner], gain))


def _region(bench: Bench, number: int, rows: Sequence[Rows], gain: Sequence[Floats]) -> str:
    """The band of the driver in which a channel's evidence is densest, among those that stand out most."""
    drivers = bench.courses() if isinstance(bench, Driven) else []
    per_row = np.concatenate([g[r.channel == number] for r, g in zip(rows, gain, strict=True)])
    best = (0.0, "all of the flights")
    for name, unit, curves in drivers:
        parts = [np.interp(r.t[r.channel == number], t, v) for r, (t, v) in zip(rows, curves, strict=True)]
        values = np.concatenate(parts)
        for low, high in bands(values):
            inside = (values >= low) & (values <= high)
            dense = float(per_row[inside].sum() / max(np.sqrt(inside.sum()), 1.0))
            if dense > best[0]:
                best = dense, f"{name} {low:.3g} to {high:.3g} {unit}"
    return best[1]


def bands(values: Floats, count: int = BANDS) -> Sequence[tuple[float, float]]:
    """Cut a driver's range into bands with equally many rows."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, count + 1))
    return list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))

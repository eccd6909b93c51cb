"""Whether what is left under the best explanation can be a flight of this vehicle at all.

Noise is fitted to whatever no cause explains. Where that takes far more than any flight of a sound model does, or where
one sensor contradicts all others, log and vehicle do not belong together (swapped columns, another clock, another
vehicle) and the best of wrong explanations is not asserted.
"""

import numpy as np

from identification.evidence import DRIVEN
from identification.helicopter import HelicopterBench
from identification.left_over import left_over
from identification.search import Names, Search

FEWEST = 30  # rows of a channel that is looked at
CONTRADICTED = 5.0  # mean square of a sensor's innovations, in those expected
# [rad/s] that rates change by no cause in a node of 0.04 s: sound models below 0.002, wrong ones up to 0.02 and 0.01
SHAKEN = (0.02, 0.014, 0.025)
STRAINED = 8.0  # tolerances by which the best explanation moves a number: sound flights and right names, 4.4 at most
PLAY = 5.0  # times as much where servos have play


def doubt(search: Search, best: Names) -> str | None:
    """Why even the best explanation cannot be trusted; None where it can."""
    return _shaken(search, best) or contradicted(search, best) or _strained(search, best)


def _shaken(search: Search, best: Names) -> str | None:
    bench = search.bench
    if not isinstance(bench, HelicopterBench):
        return None
    # play is not in the model along which noise is fitted
    share = PLAY if "actuator_deadband" in best else 1.0
    rows = left_over(bench, search.fit(best))
    for i, (axis, usual) in enumerate(zip("xyz", SHAKEN, strict=True)):
        left = np.concatenate([part[(item.channel == DRIVEN + 3 + i) & (item.residual != 0.0)] for item, part in rows])
        found = float(np.sqrt(np.mean(left**2))) * bench.noise.process[3 + i] if len(left) else 0.0
        most = share * usual
        if found > most:
            return (
                f"controls and rates about {axis} have little to do with each other: {found / most:.1f} times what any "
                "flight of a sound model leaves open; swapped, of another clock, flight or vehicle, or in another unit"
            )
    return None


def _strained(search: Search, best: Names) -> str | None:
    bench = search.bench
    if not isinstance(bench, HelicopterBench) or "actuator_deadband" in best:
        return None
    fit = search.fit(best)
    own = {p.key for name in best for p in search.causes[name].parameters}
    off = {
        key: abs(fit.at.get(key, bench.nominal[key]) + fit.step.get(key, 0.0) - bench.nominal[key]) / std
        for key, std in bench.tolerances.items()
        if std > 0.0 and key not in own
    }
    worst = max(off, key=lambda key: off[key])
    if off[worst] <= STRAINED:
        return None
    blown = ", in wind as strong as this a gust's reach is not straight" if bench.caution > 1.0 else ""
    return (
        f"{worst} would have to be {off[worst]:.0f} of its tolerances from the vehicle file's value, and nothing that "
        f"has a name explains it better: another vehicle, or something wrong that no cause stands for{blown}"
    )


def contradicted(search: Search, best: Names) -> str | None:
    """Which sensor contradicts all others under the best explanation; None where none does."""
    rows = left_over(search.bench, search.fit(best))
    size: dict[str, float] = {}
    for number, channel in search.bench.channels.items():
        left = np.concatenate([part[(item.channel == number) & (item.residual != 0.0)] for item, part in rows])
        if number < DRIVEN and len(left) >= FEWEST:
            size[channel.name] = float(np.mean(left**2))
    worst = max(size, key=lambda name: size[name], default="")
    if size.get(worst, 0.0) <= CONTRADICTED:
        return None
    return (
        f"{worst} contradicts all else: innovations {size[worst]:.1f} times as large as expected (squared) under the "
        "best explanation; another clock, unit or axis, or a fault of no known kind"
    )

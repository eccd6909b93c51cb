"""What a multirotor does on the average of a flight: commands and voltage without what gusts and noise made of them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from identification.multirotor.motion import PASSING
from sim.multirotor.model import Inputs

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SMOOTH = 1.0  # [s] over which the voltage is smoothed
QUICK = 2.0  # [s] within which it follows the load alone


def settled(
    inputs: Inputs, velocity: Floats, first: Ints, spans: Sequence[tuple[int, int]], per_node: int
) -> Inputs:
    """Commands as they follow the voltage's slow course, that course, and this velocity (M, 3).

    What is not flown counts for nothing.
    """
    load = inputs.commands.mean(axis=1)
    voltage = inputs.voltage.copy()
    stretches = [slice(int(first[a]), int(first[b - 1]) + per_node) for a, b in spans]
    drop = _drop([load[s] for s in stretches], [voltage[s] for s in stretches], round(QUICK / inputs.step))
    for s in stretches:
        narrow, wide = (min(max(round(w / inputs.step), 1), s.stop - s.start) for w in (SMOOTH, PASSING))
        passing = load[s] - uniform_filter1d(load[s], wide, mode="nearest")
        voltage[s] = uniform_filter1d(voltage[s] + drop * passing, narrow, mode="nearest")
    commands = _followed(inputs.commands, voltage, (first[:, None] + np.arange(per_node)).ravel())
    return replace(inputs, commands=commands, voltage=voltage, velocity=velocity)


def _followed(commands: Floats, voltage: Floats, flown: Ints) -> Floats:
    """Commands (M, N) as they follow the voltage's slow course in the air, along a straight line; else their mean."""
    mean = commands[flown].mean(axis=0)
    low = voltage - voltage[flown].mean()
    if not np.isfinite(low[flown]).all() or np.ptp(low[flown]) == 0.0:
        return np.broadcast_to(mean, commands.shape)
    slope = low[flown] @ (commands[flown] - mean) / float(low[flown] @ low[flown])
    return np.asarray(np.clip(mean + np.nan_to_num(low)[:, None] * slope, 0.0, commands.max()))


def _drop(loads: Sequence[Floats], voltages: Sequence[Floats], width: int) -> float:
    """[V] that the voltage drops at once by full command, from what both do within `width` samples."""
    quick = [[x - uniform_filter1d(x, min(width, len(x)), mode="nearest") for x in xs] for xs in (loads, voltages)]
    load, voltage = (np.concatenate(parts) for parts in quick)
    return float(max(-(load @ voltage) / max(float(load @ load), 1e-12), 0.0))

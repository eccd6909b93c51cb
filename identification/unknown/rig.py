"""Effects that nobody foresaw on a rig: accelerations of its joints."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identification.rig import RigBench
from identification.unknown.bank import Columns, Way
from identification.unknown.drivers import Driver

Floats = NDArray[np.float64]


class RigBank:
    """See `bank.Bank`."""

    def __init__(self, bench: RigBench) -> None:
        """Of flights that are prepared."""
        self._bench = bench
        names = [channel.name for _, channel in sorted(bench.channels.items())]
        self._joints = names
        self.ways: Mapping[str, Way] = {name: Way(name, "rad/s^2", "joints", name) for name in names}

    def drivers(self, flight: int) -> Mapping[str, Driver]:
        """See `bank.Bank.drivers`: angle and rate of every joint, every input, at the beginning of each node."""
        rig, stretches = self._bench.vehicle, self._bench._flights[flight]
        t = np.concatenate([n.course.t[n.rows] for n in stretches])
        states = np.concatenate([n.states for n in stretches])
        inputs = np.concatenate([n.course.inputs[n.rows] for n in stretches])
        count = len(rig.joints)
        found = {joint: Driver("rad", states[:, i]) for i, joint in enumerate(rig.joints)}
        found |= {f"{joint}_rate": Driver("rad/s", states[:, count + i]) for i, joint in enumerate(rig.joints)}
        found |= {name: Driver(rig.units[name], inputs[:, i]) for i, name in enumerate(rig.inputs)}
        return found | {"time": Driver("s", t - t[0])}

    def columns(self, flight: int, way: str, shapes: Floats) -> Columns:
        """See `bank.Bank.columns`."""
        joint, count = self._joints.index(way), len(self._joints)
        parts: list[Floats] = []  # (N, 2 J, C) of each stretch: what the acceleration adds until the next node
        first = 0
        for nodes in self._bench._flights[flight]:
            h, own = nodes.length * nodes.course.dt, shapes[first : first + len(nodes.rows) - 1]
            first += len(nodes.rows)
            moved = np.zeros((len(own), 2 * count, shapes.shape[1]))
            moved[:, joint], moved[:, count + joint] = 0.5 * h * h * own, h * own
            parts.append(moved)
        nothing = [np.zeros(part.shape[:2]) for part in parts]
        slopes = [[part[:, :, c] for part in parts] for c in range(shapes.shape[1])]
        white = self._bench._whitened(flight, nothing, slopes)[1]  # (N, J, C)
        return Columns(slice(0, count * len(white)), white.transpose(1, 0, 2).reshape(count * len(white), -1))

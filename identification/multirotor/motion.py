"""What a multirotor's log says of its motion, on one grid of times."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flightlog.constants import GRAVITY
from flightlog.tables import Table

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_LIFT = 0.6 * GRAVITY  # [m/s^2] that the rotors carry in flight
PASSING = 4.0  # [s] that no passing load lasts
SHORT = 0.02  # [s] over which rates are averaged at the ends of a node

IMU = ("fx", "fy", "fz", "wx", "wy", "wz")
CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
UNITS = ("m/s^2", "m/s^2", "m/s^2", "rad/s^2", "rad/s^2", "rad/s^2")

WHOLE = (1.0,)
TWICE = (1 / 6, 4 / 6, 1 / 6)  # weights of the nodes in the second difference of means


@dataclass(frozen=True, eq=False)
class Seen:
    """One channel as measured: K nodes."""

    channel: int  # in CHANNELS
    measured: Floats  # (K,)
    kernel: tuple[float, ...]  # weights with which the model's nodes enter


def on(grid: Floats, t: Floats, values: Floats) -> Floats:
    """A column brought to a grid of times; NaN where there is nothing."""
    good = np.isfinite(values)
    return np.interp(grid, t[good], values[good]) if good.sum() > 1 else np.full(len(grid), np.nan)


def column(tables: Mapping[str, Table], topic: str, name: str, grid: Floats) -> Floats:
    """A topic's column brought to a grid of times; NaN where there is none."""
    if topic not in tables or name not in tables[topic]:
        return np.full(len(grid), np.nan)
    return on(grid, np.asarray(tables[topic]["t"], float), np.asarray(tables[topic][name], float))


class Motion:
    """What a log says of the motion, on one grid."""

    def __init__(self, tables: Mapping[str, Table], grid: Floats) -> None:
        self.grid = grid
        self._tables = tables
        height = self._get("u")
        if not np.isfinite(height).any():
            height = column(tables, "baro", "altitude", grid)
        start = height[np.isfinite(height)][:1]
        self.height: Floats = height - (start[0] if len(start) else 0.0)  # [m] above the start
        self._above = self._get("u")
        self._velocity = [self._get(name) for name in ("ve", "vn", "vu")]
        self.speed: Floats = np.hypot(self._velocity[0], self._velocity[1])
        self._roll, self._pitch, heading = (self._get(name) for name in ("roll", "pitch", "heading"))
        known = np.isfinite(heading).all()
        self._yaw = -np.unwrap(heading) if known else np.full(len(grid), np.nan)

    def height_of(self, airborne: bool) -> Floats:
        """(M,) [m] above the start; of a log that begins in the air above where its heights count from."""
        return self._above if airborne and np.isfinite(self._above).any() else self.height

    def _get(self, name: str) -> Floats:
        """A column of the reference, else of the estimate."""
        found = column(self._tables, "reference", name, self.grid)
        if np.isfinite(found).any():
            return found
        turning = name == "heading" and "estimate" in self._tables and name in self._tables["estimate"]
        if turning:
            table = self._tables["estimate"]
            t, values = np.asarray(table["t"], float), np.asarray(table[name], float)
            good = np.isfinite(values)
            return np.interp(self.grid, t[good], np.unwrap(values[good])) if good.sum() > 1 else found
        return column(self._tables, "estimate", name, self.grid)

    def body_velocity(self) -> Floats:
        """(M, 3) over ground in body axes, level where the attitude is not known; zeros for what is not known."""
        return np.nan_to_num(self._turned(np.column_stack(self._velocity), slice(None)))

    def _turned(self, world: Floats, at: slice) -> Floats:
        """Vectors (K, 3) east, north, up in body axes (forward, left, up), or as far as those are known."""
        turn = self._yaw[at] + np.pi / 2  # of x from east
        roll, pitch = np.nan_to_num(self._roll[at]), np.nan_to_num(self._pitch[at])
        east, north, up = world.T
        level = east * np.cos(turn) + north * np.sin(turn)
        left = -east * np.sin(turn) + north * np.cos(turn)
        if not np.isfinite(level).all():  # without a heading there is the climb
            return np.column_stack([level, left, up])
        ahead = level * np.cos(pitch) + up * np.sin(pitch)
        above = up * np.cos(pitch) - level * np.sin(pitch)
        return np.column_stack([
            ahead, left * np.cos(roll) + above * np.sin(roll), above * np.cos(roll) - left * np.sin(roll),
        ])  # fmt: skip

    def led(self, step: float, lift: Floats, first: Ints, per_node: int) -> Floats:
        """(M, 3) velocity in body axes, within each node as the tilted thrust alone makes it go on.

        step [s]: of the grid; lift (M,) [m/s^2]: by the nominal numbers; it carries the weight on average over PASSING.
        Where attitude or speed are not known the speed stays as the node begins.
        """
        found = self.body_velocity()
        if not all(np.isfinite(part).all() for part in (self._roll, self._pitch, self._yaw, *self._velocity)):
            for k in first:
                found[k : k + per_node] = found[k]
            return found
        push, velocity = self._push(step, lift), np.column_stack(self._velocity)
        nodes = [slice(k, min(k + per_node, len(found))) for k in first]
        gained = [step * (np.cumsum(push[n], axis=0) - 0.5 * (push[n] + push[n.start])) for n in nodes]
        # what drag has taken off meanwhile, whatever it is: the share a second by which all nodes end slower
        begins, ends = velocity[first], velocity[[n.stop - 1 for n in nodes]]
        middle = 0.5 * (begins + ends)[:, :2]
        lost = (begins + np.array([g[-1] for g in gained]) - ends)[:, :2]
        most = step * (per_node - 1) * float(np.sum(middle**2))
        rate = max(float(np.sum(lost * middle)), 0.0) / max(most, 1e-9)
        t = step * np.arange(per_node)[:, None]
        for n, v, more in zip(nodes, begins, gained, strict=True):
            there = v + more
            there[:, :2] -= rate * t[: len(more)] * (v + 0.5 * more)[:, :2]
            found[n] = self._turned(there, n)
        return found

    def _push(self, step: float, lift: Floats) -> Floats:
        """(M, 3) [m/s^2] east, north, up: of the thrust as it was tilted, and of the weight."""
        turn, upright = self._yaw + np.pi / 2, np.cos(self._roll) * np.cos(self._pitch)
        mean = uniform_filter1d(lift * upright, max(round(PASSING / step), 1), mode="nearest")
        share = lift / np.maximum(mean, LEAST_LIFT)
        ahead, left = -np.sin(self._pitch) * np.cos(self._roll), -np.sin(self._roll)
        east, north = ahead * np.cos(turn) - left * np.sin(turn), ahead * np.sin(turn) + left * np.cos(turn)
        found = GRAVITY * share[:, None] * np.column_stack([east, north, upright])
        found[:, 2] -= GRAVITY
        return np.asarray(found)

    def seen(self, first: Ints, per_node: int, step: float, by_estimate: bool) -> list[Seen]:
        """Channels as measured over the nodes that begin at these samples."""
        samples, length = first[:, None] + np.arange(per_node), per_node * step
        last = len(self.grid) - 1
        ends = np.minimum(np.column_stack([first, first + per_node]), last)
        width = max(round(SHORT / step), 1)
        if not by_estimate:
            imu = [column(self._tables, "imu", name, self.grid) for name in IMU]
            found = [Seen(i, imu[i][samples].mean(axis=1), WHOLE) for i in range(3)]
            for i in range(3):
                rate = uniform_filter1d(imu[3 + i], width)[ends]
                found.append(Seen(3 + i, (rate[:, 1] - rate[:, 0]) / length, WHOLE))
            return found

        def bend(values: Floats) -> Floats:
            """(K,) second difference of the means of nodes, over their length squared."""
            beside = [np.clip(samples + k * per_node, 0, last) for k in (-1, 0, 1)]
            before, here, behind = (values[at].mean(axis=1) for at in beside)
            return np.asarray(behind - 2.0 * here + before) / length**2

        found = []
        tilt = (np.cos(np.nan_to_num(self._roll)) * np.cos(np.nan_to_num(self._pitch)))[samples].mean(axis=1)
        climb = self._velocity[2]
        if np.isfinite(climb).all():
            rise = uniform_filter1d(climb, width)[ends]
            found.append(Seen(2, ((rise[:, 1] - rise[:, 0]) / length + GRAVITY) / tilt, WHOLE))
        elif np.isfinite(self.height).all():
            found.append(Seen(2, (bend(self.height) + GRAVITY) / tilt, TWICE))
        for i, angle in enumerate((self._roll, -self._pitch, self._yaw)):
            if np.isfinite(angle).all():
                found.append(Seen(3 + i, bend(angle), TWICE))
            else:
                found.append(Seen(3 + i, np.zeros(len(first)), WHOLE))
        return found

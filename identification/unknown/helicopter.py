"""Effects that nobody foresaw on a helicopter: force and moment on the body, drag on the rotor, errors of sensors."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from identification import kinematics as k
from identification.dynamics import CHANNELS
from identification.evidence import DRIVEN
from identification.helicopter import SCALAR_UNITS, HelicopterBench
from identification.unknown.bank import Columns, Way
from identification.unknown.drivers import Driver, drivers
from identification.whitening import sensor_signatures

Floats = NDArray[np.float64]

PLANT_UNITS = ("m/s^2",) * 3 + ("rad/s^2",) * 4
INERTIAL = ("imu.fx", "imu.fy", "imu.fz", "imu.wx", "imu.wy", "imu.wz")
VELOCITIES = ("gps.ve", "gps.vn", "gps.vu")


class HelicopterBank:
    """See `bank.Bank`."""

    def __init__(self, bench: HelicopterBench) -> None:
        """Of flights that are prepared."""
        self._bench = bench
        self._driven = [sheet.driven(sheet.at) for sheet in bench.sheets]  # its gains; they hold for any answer
        self._used = [bench.rows(i, {}).residual != 0.0 for i in range(len(bench.names))]
        seen = set.intersection(*({int(kind) for kind in np.unique(f.motion.kinds)} for f in bench.flights))
        # the side force is the tail rotor's, and apart from the others
        groups = [name if name == "force_y" else name[:-2] for name in CHANNELS[:6]]
        found = [Way(*way, way[0]) for way in zip(CHANNELS[:6], PLANT_UNITS, groups, strict=False)]
        found.append(Way(CHANNELS[6], PLANT_UNITS[6], "rotor", CHANNELS[6]))
        for kind in sorted(seen):
            name = k.CHANNELS[kind]
            unit = "m/s" if name in VELOCITIES else "rad" if kind == k.PAD_ANGLE else SCALAR_UNITS[name.split(".")[0]]
            found.append(Way(name, unit, "gps.v" if name in VELOCITIES else name.partition(".")[0], name))
        found += [
            Way(name, "m/s^2" if i < 3 else "rad/s", "imu", CHANNELS[i]) for i, name in enumerate(INERTIAL)
        ]
        self.ways: Mapping[str, Way] = {way.name: way for way in found}

    def drivers(self, flight: int) -> Mapping[str, Driver]:
        """See `bank.Bank.drivers`."""
        return drivers(self._bench.sheets[flight])

    def columns(self, flight: int, way: str, shapes: Floats) -> Columns:
        """See `bank.Bank.columns`."""
        scalars = len(self._bench.flights[flight].motion.kinds)
        if way in CHANNELS:
            parts, rows = self._plant(flight, CHANNELS.index(way), shapes), slice(scalars, None)
        elif way in INERTIAL:
            parts, rows = self._inertial(flight, INERTIAL.index(way), shapes), slice(0, None)
        else:
            parts, rows = self._sensor(flight, k.CHANNELS.index(way), shapes), slice(0, scalars)
        parts[~self._used[flight][rows]] = 0.0
        return Columns(rows, parts)

    def _plant(self, flight: int, channel: int, shapes: Floats) -> Floats:
        """Force [m/s^2], moment or rotor's torque [rad/s^2] that the model lacks."""
        answer = np.zeros((len(shapes), 7, shapes.shape[1]))
        answer[:, channel] = -shapes  # what is there and the model does not say
        if 3 <= channel < 6:
            axis = np.eye(3)[channel - 3]
            answer[:, :3] = -np.cross(axis, self._bench.flights[flight].drive.arm)[None, :, None] * shapes[:, None]
        white = self._driven[flight].whiten(answer)
        return white.reshape(7 * len(shapes), -1)

    def _sensor(self, flight: int, kind: int, shapes: Floats) -> Floats:
        motion = self._bench.flights[flight].motion
        dz = np.zeros((len(motion.kinds), shapes.shape[1]))
        at = motion.kinds == kind
        node = np.clip(np.searchsorted(motion.t, motion.times[at]), 0, len(shapes) - 1)
        dz[at] = shapes[node]
        nothing = np.zeros((len(shapes), 3, shapes.shape[1]))
        return self._above(flight, dz, nothing, nothing)

    def _inertial(self, flight: int, axis: int, shapes: Floats) -> Floats:
        motion = self._bench.flights[flight].motion
        force, rate = (np.zeros((len(shapes), 3, shapes.shape[1])) for _ in range(2))
        (force if axis < 3 else rate)[:, axis % 3] = shapes
        above = self._above(flight, np.zeros((len(motion.kinds), shapes.shape[1])), force, rate)
        measured = np.zeros((len(shapes), 7, shapes.shape[1]))
        measured[:, axis] = shapes
        driven = self._driven[flight].whiten(np.zeros_like(measured), measured)
        return np.concatenate([above, driven.reshape(7 * len(shapes), -1)])

    def _above(self, flight: int, dz: Floats, df: Floats, dw: Floats) -> Floats:
        m = self._bench.flights[flight].motion
        same = np.zeros((k.STATES, dz.shape[1]))
        found = sensor_signatures(m.way, m.rows, m.gains, m.answers, m.first, m.step, m.decay, dz, df, dw, same)
        return np.asarray(found, float)


assert DRIVEN > k.KINDS

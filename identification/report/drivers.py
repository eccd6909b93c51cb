"""What a residual may depend on, along each flight."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flightlog.rotations import angles
from identification.bench import Bench
from identification.helicopter import HelicopterBench
from identification.rig import RigBench
from identification.unknown.drivers import NEAR
from identification.unknown.drivers import drivers as along_air

Floats = NDArray[np.float64]

AIRSPEEDS = ("forward_speed", "left_speed")
RATES = ("roll_rate", "pitch_rate", "yaw_rate")
STICKS = ("collective", "lateral", "longitudinal", "tail")


@dataclass(frozen=True, eq=False)
class Driver:
    """A quantity along one flight."""

    label: str  # with its unit
    t: Floats  # (N,) [s] the log's own clock
    values: Floats  # (N,)
    near: float | None = None  # where what happens goes with the logarithm: its finest scale

    def at(self, t: Floats) -> Floats:
        """Values (R,) at times (R,)."""
        return np.asarray(np.interp(t, self.t, self.values))


def drivers(bench: Bench, flight: int) -> Mapping[str, Driver]:
    """By name. A bench that tells its own in `drivers(flight)`, as {name: (label, t, values)}, is believed."""
    own = getattr(bench, "drivers", None)
    if own is not None:
        return {name: Driver(*given) for name, given in own(flight).items()}
    of_kind: object = bench
    if isinstance(of_kind, HelicopterBench):
        return _helicopter(of_kind, flight)
    if isinstance(of_kind, RigBench):
        return _rig(of_kind, flight)
    t = np.unique(bench.rows(flight, {}).t)
    return {"time": Driver("time [s]", t, t - t[0])}


def _helicopter(bench: HelicopterBench, flight: int) -> Mapping[str, Driver]:
    """As it was before each node was measured: what the node's own noise made of it would depend on that."""
    motion, air = bench.flights[flight].motion, along_air(bench.sheets[flight])
    earlier = np.maximum(np.arange(len(motion.t)) - 1, 0)
    t, velocity, place = motion.t, motion.velocity[earlier], motion.position[earlier]
    tilt = np.degrees([angles(q) for q in motion.attitude[earlier]])
    found = {
        "height": ("height [m]", place[:, 2]),
        "speed": ("speed over ground [m/s]", np.hypot(velocity[:, 0], velocity[:, 1])),
        "climb": ("climb [m/s]", velocity[:, 2]),
        "roll": ("roll [deg]", tilt[:, 0]),
        "pitch": ("pitch [deg]", tilt[:, 1]),
        "east": ("speed east [m/s]", velocity[:, 0]),
        "north": ("speed north [m/s]", velocity[:, 1]),
        "rotor_speed": ("rotor speed [rad/s]", air["rotor_speed"].values),
    }
    found |= {name: (f"{name.replace('_', ' ')} through the air [m/s]", air[name].values) for name in AIRSPEEDS}
    found |= {name: (f"{name.replace('_', ' ')} [deg/s]", np.degrees(air[name].values)) for name in RATES}
    for name in STICKS:
        stick = np.degrees(air[name].values)
        found[name] = f"{name} [deg]", stick
        found[f"{name}_rate"] = f"rate of {name} [deg/s]", np.diff(stick, prepend=stick[0]) / motion.step
    found["time"] = "time [s]", t - t[0]
    made = {name: Driver(label, t, np.asarray(values)) for name, (label, values) in found.items()}
    return made | {"height": replace(made["height"], near=NEAR)}


def _rig(bench: RigBench, flight: int) -> Mapping[str, Driver]:
    rig, stretches = bench.vehicle, bench._flights[flight]
    t = np.concatenate([n.course.t[n.rows] for n in stretches])
    states = np.degrees(np.concatenate([n.states for n in stretches]))
    inputs = np.concatenate([n.course.inputs[n.rows] for n in stretches])
    count = len(rig.joints)
    found = {f"{joint}_rate": (f"{joint} rate [deg/s]", states[:, count + i]) for i, joint in enumerate(rig.joints)}
    found |= {joint: (f"{joint} [deg]", states[:, i]) for i, joint in enumerate(rig.joints)}
    found |= {name: (f"{name} [{rig.units[name]}]", inputs[:, i]) for i, name in enumerate(rig.inputs)}
    found["time"] = "time [s]", t - t[0]
    return {name: Driver(label, t, values) for name, (label, values) in found.items()}


# name in a vehicle file's box of validity, by driver
BOX = {"height": "height_m", "speed": "speed_m_s", "climb": "climb_m_s"}


def visited(bench: Bench) -> dict[str, tuple[float, float]]:
    """Least and greatest height, speed and climb on all flights: where what was found holds."""
    found: dict[str, tuple[float, float]] = {}
    for i in range(len(bench.names)):
        for name, driver in drivers(bench, i).items():
            if name not in BOX:
                continue
            low, high = float(np.nanmin(driver.values)), float(np.nanmax(driver.values))
            before = found.get(BOX[name], (low, high))
            found[BOX[name]] = min(low, before[0]), max(high, before[1])
    return found

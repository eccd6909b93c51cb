"""What a flight's sensors may be off by without anything being wrong, beside what the filter's own states hold."""

import numpy as np
from numpy.typing import NDArray

from identification import kinematics as k
from identification.causes import CATALOGUE, Change
from identification.flight import Flight
from identification.model import tolerance_of
from identification.sensor_statistics import LASTING
from identification.views import field_seen, pad_seen, rotations, scalars
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

MARK = 1.0  # [m] across, about, for what an edge's shift does to its distance
FORCE_FLOOR = 0.02  # [m/s^2] of offset that geometry and model leave open on any flight


def declared(flight: Flight, vehicle: Vehicle) -> list[tuple[str, Change, float]]:
    """Key, effect of one unit, and standard deviation of each."""
    return [*_inertial(flight, vehicle, False), *_turned(flight, vehicle), *_places(flight, vehicle)]


def offsets(flight: Flight, vehicle: Vehicle) -> list[tuple[str, Change, float]]:
    """Bias of force and rate, turn and scale of the rates as the model meets them.

    The filter of the motion has them as states and its innovations are free of them already.
    """
    numbers = vehicle.sensors["imu"].numbers
    found = []
    for axis in range(3):
        column = np.zeros((len(flight.motion.t), 3))
        column[:, axis] = 1.0
        std = float(np.hypot(numbers["accel_bias_std"], FORCE_FLOOR))
        found.append((f"local.force_{axis}", Change(force=column), std))
        found.append((f"local.rate_{axis}", Change(rate=column), numbers["gyro_bias_std"]))
    return found + _inertial(flight, vehicle, True)


def _inertial(flight: Flight, vehicle: Vehicle, followed: bool) -> list[tuple[str, Change, float]]:
    """Scale and turn of the inertial sensor; followed: those that the filter of the motion has as states."""
    numbers = vehicle.sensors["imu"].numbers
    found = []
    for name, of in (("imu_scale", ("accel_scale_std", "gyro_scale_std")), ("imu_misalignment", None)):
        cause = CATALOGUE[name]
        assert cause.changes is not None
        for parameter, change in zip(cause.parameters, cause.changes(flight, vehicle), strict=True):
            of_force = of is not None and parameter.name[0] == "f"
            std = numbers["misalignment_std"] if of is None else numbers[of[not of_force]]
            if of_force is not followed:
                found.append((f"local.{parameter.key}", change, std))
    return found


def _turned(flight: Flight, vehicle: Vehicle) -> list[tuple[str, Change, float]]:
    """The magnetometer's case against the body: what it adds changes with heading, which no bias does."""
    if not ((flight.motion.kinds >= k.FIELD) & (flight.motion.kinds < k.PAD)).any():
        return []
    field = field_seen(flight)
    std = vehicle.sensors["mag"].numbers["misalignment_std"]
    found = []
    for axis, along in enumerate(np.eye(3)):
        moved = -np.cross(along, field)
        change = Change(scalars(flight, *((k.FIELD + i, moved[:, i]) for i in range(3))))
        found.append((f"local.mag.turn_{axis}", change, std))
    return found


def _places(flight: Flight, vehicle: Vehicle) -> list[tuple[str, Change, float]]:
    """Where ranger and camera are mounted."""
    found = []
    if (flight.motion.kinds == k.SONAR).any():
        spread = float(tolerance_of(vehicle.document, "sensors.sonar.position", "m"))
        found.append(("local.sonar.position", Change(scalars(flight, (k.SONAR, 1.0))), spread))
        beam = float(tolerance_of(vehicle.document, "sensors.sonar.beam_half_angle", "rad"))
        found.append(("local.sonar.beam", Change(scalars(flight, (k.SONAR, _beamed(flight, vehicle)))), beam))
    if (flight.motion.kinds == k.PAD).any():
        spread = float(tolerance_of(vehicle.document, "cameras.down.position", "m"))
        for axis in range(3):
            found.append((f"local.down.position_{axis}", Change(scalars(flight, (k.PAD + axis, 1.0))), spread))
        found += _linear_late(flight, vehicle)
        if "pad" in vehicle.sensors:
            # edges that stand outward by so many pixels on a mark of a metre: it seems nearer by 2 z/(f m) of z
            depth = pad_seen(flight, vehicle)[:, 2]
            nearer = -2.0 * depth**2 / (vehicle.cameras["down"].model.fx * MARK)
            std = vehicle.sensors["pad"].numbers["bleed_std"]
            found.append(("local.down.bleed", Change(scalars(flight, (k.PAD + 2, nearer))), std))
    return found


def _linear_late(flight: Flight, vehicle: Vehicle) -> list[tuple[str, Change, float]]:
    """Turn and scale of the camera, once more.

    The filter has them as states, but takes their rows where it believes to be: in its first second that may be metres
    off, and what it then takes the turn for stays visible for long.
    """
    numbers = {topic: fitted.numbers for topic, fitted in vehicle.sensors.items()}
    if "pad" not in numbers:
        return []
    lasting = 2.0 * numbers["pad"]["tilt_tau"] / LASTING * numbers["pad"]["tilt_std"] ** 2
    turn = float(np.sqrt(numbers["imu"]["misalignment_std"] ** 2 + 2.0 * lasting))
    found = []
    for name, std in (("camera_tilt", turn), ("camera_focal", numbers["pad"]["scale_std"])):
        cause = CATALOGUE[name]
        assert cause.changes is not None
        for parameter, change in zip(cause.parameters, cause.changes(flight, vehicle), strict=True):
            found.append((f"local.{parameter.key}", change, std))
    return found


def _beamed(flight: Flight, vehicle: Vehicle) -> Floats:
    """(N,) [m/rad] what a wider beam takes off the range h/cos(tilt - beam) of a ranger tilted beyond it."""
    motion = flight.motion
    upright = rotations(flight)[:, 2, 2]
    beam = vehicle.sensors["sonar"].numbers["beam_half_angle"]
    beyond = np.maximum(np.arccos(np.clip(upright, -1.0, 1.0)) - beam, 0.0)
    return np.asarray(-motion.position[:, 2] * np.sin(beyond) / np.cos(beyond) ** 2)

"""What the sensors should have seen along a flight, and how fast it changes: the ground of the sensor causes."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from flightlog.camera import DOWN
from flightlog.constants import GRAVITY
from flightlog.rotations import matrix
from identification import kinematics as k
from identification.change import Change
from identification.flight import Flight
from sim.vehicle import Vehicle
from sim.world import MAGNETIC_FIELD

Floats = NDArray[np.float64]

SMOOTH = 5  # nodes over which a slope is taken
USUAL = {"gps": 0.1, "pad": 0.05}  # [s] by which a topic is late, if it is


def rotations(flight: Flight) -> Floats:
    """(N, 3, 3) body to world."""
    return np.array([matrix(q) for q in flight.motion.attitude])


def rate_of(values: Floats, flight: Flight) -> Floats:
    """Time derivative of what varies along the nodes (N, ...)."""
    smooth = uniform_filter1d(values, SMOOTH, axis=0)
    return np.asarray(np.gradient(smooth, flight.motion.t, axis=0))


def felt(flight: Flight) -> tuple[Floats, Floats]:
    """(N, 3) specific force [m/s^2] and (N, 3) rate [rad/s] in body axes, free of the inertial sensor's own noise."""
    motion = flight.motion
    force = rate_of(motion.velocity, flight) + [0.0, 0.0, GRAVITY]
    rate = motion.way[:, 12:15]
    return np.einsum("nji,nj->ni", rotations(flight), force), np.asarray(rate)


def pad_seen(flight: Flight, vehicle: Vehicle) -> Floats:
    """(N, 3) [m] the pad's centre in camera axes."""
    mount = vehicle.cameras["down"].mount.position
    body = np.einsum("nji,nj->ni", rotations(flight), -flight.motion.position) - mount
    return np.asarray(body @ DOWN)


def field_seen(flight: Flight) -> Floats:
    """(N, 3) [uT] the magnetic field in body axes."""
    return np.einsum("nji,j->ni", rotations(flight), MAGNETIC_FIELD)


def scalars(flight: Flight, *parts: tuple[int, Floats | float]) -> Floats:
    """(M,) zero but for some kinds: each with what holds along the nodes (N,), or a number."""
    motion = flight.motion
    out = np.zeros(len(motion.kinds))
    for kind, values in parts:
        at = motion.kinds == kind
        out[at] = values if np.isscalar(values) else np.interp(motion.times[at], motion.t, np.asarray(values))
    return out


def slopes(flight: Flight, vehicle: Vehicle) -> dict[int, Floats]:
    """By kind, how fast what it measures changes along the nodes (N,)."""
    motion = flight.motion
    r = rotations(flight)
    acceleration = _at_ends(motion.way[:, :3]) - [0.0, 0.0, GRAVITY]
    rate = _at_ends(motion.way[:, 12:15])
    if "gps" in vehicle.sensors:  # its antenna goes round the origin
        arm = np.broadcast_to(vehicle.sensors["gps"].position, rate.shape)
        round_it = np.einsum("nij,nj->ni", r, np.cross(rate, arm))
    else:
        round_it = np.zeros_like(rate)
    antenna = motion.velocity + round_it
    acceleration = acceleration + np.gradient(round_it, motion.t, axis=0)
    # of what stands still, seen from a body that turns: db/dt = -w x b - R^T v
    field = -np.cross(rate, field_seen(flight))
    away = np.einsum("nji,nj->ni", r, -motion.position)
    pad = (-np.cross(rate, away) - np.einsum("nji,nj->ni", r, motion.velocity)) @ DOWN
    # clockwise seen from above: the mark's angle grows as the nose turns left
    turning = np.einsum("nij,nj->ni", r, rate)[:, 2]
    return {
        **{k.GPS + i: antenna[:, i] for i in range(3)},
        **{k.GPS_V + i: acceleration[:, i] for i in range(3)},
        k.BARO: motion.velocity[:, 2],
        k.SONAR: motion.velocity[:, 2],
        **{k.FIELD + i: field[:, i] for i in range(3)},
        **{k.PAD + i: pad[:, i] for i in range(3)},
        k.PAD_ANGLE: turning,
    }


def _at_ends(means: Floats) -> Floats:
    """Of nodes' means (N, ...) what holds at their ends."""
    found = means.copy()
    found[:-1] = 0.5 * (found[:-1] + found[1:])
    return found


TOPICS = {
    "gps": tuple(range(k.GPS, k.GPS + 6)),
    "baro": (k.BARO,),
    "sonar": (k.SONAR,),
    "mag": (k.FIELD, k.FIELD + 1, k.FIELD + 2),
    "pad": (k.PAD, k.PAD + 1, k.PAD + 2, k.PAD_ANGLE),
}


def late(flight: Flight, vehicle: Vehicle, topic: str) -> Floats:
    """(M,) what a topic shows if it is one second later than its stamp says.

    To first order; where nothing is known of it yet, the mean over as much as it is usually late, since what moves
    meanwhile and comes back does not show in a slope.
    """
    far = 0.0 if topic in flight.late else USUAL.get(topic, 0.0)
    found, span = slopes(flight, vehicle), 1 + round(far / flight.motion.step)
    backward = {kind: uniform_filter1d(found[kind], span, origin=(span - 1) // 2) for kind in TOPICS[topic]}
    return scalars(flight, *((kind, -slope) for kind, slope in backward.items()))


def others_early(flight: Flight, vehicle: Vehicle) -> Change:
    """What all but the inertial sensor show if it is one second later than its stamp says, by its own clock.

    Commands, which act later by that clock, are added where the model's answer is known (`evidence`); the tachometer,
    whose speed drives the model too, is left out.
    """
    return Change(scalars(flight, *slopes(flight, vehicle).items()))

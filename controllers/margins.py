"""Stability margins of the whole pilot on a plant: every loop closed, one broken at its actuator at a time.

Exact for the sampled system: the plant under held inputs with the servos' delay, the controller as the loops compute
it, the navigator's delay between them. With L = -K P the loop through actuator i, all others closed, is 1/S_ii - 1
where S = (1 + L)^-1. The limits of the loops (tilt, speed, stops) are left out.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controllers.attitude import ESTIMATOR_DELAY, AttitudeGains
from controllers.gains import Gains
from controllers.plant import SAMPLE_TIME, LinearPlant, sample
from flightlog.constants import GRAVITY

Floats = NDArray[np.float64]
Response = NDArray[np.complexfloating]

# What the pilot is given, as differences from hover: level axes that share the machine's heading.
OUTPUTS = (
    "roll", "pitch", "heading", "wx", "wy", "wz",
    "v_forward", "v_right", "climb", "forward", "right", "height", "rotor_speed",
)  # fmt: skip
REQUIRED_GAIN_DB = 6.0
REQUIRED_PHASE_DEG = 45.0


@dataclass(frozen=True)
class Margins:
    """Of one loop, broken at its actuator; infinite where the loop never comes near."""

    actuator: str
    gain_up_db: float  # by which the loop's gain may grow
    gain_down_db: float  # by which it may fall
    phase_deg: float
    delay: float  # [s] that may be added
    crossover: float  # [rad/s] the highest at which the gain is one
    disk: float  # [1] alpha of the balanced disk: gain and phase together


def frequencies(count: int = 1000) -> Floats:
    """Frequencies [rad/s] from slow drift to almost half the sampling rate."""
    return np.geomspace(0.01, 0.98 * math.pi / SAMPLE_TIME, count)


def plant_response(plant: LinearPlant, omega: Floats) -> Response:
    """(N, 13, 5) from controls to OUTPUTS, under held inputs, with all delays."""
    n = len(plant.A)
    names = plant.state_names
    level = np.zeros((3, 3))  # forward, right, climb from vx, vy, vz at the trimmed attitude
    roll, pitch = plant.trim_roll, plant.trim_pitch
    level[0] = math.cos(pitch), -math.sin(pitch) * math.sin(roll), -math.sin(pitch) * math.cos(roll)
    level[1] = 0.0, -math.cos(roll), math.sin(roll)
    level[2] = math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll)
    a = np.zeros((n + 3, n + 3))
    a[:n, :n] = plant.A
    a[n:, [names.index(name) for name in ("vx", "vy", "vz")]] = level
    c = np.zeros((len(OUTPUTS), n + 3))
    for row, name in enumerate(OUTPUTS[:6]):
        c[row, names.index(name)] = 1.0
    c[6:9] = a[n:]
    c[9:12, n:] = np.eye(3)
    c[12, names.index("engine.speed")] = 1.0
    z = np.exp(1j * omega * SAMPLE_TIME)
    response = np.empty((len(omega), len(OUTPUTS), 5), dtype=complex)
    for column in range(5):
        b = np.vstack([plant.B[:, [column]], np.zeros((3, 1))])
        full, drive = sample(a, b, float(plant.delay[column]))
        reach = np.linalg.solve(z[:, None, None] * np.eye(len(full)) - full, drive.astype(complex))
        response[:, :, column] = (c @ reach[:, : n + 3])[:, :, 0]
    return response * np.exp(-1j * omega * ESTIMATOR_DELAY)[:, None, None]


def attitude_response(gains: AttitudeGains, z: Response) -> Response:
    """(N, 2, 4) from roll, pitch, wx, wy to lateral, longitudinal."""
    h, k = gains.hidden.shape[1], gains.sent.shape[1]
    from_hidden, from_seen, from_sent, from_now = np.split(gains.model, (h, h + 4, h + 4 + k), axis=1)
    history = (z[:, None] ** -np.arange(1, k // 2 + 1))[:, :, None, None] * np.eye(2)
    history = history.reshape(len(z), k, 2)  # cyclic sent earlier, from cyclic sent now
    moved = np.linalg.inv(z[:, None, None] * np.eye(h) - from_hidden)
    own = np.eye(2) + gains.hidden @ moved @ (from_sent @ history + from_now) + gains.sent @ history
    answer = -np.linalg.solve(own, (gains.measured + gains.hidden @ moved @ from_seen).astype(complex))
    return answer.astype(complex, copy=False)


def pilot_response(gains: Gains, omega: Floats) -> Response:
    """(N, 5, 13) from OUTPUTS to controls, as the loops in flight compute them between their limits."""
    z = np.exp(1j * omega * SAMPLE_TIME)
    later = SAMPLE_TIME / (z - 1.0)  # an integral that is used before it is brought up to date
    at = {name: i for i, name in enumerate(OUTPUTS)}
    k = np.zeros((len(omega), 5, len(OUTPUTS)), dtype=complex)

    tilt = np.zeros((len(omega), 2, len(OUTPUTS)), dtype=complex)  # roll and pitch wanted
    velocity = gains.velocity
    along = (velocity.proportional + velocity.integral * later * z) / GRAVITY
    for row, sign, speed, place in ((0, -1.0, "v_right", "right"), (1, 1.0, "v_forward", "forward")):
        tilt[:, row, at[speed]] = sign * along
        tilt[:, row, at[place]] = sign * along * gains.position.proportional
    attitude = attitude_response(gains.attitude, z)
    k[:, 1:3, [at[name] for name in ("roll", "pitch", "wx", "wy")]] = attitude
    k[:, 1:3] -= attitude[:, :, :2] @ tilt

    altitude = gains.altitude
    slope = altitude.thrust_pitch + 0.5 * altitude.inflow_pitch  # [rad] collective per load factor
    loop = -slope / GRAVITY * (altitude.climb + altitude.integral * later)
    k[:, 0, at["climb"]] = loop
    k[:, 0, at["height"]] = loop * altitude.height
    k[:, 0, at["roll"]] = slope * math.tan(gains.velocity.trim_roll) / math.cos(gains.velocity.trim_roll)
    k[:, 0, at["pitch"]] = slope * math.tan(gains.velocity.trim_pitch)
    k[:, 0, at["rotor_speed"]] = -(2.0 * altitude.thrust_pitch + altitude.inflow_pitch) / altitude.rotor_speed

    governor = gains.governor
    k[:, 4] = governor.collective * k[:, 0]
    k[:, 4, at["rotor_speed"]] -= governor.proportional + governor.integral * later

    heading = gains.heading
    engine = heading.engine_share / (1.0 - (1.0 - heading.engine_share) / z)
    torque = (heading.thrust_pitch + 0.5 * heading.inflow_pitch) / heading.trim_throttle
    k[:, 3] = torque * engine[:, None] * k[:, 4]
    k[:, 3, at["heading"]] -= heading.heading + heading.integral * later
    k[:, 3, at["wz"]] += heading.rate
    return k


def margins(gains: Gains, plant: LinearPlant) -> tuple[list[Margins], float]:
    """Margins of each actuator's loop, and the disk margin of all actuators at once."""
    omega = frequencies()
    loop = -pilot_response(gains, omega) @ plant_response(plant, omega)
    sensitivity = np.linalg.inv(np.eye(5) + loop)
    found = [loop_margins(name, omega, 1.0 / sensitivity[:, i, i] - 1.0) for i, name in enumerate(plant.input_names)]
    return found, float(1.0 / _diagonal_norm(sensitivity - 0.5 * np.eye(5)).max())


def _diagonal_norm(m: Response, rounds: int = 30) -> NDArray[Any]:
    """Upper bound (N,) of the structured singular value of m (N, k, k) under diagonal perturbations.

    The largest singular value after scaling rows against columns until both weigh alike (Osborne's balancing).
    """
    size = np.abs(m) * (1.0 - np.eye(m.shape[-1]))
    scale = np.ones(m.shape[:-1])
    for _ in range(rounds):
        for i in range(m.shape[-1]):
            row = np.linalg.norm(size[:, i] / scale, axis=-1) * scale[:, i]
            column = np.linalg.norm(size[:, :, i] * scale, axis=-1) / scale[:, i]
            scale[:, i] *= np.sqrt(np.maximum(column, 1e-12) / np.maximum(row, 1e-12))
    return np.linalg.norm(m * scale[:, :, None] / scale[:, None, :], ord=2, axis=(1, 2))


def loop_margins(name: str, omega: Floats, loop: Response) -> Margins:
    """Margins of one loop from its frequency response (N,), the classical ones by the control package."""
    import control

    # all crossings, refined between the frequencies by the package; its FRD wants real spacing only for plots
    gains, phases, _, _, crossings, _ = control.stability_margins(control.FRD(loop, omega, smooth=True), returnall=True)
    gains_db = 20.0 * np.log10(np.asarray(gains, dtype=float))
    phases, crossings = np.asarray(phases, dtype=float), np.asarray(crossings, dtype=float)
    closeness = np.abs(phases)
    delays = np.deg2rad(phases % 360.0) / crossings
    return Margins(
        actuator=name,
        gain_up_db=float(gains_db[gains_db > 0].min(initial=math.inf)),
        gain_down_db=float(-gains_db[gains_db < 0].max(initial=-math.inf)),
        phase_deg=float(closeness.min(initial=math.inf)),
        delay=float(delays.min(initial=math.inf)),
        crossover=float(crossings.max(initial=0.0)),
        disk=float(1.0 / np.abs(1.0 / (1.0 + loop) - 0.5).max()),
    )

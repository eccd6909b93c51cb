"""Roll and pitch to cyclic: a linear-quadratic regulator of both axes at once.

Between cyclic and body stand servo, delay and the tip-path plane with its flybar, which with the fuselage makes a
weakly damped mode of some 15 to 20 rad/s: feeding back angles and rates alone shakes it up. So the regulator feeds
back the whole state. Flapping and servos, which nobody measures, run along in a model driven by the cyclic sent and
the rates measured; the cyclic still under way in the delay is remembered, so that the delay is reckoned with exactly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controllers.plant import LinearPlant, sample
from controllers.regulator import bryson, dlqr

Floats = NDArray[np.float64]

ESTIMATOR_DELAY = 0.006  # [s] by which the navigator's rates and attitude may lag
MEASURED = ("roll", "pitch", "wx", "wy")
HIDDEN = ("flapping.back", "flapping.right", "servo.lateral", "servo.longitudinal")
WEIGHTS = {  # Bryson's largest welcome values [rad], [rad/s]
    "roll": 0.05, "pitch": 0.05, "wx": 1.3, "wy": 1.3, "flapping.back": 0.3, "flapping.right": 0.3,
}  # fmt: skip
CYCLIC = 0.05  # [rad]


@dataclass(frozen=True, eq=False)
class AttitudeGains:
    """u = -measured m - hidden h - sent s, all differences from trim; u, s: (lateral, longitudinal)."""

    measured: Floats  # (2, 4) on roll, pitch, wx, wy
    hidden: Floats  # (2, h) on flapping and servos
    sent: Floats  # (2, 2 k) on the cyclic of the last k periods, newest first
    model: Floats  # (h, h + 4 + 2 k + 2): hidden one period on from hidden, measured, sent and the cyclic sent now
    limit: float  # [rad] stop of either cyclic
    trim_lateral: float  # [rad]
    trim_longitudinal: float  # [rad]


def design_attitude(plant: LinearPlant) -> AttitudeGains:
    """Gains for this plant; its speeds, heading and vertical motion stay out."""
    hidden = [name for name in HIDDEN if name in plant.state_names]
    names = [*MEASURED, *hidden]
    rows, columns = plant.states(*names), plant.inputs("lateral", "longitudinal")
    a, b = plant.A[np.ix_(rows, rows)], plant.B[np.ix_(rows, columns)]
    full, drive = sample(a, b, float(plant.delay[columns].max()) + ESTIMATOR_DELAY)
    weights = np.zeros(len(full))
    weights[: len(names)] = [WEIGHTS[name] ** -2 if name in WEIGHTS else 0.0 for name in names]
    gain = dlqr(full, drive, np.diag(weights), bryson(CYCLIC, CYCLIC))
    m, n = len(MEASURED), len(names)
    model = np.hstack([full[m:n, m:n], full[m:n, :m], full[m:n, n:], drive[m:n]])
    return AttitudeGains(
        measured=gain[:, :m],
        hidden=gain[:, m:n],
        sent=gain[:, n:],
        model=model,
        limit=min(plant.upper.lateral, plant.upper.longitudinal),
        trim_lateral=plant.trim.lateral,
        trim_longitudinal=plant.trim.longitudinal,
    )


class AttitudeLoop:
    """The regulator in flight. Saturation reaches the model, so nothing winds up."""

    def __init__(self, gains: AttitudeGains) -> None:
        h, k = gains.hidden.shape[1], gains.sent.shape[1]
        # one vector [hidden, measured, sent, now], the order of the model's columns
        self._z = np.zeros(h + 4 + k + 2)
        self._feedback = -np.hstack([gains.hidden, gains.measured, gains.sent])
        self._seen = self._z[:-2]
        self._hidden, self._sent = self._z[:h], self._z[h + 4 : h + 4 + k]
        self._h = h
        self._gains = gains
        self._model = gains.model

    def update(
        self, roll: float, pitch: float, wx: float, wy: float, roll_wanted: float, pitch_wanted: float
    ) -> tuple[float, float]:
        """(lateral, longitudinal) [rad] from attitude [rad] and rates [rad/s]; call every SAMPLE_TIME."""
        gains, z, h = self._gains, self._z, self._h
        z[h], z[h + 1], z[h + 2], z[h + 3] = roll - roll_wanted, pitch - pitch_wanted, wx, wy
        lateral, longitudinal = (self._feedback @ self._seen).tolist()
        limit = gains.limit
        lateral = min(max(lateral + gains.trim_lateral, -limit), limit)
        longitudinal = min(max(longitudinal + gains.trim_longitudinal, -limit), limit)
        z[-2], z[-1] = lateral - gains.trim_lateral, longitudinal - gains.trim_longitudinal
        self._hidden[:] = self._model @ z
        sent = self._sent
        sent[2:] = sent[:-2].copy()
        sent[:2] = z[-2:]
        return lateral, longitudinal

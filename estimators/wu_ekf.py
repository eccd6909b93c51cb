"""Wu 2019's filter of vision and inertial measurements, equations 7 to 12, in its readings.

    x = [p, v] (6),  u = world acceleration,  z = p
    F = [I dt I; 0 I],  B = [dt^2/2 I; dt I],  H = [I 0]

Equation 12 as printed merges prediction and correction and loses half of the prediction on the way,

    x <- F x + K (z - H x),   P <- (I - K H) P + Q

so that the acceleration has no part in it, and P, which F never mixes, stays diagonal where Q is: the gain of the
velocity is zero for ever, and a first error of the velocity carries the position away as fast as it is pulled back.
Corrected:

    x <- F x + B u,  P <- F P F' + Q,  then  K = P H' (H P H' + R)^-1,  x <- x + K (z - H x),  P <- (I - K H) P

All of it is linear: the extended filter is the plain one. Between pictures K = 0.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

Reading = Literal["corrected", "printed", "driven", "mixed"]
READINGS: tuple[Reading, ...] = ("corrected", "printed", "driven", "mixed")

H = np.eye(3, 6)


@dataclass(frozen=True)
class WuNoise:
    """Standard deviations behind Q and R, of which the paper says nothing, and behind the first P."""

    acceleration: float = 0.1  # [m/s^2/sqrt(Hz)] white: vibration, tilt error times gravity
    position: float = 0.01  # [m/sqrt(s)] of what is printed for a P that F does not mix
    vision: float = 0.05  # [m] of a picture's position, each axis
    start_velocity: float = 0.3  # [m/s]


def transition(dt: float) -> tuple[Floats, Floats]:
    """F (6, 6) and B (6, 3) over `dt` [s]: equations 10 and 11."""
    f, b = np.eye(6), np.zeros((6, 3))
    f[:3, 3:] = dt * np.eye(3)
    b[:3], b[3:] = 0.5 * dt * dt * np.eye(3), dt * np.eye(3)
    return f, b


class WuFilter:
    """The filter; position and velocity in the world [m, m/s].

    Readings: `corrected`; `printed`; of the two things that the print drops, `driven` has only B u, `mixed` only
    F P F'.
    """

    def __init__(
        self, position: Floats, velocity: Floats, *, noise: WuNoise | None = None, reading: Reading = "corrected"
    ) -> None:
        """Starts at `position` (3,) [m], as sure as of a picture, with `velocity` (3,) [m/s]."""
        if reading not in READINGS:
            raise ValueError(f"reading: there is no {reading!r}; there are {', '.join(READINGS)}")
        self.noise = noise or WuNoise()
        self.x = np.concatenate([position, velocity]).astype(float)
        self.p = np.diag(np.repeat([self.noise.vision**2, self.noise.start_velocity**2], 3))
        self.driven, self.mixed = reading in ("corrected", "driven"), reading in ("corrected", "mixed")

    def predict(self, acceleration: Floats, dt: float) -> None:
        """On by `dt` [s] with the world acceleration (3,) [m/s^2] of that time."""
        f, b = transition(dt)
        self.x = f @ self.x
        if self.driven:
            self.x = self.x + b @ acceleration
        q = np.zeros((6, 6))
        spread = self.noise.acceleration**2
        if self.mixed:
            # white acceleration, integrated over dt
            q[:3, :3] = spread * dt**3 / 3.0 * np.eye(3)
            q[:3, 3:] = q[3:, :3] = spread * dt**2 / 2.0 * np.eye(3)
            self.p = f @ self.p @ f.T
        else:
            q[:3, :3] = self.noise.position**2 * dt * np.eye(3)
        q[3:, 3:] = spread * dt * np.eye(3)
        self.p = self.p + q

    def correct(self, position: Floats) -> tuple[Floats, Floats]:
        """A picture's position (3,) [m]; returns the innovation (3,) and its covariance (3, 3)."""
        s = H @ self.p @ H.T + self.noise.vision**2 * np.eye(3)
        gain = np.linalg.solve(s, H @ self.p).T
        innovation = position - self.x[:3]
        self.x = self.x + gain @ innovation
        rest = np.eye(6) - gain @ H
        self.p = rest @ self.p
        self.p = 0.5 * (self.p + self.p.T)
        return innovation, s

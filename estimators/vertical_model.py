"""Vertical dynamics of a helicopter, Lei 2012 equation 13, with fifteen coefficients; and what fits them to a log.

    x = [h, h', omega, theta_c, theta_c'],   u = [throttle, collective]

    x1' = x2
    x2' = a0 + a1 x2 + a2 x2^2 + (a3 + a4 x4 - sqrt(a5 + a6 x4)) x3^2
    x3' = a7 + a8 x3 + (a9 sin x4 + a10) x3^2 + u1
    x4' = x5
    x5' = a11 + a12 x4 + a13 x3^2 sin x4 + a14 x5 + u2

The paper prints x2^2 behind the thrust's bracket, the square of the climb rate: there would be no lift at rest. The
form is that of Pallett and Ahmad's X-Cell 50 on a stand (TR-EE 91-35), in whose numbers the controls are accelerations
already; for a machine whose controls are strokes and angles, u1 and u2 are those times a gain of their own.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

H, V, OMEGA, THETA, THETA_RATE = range(5)  # states
LONGEST_STEP = 0.02  # [s] the collective's servo is the fastest mode: poles up to 100 rad/s

Lift = Literal["rotor", "climb"]  # what the thrust's bracket is multiplied by: as corrected, as printed


@dataclass(frozen=True, eq=False)
class VerticalModel:
    """Equation 13 with its coefficients; states (..., 5) in m, m/s, rad/s, rad, rad/s, inputs (..., 2)."""

    a: Floats  # (15,) or (15, ...) to compare many models at once
    throttle_gain: float | Floats = 1.0  # [rad/s^2] u1 of full throttle
    collective_gain: float | Floats = 1.0  # [1/s^2] u2 of one radian

    def climb(self, x2: ArrayLike, x3: ArrayLike, x4: ArrayLike, lift: Lift = "rotor") -> Floats:
        """Vertical acceleration [m/s^2] (f2) at climb rates x2 [m/s], rotor speeds x3 [rad/s], pitches x4 [rad]."""
        a, v = self.a, np.asarray(x2, float)
        driver = np.asarray(x3, float) if lift == "rotor" else v
        bracket = a[3] + a[4] * x4 - np.sqrt(np.maximum(a[5] + a[6] * np.asarray(x4, float), 0.0))
        return np.asarray(a[0] + a[1] * v + a[2] * v * v + bracket * driver * driver)

    def derivative(self, x: Floats, u: Floats) -> Floats:
        """Time derivative (..., 5) of states x (..., 5) under inputs u (..., 2): throttle [0..1], collective [rad]."""
        a = self.a
        speed, pitch, rate = x[..., OMEGA], x[..., THETA], x[..., THETA_RATE]
        square, sine = speed * speed, np.sin(pitch)
        out = np.empty(np.broadcast_shapes(x.shape, (*u.shape[:-1], 5)))
        out[..., H] = x[..., V]
        out[..., V] = self.climb(x[..., V], speed, pitch)
        out[..., OMEGA] = a[7] + a[8] * speed + (a[9] * sine + a[10]) * square + self.throttle_gain * u[..., 0]
        out[..., THETA] = rate
        turn = self.collective_gain * u[..., 1]
        out[..., THETA_RATE] = a[11] + a[12] * pitch + a[13] * square * sine + a[14] * rate + turn
        return out

    def step(self, x: Floats, u: Floats, dt: float) -> Floats:
        """States dt [s] later with the inputs held: Runge-Kutta of fourth order."""
        parts = max(1, int(np.ceil(dt / LONGEST_STEP - 1e-9)))
        h = dt / parts
        for _ in range(parts):
            k1 = self.derivative(x, u)
            k2 = self.derivative(x + 0.5 * h * k1, u)
            k3 = self.derivative(x + 0.5 * h * k2, u)
            k4 = self.derivative(x + h * k3, u)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return x

    def settled(self, collective: float, speed: float) -> Floats:
        """(5,) at height 0 and at rest, with the collective's servo settled at `speed` [rad/s] of the rotor."""
        a, pitch = self.a, collective
        for _ in range(20):
            pull = a[11] + a[12] * pitch + a[13] * speed**2 * np.sin(pitch) + self.collective_gain * collective
            pitch -= float(pull / (a[12] + a[13] * speed**2 * np.cos(pitch)))
        return np.array([0.0, 0.0, speed, pitch, 0.0])

    def damping(self, x2: float) -> float:
        """Derivative of f2 by the climb rate [1/s]."""
        return float(self.a[1] + 2.0 * self.a[2] * x2)


# K1..K12 of Pallett and Ahmad, in equation 13's order. K4 = 7.86 is the load of the test stand.
PALLETT = VerticalModel(
    np.array(
        [-17.67, -0.1, -0.1, 5.31e-4, 1.5364e-2, 2.82e-7, 1.632e-5, -13.92, -0.7, -0.005, -0.0028, 434.88, -800.0, -0.1,
         -65.0]
    )
)  # fmt: skip

# identified on the Raptor 90 in hover at 10 m by `python benchmarks/vertical_model.py 80`: three flights of a minute in
# still air, collective and throttle shaken. On another flight in the default wind a free run of 3 s is off by
# 0.14 m/s RMS in climb rate. Ground effect, inflow lag and the servo's dead time are not in equation 13.
RAPTOR90 = VerticalModel(
    np.array(
        [-5.63508, -1.45525, -0.582952, 2.55914e-06, 0.00619008, 1.52529e-13, 8.58265e-07, 20.9745, -7.80537e-06,
         -0.0335012, -3.94268e-09, -22.9636, -1114.31, 0.00855542, -27.9548]
    ),
    throttle_gain=183.345,
    collective_gain=1114.31,
)  # fmt: skip

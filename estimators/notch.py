"""Notch filters that follow the rotor: they take the vibration at once and twice a turn out of inertial signals.

Each is s^2 + w0^2 over s^2 + w0 s/Q + w0^2, warped so that its zero stays at w0 (bilinear transform). Far below w0 it
only delays, by 1/(Q w0): with Q = 3 at 25 and 50 Hz together 3.2 ms.
"""

import math

import numba

QUALITY = 3.0


@numba.njit(cache=True, error_model="numpy")
def design(coefficients, frequency, dt):
    """Write b0, b1, b2, a1, a2 of a notch at `frequency` [rad/s], sampled every `dt` [s], into `coefficients` (5,).

    A frequency that the sampling cannot show is let through.
    """
    if frequency * dt > 0.9 * math.pi:
        coefficients[0] = 1.0
        coefficients[1:] = 0.0
        return
    k = math.tan(0.5 * frequency * dt)
    scale = 1.0 / (1.0 + k / QUALITY + k * k)
    coefficients[0] = (1.0 + k * k) * scale
    coefficients[1] = 2.0 * (k * k - 1.0) * scale
    coefficients[2] = coefficients[0]
    coefficients[3] = coefficients[1]
    coefficients[4] = (1.0 - k / QUALITY + k * k) * scale


@numba.njit(cache=True, error_model="numpy")
def delay(frequency, harmonics):
    """Delay [s] of slow signals by notches at `frequency` [rad/s] and its multiples, so many in all."""
    total = 0.0
    for h in range(harmonics):
        total += 1.0 / (QUALITY * (h + 1) * frequency)
    return total


@numba.njit(cache=True, error_model="numpy")
def settle(coefficients, memory, value):
    """Put `memory` (2,) where a constant input `value` would have brought it."""
    # direct form II transposed; the notch's gain at rest is 1
    memory[1] = (coefficients[2] - coefficients[4]) * value
    memory[0] = (coefficients[1] - coefficients[3]) * value + memory[1]


@numba.njit(cache=True, error_model="numpy")
def step(coefficients, memory, value):
    """The next output for the input `value`; `memory` (2,) in place."""
    out = coefficients[0] * value + memory[0]
    memory[0] = coefficients[1] * value - coefficients[3] * out + memory[1]
    memory[1] = coefficients[2] * value - coefficients[4] * out
    return out

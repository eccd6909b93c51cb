"""The rotor's shake taken out of the inertial samples, by its orders: so many times a turn.

What shakes at an order k is Re(a exp(i k phase)) with a slow amplitude a: brought down to zero frequency, averaged over
a second, and brought back, it can be subtracted without touching what the vehicle itself does below the rotor's speed.
The tail rotor's order is sought about its gear ratio.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Floats = NDArray[np.float64]

ORDERS = (1.0, 2.0)
MEMORY = 0.5  # [s] standard deviation of the average
SEARCH = 0.06  # share of the gear ratio, either way
PLAIN = 30.0  # power of a line over the median of its neighbours, from which on it is one
STEPS = 160
LOOKED_AT = 2048  # samples in which the line is sought


def calm(t: Floats, imu: Floats, rotor: Floats, gear: float) -> Floats:
    """The samples (S, 6) without shake; t (S,) [s], rotor (S,) [rad/s] speed of the main rotor."""
    step = float(np.median(np.diff(t)))
    phase = np.concatenate([[0.0], np.cumsum(0.5 * (rotor[1:] + rotor[:-1]) * np.diff(t))])
    tail = _line(phase, imu[:, :3], gear)
    out = imu.copy()
    for _ in range(2):  # neighbouring lines leak into each other a little
        for order in (*ORDERS, *tail):
            carrier = np.exp(1j * order * phase)[:, None]
            slow = 2.0 * _average(np.asarray(out * carrier.conj()), MEMORY / step)
            out -= (slow * carrier).real
    return out


def _average(values: NDArray[np.complex128], samples: float) -> NDArray[np.complex128]:
    real, imaginary = (gaussian_filter1d(part, samples, axis=0, mode="nearest") for part in (values.real, values.imag))
    return np.asarray(real + 1j * imaginary)


def _line(phase: Floats, force: Floats, gear: float) -> list[float]:
    """The order near `gear` at which a line stands, if there is one."""
    orders = gear * (1.0 + SEARCH * np.linspace(-1.0, 1.0, STEPS))
    begin = max(0, (len(phase) - LOOKED_AT) // 2)
    phase, force = phase[begin : begin + LOOKED_AT], force[begin : begin + LOOKED_AT]
    centred = (force - force.mean(axis=0)) * np.hanning(len(phase))[:, None]
    power = np.square(np.abs(np.exp(-1j * orders[:, None] * phase) @ centred)).sum(axis=1)
    best = int(power.argmax())
    return [float(orders[best])] if power[best] > PLAIN * np.median(power) else []

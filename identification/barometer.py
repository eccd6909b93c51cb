"""The barometer as the filter of the motion takes it: late by its lag, rounded by it, and under the rotor's wash."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from flightlog.atmosphere import density_at
from flightlog.constants import GRAVITY
from identification import kinematics as k
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def downwash(vehicle: Vehicle, skids: Floats, thrust: Floats, surface: tuple[float, float]) -> Floats:
    """Metres by which the barometer reads low for a gain of 1, at heights of the skids [m] and thrusts [N]."""
    n = vehicle.sensors["baro"].numbers
    area = math.pi * float(vehicle.geometry["rotor_radius"]) ** 2
    weight = density_at(0.0, *surface) * GRAVITY
    return np.asarray(thrust / area / weight * np.exp(-np.maximum(skids, 0.0) / n["downwash_height_scale"]))


def washed(
    vehicle: Vehicle, kinds: Ints, times: Floats, t: Floats, skids: Floats, thrust: Floats, surface: tuple[float, float]
) -> Floats:
    """(M,) [m] what the rotor adds to the barometer, behind its lag; t (N,): ends of the nodes."""
    shifts = np.zeros(len(times))
    if "baro" in vehicle.sensors:
        low = downwash(vehicle, skids, thrust, surface) * vehicle.sensors["baro"].numbers["downwash_gain"]
        at, lag = kinds == k.BARO, lag_of(vehicle)
        shifts[at] = -np.interp(times[at] + lag, t, lagged(low, lag, _step(t)))
    return shifts


def port(air: Floats, lag: float, step: float) -> Floats:
    """(N,) [m] read too high for a port of coefficient 1 in air that passes at (N, 2) [m/s], behind the lag."""
    return -lagged(np.sum(air**2, axis=1) / (2.0 * GRAVITY), lag, step)


def lag_of(vehicle: Vehicle) -> float:
    """[s] by which the barometer is taken to follow."""
    return float(vehicle.sensors["baro"].numbers["lag"]) if "baro" in vehicle.sensors else 0.0


def port_of(vehicle: Vehicle) -> float:
    """Pressure coefficient of its port."""
    return float(vehicle.sensors["baro"].numbers["port_coefficient"]) if "baro" in vehicle.sensors else 0.0


def lagged(values: Floats, tau: float, step: float) -> Floats:
    """What a lag of first order makes of values (N,) that lie `step` apart; it begins at rest.

    Exact for what is straight between them: y' = a y + (1 - r) x' + (r - a) x, a = exp(-h/tau), r = (1 - a) tau/h.
    """
    kept = math.exp(-step / tau) if tau > 0.0 else 0.0
    ramp = (1.0 - kept) * tau / step
    taps = [1.0 - ramp, ramp - kept]
    return np.asarray(lfilter(taps, [1.0, -kept], values, zi=[(1.0 - taps[0]) * values[0]])[0])


def rounded(vehicle: Vehicle, kinds: Ints, times: Floats, t: Floats, height: Floats) -> Floats:
    """(M,) by which a barometer that lags differs from one that is late; late it is by its times already."""
    shifts, lag = np.zeros(len(times)), lag_of(vehicle)
    at = kinds == k.BARO
    shifts[at] = np.interp(times[at] + lag, t, lagged(height, lag, _step(t))) - np.interp(times[at], t, height)
    return shifts


def _step(t: Floats) -> float:
    return float(np.median(np.diff(t)))

"""Dryden turbulence at low altitude, MIL-F-8785C section 3.7.1.2 with 3.7.3.4, discretised exactly.

Axes: u along the mean wind, v across it, w up. With h in feet from 10 to 1000 (held at the ends),

    L_w = h,    L_u = L_v = h/(0.177 + 0.000823 h)^1.2,    sigma_w = 0.1 W_20,    sigma_u = sigma_v = sigma_w/(...)^0.4

The spectra belong to the filters 1/(1 + tau s) for u and (1 + sqrt(3) tau s)/(1 + tau s)^2 for v and w, tau = L/V,
V the airspeed: in hover, the mean wind itself carries the air past. The states have unit variance, so that height and
wind may change in flight; the gust is sigma times the output.

The second filter as x1' = (n - x1)/tau, x2' = (x1 - x2)/tau, y = sqrt(3) x1 + (1 - sqrt(3)) x2 steps exactly by

    x1 <- E x1 + n1,   x2 <- E x2 + d E x1 + n2,   d = dt/tau,   E = exp(-d)
    var n1 = (1 - E^2)/2,   cov = (1 - E^2 (1 + 2d))/4,   var n2 = (1 - E^2 (1 + 2d + 2d^2))/4

whose stationary covariance ((1/2, 1/4), (1/4, 1/4)) gives var y = 3/2 + sqrt(3)(1 - sqrt(3))/2 + (1 - sqrt(3))^2/4 = 1.
"""

import math

import numba

from sim.wind.mean import FOOT, mean_speed

# W_20 [m/s] of the classes of intensity (15, 30 and 45 knots, figure 10 and section 3.7.3.4)
CLASSES = {"light": 15.0 * 1852.0 / 3600.0, "moderate": 30.0 * 1852.0 / 3600.0, "severe": 45.0 * 1852.0 / 3600.0}
STATES = 5  # u; x1, x2 of v; x1, x2 of w
NORMALS = 5  # a step takes
_ROOT3 = math.sqrt(3.0)


@numba.njit(cache=True)
def lengths(height):  # type: ignore[no-untyped-def]
    """(L_u = L_v, L_w) [m] at `height` [m] above the ground."""
    feet = min(max(height / FOOT, 10.0), 1000.0)
    return feet / (0.177 + 0.000823 * feet) ** 1.2 * FOOT, feet * FOOT


@numba.njit(cache=True)
def intensities(height, speed):  # type: ignore[no-untyped-def]
    """(sigma_u = sigma_v, sigma_w) [m/s] at `height` [m] where the mean wind at 10 m is `speed` [m/s]."""
    feet = min(max(height / FOOT, 10.0), 1000.0)
    vertical = 0.1 * mean_speed(20.0 * FOOT, speed)
    return vertical / (0.177 + 0.000823 * feet) ** 0.4, vertical


@numba.njit(cache=True)
def noise_roots(d):  # type: ignore[no-untyped-def]
    """(E, l11, l21, l22): decay and Cholesky factor of the noise of the second-order filter over d = dt/tau."""
    decay = math.exp(-d)
    if d < 1e-3:
        # the closed forms lose their digits; their series: var n1 = d, cov = d^2/2, var n2 = d^3/3 to leading orders
        first = d * (1.0 - d)
        across = 0.5 * d * d * (1.0 - 4.0 / 3.0 * d)
        second = d * d * d / 3.0 * (1.0 - 1.5 * d)
    else:
        square = decay * decay
        first = 0.5 * (1.0 - square)
        across = 0.25 * (1.0 - square * (1.0 + 2.0 * d))
        second = 0.25 * (1.0 - square * (1.0 + 2.0 * d + 2.0 * d * d))
    l11 = math.sqrt(first)
    l21 = across / l11 if l11 > 0.0 else 0.0
    return decay, l11, l21, math.sqrt(max(second - l21 * l21, 0.0))


@numba.njit(cache=True)
def start(x, normals):  # type: ignore[no-untyped-def]
    """Draw the states x (STATES,) from their stationary distribution with as many standard normals."""
    x[0] = normals[0]
    for first in (1, 3):
        x[first] = math.sqrt(0.5) * normals[first]
        x[first + 1] = math.sqrt(0.125) * (normals[first] + normals[first + 1])


@numba.njit(cache=True)
def step(x, normals, height, speed, airspeed, dt):  # type: ignore[no-untyped-def]
    """Turbulence (u, v, w) [m/s] along the mean wind, to its left, up; the states x (STATES,) in place.

    normals (NORMALS,): standard normals. height [m] above the ground; speed [m/s] mean wind at 10 m that the strength
    belongs to; airspeed [m/s] relative to the moving air mass; dt [s].
    """
    long, short = lengths(height)
    d = airspeed * dt / long
    decay, l11, l21, l22 = noise_roots(d)
    x[0] = decay * x[0] + math.sqrt(1.0 - decay * decay) * normals[0]
    x[2] = decay * (x[2] + d * x[1]) + l21 * normals[1] + l22 * normals[2]
    x[1] = decay * x[1] + l11 * normals[1]
    d = airspeed * dt / short
    decay, l11, l21, l22 = noise_roots(d)
    x[4] = decay * (x[4] + d * x[3]) + l21 * normals[3] + l22 * normals[4]
    x[3] = decay * x[3] + l11 * normals[3]
    sigma, sigma_up = intensities(height, speed)
    return (
        sigma * x[0],
        sigma * (_ROOT3 * x[1] + (1.0 - _ROOT3) * x[2]),
        sigma_up * (_ROOT3 * x[3] + (1.0 - _ROOT3) * x[4]),
    )

"""Mean wind over the height: the logarithmic profile of MIL-F-8785C, section 3.7.3.2.

u(h) = W_20 ln(h/z_0)/ln(20 ft/z_0),   z_0 = 0.15 ft for the terminal phases of flight
"""

import math

import numba

FOOT = 0.3048  # [m]
ROUGHNESS = 0.15 * FOOT  # [m] z_0, category C
REFERENCE = 10.0  # [m] where weather reports measure


@numba.njit(cache=True)
def mean_speed(height, speed):  # type: ignore[no-untyped-def]
    """Mean wind [m/s] at `height` [m] above the ground where it is `speed` [m/s] at 10 m; zero up to the roughness."""
    if height <= ROUGHNESS:
        return 0.0
    return speed * math.log(height / ROUGHNESS) / math.log(REFERENCE / ROUGHNESS)


@numba.njit(cache=True)
def sheared_speed(height, speed, shear):  # type: ignore[no-untyped-def]
    """The same where the difference from the wind at 10 m is `shear` times that of the profile; 0: no shear at all."""
    return speed + shear * (mean_speed(height, speed) - speed)

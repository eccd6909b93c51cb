"""Standard atmosphere about a surface whose pressure and temperature are given (ISO 2533).

Lei 2012 equation 8 turns a static pressure into a height; `pressure_at` is its inverse. Both take scalars or
arrays and are compiled, because barometers and force terms call them at every tick.
"""

import numba

from flightlog.constants import GAS_CONSTANT, GRAVITY, LAPSE_RATE

SURFACE_PRESSURE = 101_325.0  # [Pa]
SURFACE_TEMPERATURE = 288.15  # [K]

_EXPONENT = -GRAVITY / (LAPSE_RATE * GAS_CONSTANT)  # 5.2559


@numba.njit(cache=True)
def temperature_at(height, surface_temperature):
    """Air temperature [K] at `height` [m] above the surface."""
    return surface_temperature + LAPSE_RATE * height


@numba.njit(cache=True)
def pressure_at(height, surface_pressure, surface_temperature):
    """Static pressure [Pa] at `height` [m] above the surface: the inverse of equation 8."""
    # P = P_b (1 + beta H / T_b)^(-g/(beta R))
    return surface_pressure * (1.0 + LAPSE_RATE * height / surface_temperature) ** _EXPONENT


@numba.njit(cache=True)
def height_from_pressure(pressure, surface_pressure, surface_temperature):
    """Height [m] above the surface from static pressure [Pa]. Lei 2012, equation 8 with H_b = 0."""
    # H = (T_b/beta) ((P/P_b)^(-beta R/g) - 1)
    return surface_temperature / LAPSE_RATE * ((pressure / surface_pressure) ** (1.0 / _EXPONENT) - 1.0)


@numba.njit(cache=True)
def density_at(height, surface_pressure, surface_temperature):
    """Air density [kg/m^3] at `height` [m] above the surface: rho = P/(R T)."""
    pressure = pressure_at(height, surface_pressure, surface_temperature)
    return pressure / (GAS_CONSTANT * temperature_at(height, surface_temperature))

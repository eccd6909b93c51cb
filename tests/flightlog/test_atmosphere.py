import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.atmosphere import (
    SURFACE_PRESSURE,
    SURFACE_TEMPERATURE,
    density_at,
    height_from_pressure,
    pressure_at,
    temperature_at,
)
from flightlog.constants import GRAVITY

# ISO 2533, geopotential altitude [m]: temperature [K], pressure [Pa], density [kg/m^3]
ISO_2533 = [
    (0.0, 288.15, 101325.0, 1.22500),
    (1000.0, 281.65, 89874.6, 1.11164),
    (2000.0, 275.15, 79495.2, 1.00649),
    (5000.0, 255.65, 54019.9, 0.736116),
    (10000.0, 223.15, 26436.3, 0.412707),
    (11000.0, 216.65, 22632.1, 0.363918),
]

heights = st.floats(-100.0, 5000.0)
pressures = st.floats(90_000.0, 108_000.0)
temperatures = st.floats(240.0, 320.0)


@pytest.mark.parametrize(("height", "temperature", "pressure", "density"), ISO_2533)
def test_agrees_with_the_tables_of_iso_2533(height, temperature, pressure, density):
    assert temperature_at(height, SURFACE_TEMPERATURE) == pytest.approx(temperature, abs=1e-9)
    assert pressure_at(height, SURFACE_PRESSURE, SURFACE_TEMPERATURE) == pytest.approx(pressure, rel=1e-5)
    assert density_at(height, SURFACE_PRESSURE, SURFACE_TEMPERATURE) == pytest.approx(density, rel=1e-5)
    assert height_from_pressure(pressure, SURFACE_PRESSURE, SURFACE_TEMPERATURE) == pytest.approx(height, abs=0.1)


@given(heights, pressures, temperatures)
def test_equation_8_inverts_the_pressure(height, pressure, temperature):
    there = pressure_at(height, pressure, temperature)
    assert height_from_pressure(there, pressure, temperature) == pytest.approx(height, abs=1e-6)


@given(heights, pressures, temperatures)
def test_pressure_carries_the_air_above(height, pressure, temperature):
    # hydrostatics: dP/dh = -rho g, by a central difference over 2 m
    slope = (pressure_at(height + 1.0, pressure, temperature) - pressure_at(height - 1.0, pressure, temperature)) / 2.0
    assert slope == pytest.approx(-density_at(height, pressure, temperature) * GRAVITY, rel=1e-6)


def test_takes_arrays():
    height = np.linspace(0.0, 30.0, 7)
    pressure = pressure_at(height, SURFACE_PRESSURE, SURFACE_TEMPERATURE)
    assert pressure.shape == (7,)
    assert np.all(np.diff(pressure) < 0)
    np.testing.assert_allclose(height_from_pressure(pressure, SURFACE_PRESSURE, SURFACE_TEMPERATURE), height, atol=1e-8)

import numpy as np
import pytest

from flightlog.units import to_si, units_of


@pytest.mark.parametrize(
    ("value", "unit", "si", "right"),
    [
        (180.0, "deg", "rad", np.pi),
        (25.0, "degC", "K", 298.15),
        (36.0, "km/h", "m/s", 10.0),
        (1.0, "g", "m/s^2", 9.80665),
        (1.0, "g", "kg", 1e-3),
        (3700.0, "mV", "V", 3.7),
        (480.0, "mG", "uT", 48.0),
        (0.48, "G", "uT", 48.0),
        (600.0, "rpm", "rad/s", 20.0 * np.pi),
        (7, "m", "m", 7.0),
    ],
)
def test_units_become_si(value, unit, si, right):
    assert to_si(value, unit, si) == pytest.approx(right, rel=1e-12)
    np.testing.assert_allclose(to_si(np.array([value, value]), unit, si), right)


def test_a_unit_of_another_quantity_is_refused_with_those_that_fit():
    with pytest.raises(ValueError, match="unit 'deg' does not fit; expected one of m, mm, cm, km, ft"):
        to_si(1.0, "deg", "m")


def test_factors_are_those_of_the_conversion():
    for unit, factor in units_of("m/s^2").items():
        assert to_si(2.0, unit, "m/s^2") == pytest.approx(2.0 * factor)

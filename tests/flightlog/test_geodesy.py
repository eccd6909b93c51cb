import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.geodesy import LocalFrame

origins = st.builds(LocalFrame, st.floats(-80, 80), st.floats(-180, 180), st.floats(-100, 3000))


def earth_centred(latitude, longitude, altitude):
    """[m], by the ellipsoid's own equations."""
    a, e2 = 6_378_137.0, 6.694379990141e-3
    phi, lam = math.radians(latitude), math.radians(longitude)
    n = a / math.sqrt(1.0 - e2 * math.sin(phi) ** 2)
    return np.array([
        (n + altitude) * math.cos(phi) * math.cos(lam),
        (n + altitude) * math.cos(phi) * math.sin(lam),
        (n * (1.0 - e2) + altitude) * math.sin(phi),
    ])  # fmt: skip


@given(origins, st.floats(-500, 500), st.floats(-500, 500), st.floats(-100, 100))
def test_there_and_back(frame, e, n, u):
    again = frame.enu(*frame.geographic(e, n, u))
    assert np.allclose(again, (e, n, u), atol=1e-6)


@given(origins, st.floats(-300, 300), st.floats(-300, 300), st.floats(-50, 50))
def test_near_the_origin_it_is_the_tangent_plane(frame, e, n, u):
    latitude, longitude, altitude = (float(value) for value in frame.geographic(e, n, u))
    apart = earth_centred(latitude, longitude, altitude) - earth_centred(
        frame.latitude, frame.longitude, frame.altitude
    )
    phi, lam = math.radians(frame.latitude), math.radians(frame.longitude)
    east = np.array([-math.sin(lam), math.cos(lam), 0.0])
    north = np.array([-math.sin(phi) * math.cos(lam), -math.sin(phi) * math.sin(lam), math.cos(phi)])
    up = np.cross(east, north)
    # what is left out is of second order: distance squared over the radius, times the latitude's tangent
    left = (e * e + n * n + u * u) / 6.35e6 * (1.0 + abs(math.tan(phi))) + 1e-6
    assert np.abs(np.array([apart @ east - e, apart @ north - n, apart @ up - u])).max() <= left


def test_across_the_date_line():
    frame = LocalFrame(10.0, 179.9999, 0.0)
    e, _, _ = frame.enu([10.0], [-179.9999], [0.0])
    assert e[0] == pytest.approx(2e-4 * math.pi / 180 * 6_378_137 * math.cos(math.radians(10.0)), rel=1e-3)

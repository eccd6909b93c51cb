"""Direct fits against closed forms, OpenCV's own, and the Cramer-Rao bound."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators.vision.ellipse import Ellipse, fit_circle, fit_ellipse, from_conic, image_of_circle


def drawn(centre, semi_axes, angle, s):
    c, n = math.cos(angle), math.sin(angle)
    x, y = semi_axes[0] * np.cos(s), semi_axes[1] * np.sin(s)
    return np.array(centre) + np.column_stack([c * x - n * y, n * x + c * y])


def same_axis(first, second):
    return math.remainder(first - second, math.pi)


ellipses = st.tuples(
    st.tuples(st.floats(-900, 900), st.floats(-900, 900)),
    st.floats(5, 400),
    st.floats(0.15, 0.95),
    st.floats(-1.5, 1.5),
)


@given(ellipses, st.floats(0, 6), st.floats(2.5, 6.2))
def test_an_arc_of_an_ellipse_gives_the_ellipse(shape, start, span):
    centre, long, ratio, angle = shape
    points = drawn(centre, (long, ratio * long), angle, start + np.linspace(0, span, 40))
    found = fit_ellipse(points)
    assert found is not None
    np.testing.assert_allclose(found.centre, centre, atol=1e-5 * long)
    np.testing.assert_allclose(found.semi_axes, [long, ratio * long], rtol=1e-5)
    assert same_axis(found.angle, angle) == pytest.approx(0.0, abs=1e-4)


def test_it_is_opencvs_direct_fit():
    rng = np.random.default_rng(0)
    for _ in range(50):
        long, ratio, angle = rng.uniform(20, 200), rng.uniform(0.3, 0.9), rng.uniform(-1.5, 1.5)
        points = drawn(rng.uniform(0, 500, 2), (long, ratio * long), angle, rng.uniform(0, 2 * math.pi, 80))
        points += rng.normal(0, 0.01 * long, points.shape)
        found = fit_ellipse(points)
        centre, sides, turned = cv2.fitEllipseDirect(points.astype(np.float32))
        np.testing.assert_allclose(found.centre, centre, atol=1e-3 * long)
        np.testing.assert_allclose(2 * found.semi_axes, sorted(sides, reverse=True), rtol=2e-3)
        wide = turned if sides[0] > sides[1] else turned + 90.0
        assert same_axis(found.angle, math.radians(wide)) == pytest.approx(0.0, abs=5e-3)


def test_its_centre_is_as_good_as_the_cramer_rao_bound_allows():
    rng = np.random.default_rng(1)
    s = np.linspace(0, 2 * math.pi, 90, endpoint=False)
    true, sigma, angle = np.array([300.0, 200.0]), 0.3, 0.6
    points = drawn(true, (90.0, 75.0), angle, s)
    found = np.array([fit_ellipse(points + rng.normal(0, sigma, points.shape)).centre for _ in range(1000)])
    # offsets along the normal are all that a contour shows of centre, axes and angle
    local = drawn((0, 0), (90.0, 75.0), 0.0, s)
    normal = local / [90.0**2, 75.0**2]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    slopes = np.column_stack([
        normal, normal[:, 0] * np.cos(s), normal[:, 1] * np.sin(s),
        -normal[:, 0] * local[:, 1] + normal[:, 1] * local[:, 0],
    ])  # fmt: skip
    bound = sigma * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))[:2]
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    ratio = ((found - true) @ turn).std(axis=0) / bound
    print(f"standard deviation of the centre over the bound: {np.round(ratio, 3)}")
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)


@pytest.mark.parametrize(
    "points",
    [np.column_stack([np.arange(20.0), 3.0 * np.arange(20.0)]), np.zeros((9, 2)), np.array([[0.0, 1.0]] * 3),
     np.full((9, 2), np.nan)],
)  # fmt: skip
def test_what_is_no_ellipse_and_no_circle(points):
    assert fit_ellipse(points) is None
    assert fit_circle(points) is None


def test_other_conics_are_no_ellipses():
    assert from_conic(np.diag([1.0, -1.0, -1.0])) is None  # hyperbola
    assert from_conic(np.diag([1.0, 1.0, 1.0])) is None  # no points
    assert from_conic(np.array([[1.0, 0, 0], [0, 0, -0.5], [0, -0.5, 0]])) is None  # parabola


def test_points_and_distances_of_an_ellipse():
    ellipse = fit_ellipse(drawn((10.0, -4.0), (8.0, 5.0), 0.4, np.linspace(0, 6, 30)))
    assert isinstance(ellipse, Ellipse)
    on = ellipse.points(50)
    np.testing.assert_allclose(ellipse.distances(on), 0.0, atol=1e-9)
    outward = ellipse.centre + (on - ellipse.centre) * 1.001
    distances = ellipse.distances(outward)
    assert np.all(distances > 0.0)
    assert distances.max() == pytest.approx(0.008, rel=0.02)


@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(1, 300), st.floats(0, 6), st.floats(1.0, 6.0))
def test_an_arc_of_a_circle_gives_the_circle(x, y, radius, start, span):
    circle = fit_circle(drawn((x, y), (radius, radius), 0.0, start + np.linspace(0, span, 30)))
    np.testing.assert_allclose(circle.centre, [x, y], atol=1e-7 * radius + 1e-9)
    assert circle.radius == pytest.approx(radius, rel=1e-7)
    assert circle.residual < 1e-7 * radius


def test_the_circle_is_the_linear_least_squares_solution():
    rng = np.random.default_rng(2)
    points = drawn((100.0, 50.0), (30.0, 27.0), 0.3, rng.uniform(0, 5, 40)) + rng.normal(0, 0.5, (40, 2))
    rows = np.column_stack([2 * points, np.ones(40)])
    a, b, c = np.linalg.lstsq(rows, np.sum(points**2, axis=1), rcond=None)[0]
    circle = fit_circle(points)
    np.testing.assert_allclose([*circle.centre, circle.radius], [a, b, math.sqrt(c + a * a + b * b)], rtol=1e-9)


def test_the_centre_of_a_circle_seen_aslant_is_not_the_centre_of_its_picture():
    """Radius 0.5 m, 2 m below, 5 deg aslant: 4.9 px, 11 mm (Wu 2019's circle fit has the same error)."""
    focal, tilt, height, radius = 952.4, math.radians(5.0), 2.0, 0.5
    turn = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    homography = np.diag([focal, focal, 1.0]) @ np.column_stack([turn[:, 0], turn[:, 1], [0.0, 0.0, height]])
    seen = image_of_circle(homography, radius)
    middle = homography @ [0.0, 0.0, 1.0]
    bias = seen.centre - middle[:2] / middle[2]
    assert abs(bias[1]) * height / focal == pytest.approx(0.011, abs=0.001)
    rim = drawn((0, 0), (radius, radius), 0.0, np.linspace(0, 2 * math.pi, 200, endpoint=False))
    pixels = np.column_stack([rim, np.ones(len(rim))]) @ homography.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    np.testing.assert_allclose(fit_ellipse(pixels).centre, seen.centre, atol=1e-6)
    np.testing.assert_allclose(fit_circle(pixels).centre, seen.centre, atol=0.25)

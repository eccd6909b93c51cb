import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.marks import Disc, HMark, Polygon, RingMark


@st.composite
def h_marks(draw):
    leg, width = draw(st.floats(0.2, 10.0)), draw(st.floats(0.2, 10.0))
    return HMark(leg, width, draw(st.floats(0.02, 0.98)) * min(leg, width / 2))


def area(outline):
    x, y = outline.T
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


@given(h_marks())
def test_the_outline_encloses_two_legs_and_a_bar_counter_clockwise(mark):
    bar = (mark.width - 2 * mark.stroke) * mark.stroke
    assert area(mark.outline()) == pytest.approx(2 * mark.leg * mark.stroke + bar)


@given(h_marks())
def test_the_outline_spans_leg_and_width_about_the_centre(mark):
    outline = mark.outline()
    assert outline.shape == (12, 2)
    np.testing.assert_allclose(outline.max(axis=0), [mark.width / 2, mark.leg / 2])
    np.testing.assert_allclose(outline.min(axis=0), [-mark.width / 2, -mark.leg / 2])
    # symmetric under half a turn
    np.testing.assert_allclose(np.roll(outline, 6, axis=0), -outline, atol=1e-12)


def test_the_legs_run_along_y():
    steps = np.diff(HMark(leg=2.0).outline(), axis=0, append=HMark(leg=2.0).outline()[:1])
    longest = steps[np.argmax(np.linalg.norm(steps, axis=1))]
    np.testing.assert_allclose(np.abs(longest), [0.0, 2.0])


@pytest.mark.parametrize("sizes", [(1.0, 1.0, 0.0), (1.0, 1.0, 0.5), (0.1, 1.0, 0.2), (-1.0, 1.0, 0.2)])
def test_an_impossible_h_is_refused(sizes):
    with pytest.raises(ValueError, match="does not fit"):
        HMark(*sizes)


@given(st.floats(0.1, 10.0))
def test_the_ring_mark_is_as_large_as_its_outermost_ring(size):
    mark = RingMark(size)
    assert mark.rings[0][1] * 2 == pytest.approx(size)
    np.testing.assert_allclose(mark.t_corners() / size, RingMark().t_corners())
    edges = [*mark.t_outlines(), *mark.guide_outlines(), mark.holes()]
    assert max(np.abs(points).max() for points in edges) < mark.square / 2


def test_nothing_of_the_ring_mark_touches_anything_else():
    mark = RingMark()
    radii = np.array([r for ring in mark.rings for r in ring] + [mark.grid_radius, mark.well_radius])
    assert np.diff(np.sort(radii)).min() > 0.015
    away = np.hypot(*mark.holes().T)
    assert away.max() + mark.hole_radius < mark.grid_radius - 0.005
    assert away.min() - mark.hole_radius > mark.well_radius + 0.005
    apart = np.hypot(*(mark.holes()[:, None] - mark.holes()[None]).T)
    assert apart[apart > 0].min() > 2 * mark.hole_radius + 0.01
    for outline in (*mark.t_outlines(), *mark.guide_outlines()):
        assert np.hypot(*outline.T).min() > mark.rings[0][1] + 0.05


def test_the_ring_marks_outlines_run_counter_clockwise_and_look_the_same_after_a_whole_turn_only():
    mark = RingMark()
    left, right = mark.t_outlines()
    assert left[:, 0].max() < 0 < right[:, 0].min()
    for outline in (left, right, *mark.guide_outlines()):
        assert area(outline) > 0
        assert not np.allclose(np.sort(outline[:, 1]), np.sort(-outline[:, 1]))


def test_t_corners_are_numbered_clockwise_from_the_axis():
    corners = RingMark().t_corners()
    assert corners.shape == (16, 2)
    azimuth = np.mod(np.arctan2(corners[:, 0], corners[:, 1]), 2 * np.pi)
    assert np.all(np.diff(azimuth) > -1e-9)
    assert corners[0, 0] > 0 and corners[-1, 0] < 0


@pytest.mark.parametrize("mark", [HMark(), RingMark()])
def test_shapes_lie_on_the_marks_square(mark):
    for shape in mark.shapes():
        if isinstance(shape, Polygon):
            reach = np.abs(shape.corners).max()
        else:
            assert isinstance(shape, Disc)
            reach = max(abs(shape.x), abs(shape.y)) + shape.radius
        assert reach < mark.square / 2


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_ring_is_refused(size):
    with pytest.raises(ValueError, match="ring"):
        RingMark(size)


def test_round_edges_know_their_distance_to_the_next():
    mark = RingMark(2.0)
    circles = mark.circles()
    assert len(circles) == 8 + len(mark.holes())
    by_radius = {round(r / 2.0, 4): gap / 2.0 for x, y, r, _, gap in circles if x == y == 0.0}
    assert by_radius[0.5] == pytest.approx(0.12)
    assert by_radius[0.29] == pytest.approx(0.08)
    assert by_radius[0.018] == pytest.approx(0.018)
    holes = circles[np.hypot(circles[:, 0], circles[:, 1]) > 0.0]
    # to the next hole, the grid's rim or the well
    assert holes[:, 4].min() / 2.0 == pytest.approx(0.15 - 0.013 - 0.04 * np.hypot(3, 1), abs=1e-9)
    assert set(circles[:, 3]) == {-1.0, 1.0}

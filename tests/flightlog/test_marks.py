import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog.marks import HMark


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

"""The pad in the replay: its mesh against the mark's shapes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightlog import replay_scene
from flightlog.marks import Disc, HMark, Mark, RingMark
from flightlog.replay_scene import slabs


def cross(u, v):
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def area(outline):
    x, y = outline.T
    return 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)


@given(st.floats(0.2, 5.0), st.floats(0.2, 5.0), st.floats(0.05, 0.45))
def test_slabs_fill_an_outline_without_overlap(leg, width, stroke):
    mark = HMark(leg, width, stroke * min(leg, width))
    boxes = slabs(mark.outline())
    assert sum((e - w) * (n - s) for w, s, e, n in boxes) == pytest.approx(area(mark.outline()))
    for outline in RingMark(leg).bars():
        assert sum((e - w) * (n - s) for w, s, e, n in slabs(outline)) == pytest.approx(area(outline))


class Tape:
    """Stands in for a recording; keeps what is logged."""

    def __init__(self):
        self.logged = {}

    def log(self, entity, archetype, static=False):
        self.logged[entity] = archetype


@pytest.mark.parametrize("mark", [HMark(), RingMark()])
def test_later_paint_lies_on_earlier_paint_in_its_own_colour(mark: Mark):
    tape = Tape()
    replay_scene._pad(tape, mark)
    mesh = tape.logged["world/pad/mark"]
    vertices = np.array(mesh.vertex_positions.as_arrow_array().to_pylist())
    faces = np.array(mesh.triangle_indices.as_arrow_array().to_pylist())
    colours = np.array(mesh.vertex_colors.as_arrow_array().to_pylist())
    a, b, c = (vertices[faces[:, k], :2] for k in range(3))
    doubled = cross(b - a, c - a)
    for shape in mark.shapes():
        if not isinstance(shape, Disc):
            continue
        # the topmost triangle over a point just inside the disc has the disc's colour
        point = np.array([shape.x, shape.y]) + 0.97 * shape.radius * np.array([np.cos(0.3), np.sin(0.3)])
        signs = [cross(q - p, point - p) * np.sign(doubled) for p, q in ((a, b), (b, c), (c, a))]
        over = np.flatnonzero(np.all(np.array(signs) >= 0, axis=0) & (np.abs(doubled) > 0))
        top = over[np.argmax(vertices[faces[over, 0], 2])]
        red = (colours[faces[top, 0]] >> 24) & 255
        assert red == replay_scene._TONES[shape.tone][0]

"""Edge points of the ring mark: arcs of its circles, sides of its bars, and which of them can be told apart."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimators.vision.outline import OutlineSamples
from flightlog.marks import RingMark

Floats = NDArray[np.float64]

LONGEST_ARC = 0.8  # [mark sizes] a circle is cut into arcs, so that a cut one is as densely sampled as a whole one
PER_EDGE = 64
# [mark sizes] from an edge to the next one that is as light on the same side, across rings, Ts and guide line, and
# across the grid with what is in it
WIDE, NARROW = 0.15, 0.03
COARSE = 0.05  # [mark sizes] clearance of the former


@dataclass(frozen=True, eq=False)
class RingSamples:
    """Samples of every edge of a ring mark; normals point from white (or grey) to black, as for an H's outline."""

    samples: OutlineSamples
    clearance: Floats  # (N,) [m] to the next edge
    room: Floats  # (N,) [m] to the next edge of the same contrast
    turns: NDArray[np.bool_]  # (N,) whether the edge moves when the mark turns about its centre
    bend: Floats  # (N, 2) [1/m] the edge's curvature, towards its centre

    @classmethod
    def of(cls, mark: RingMark) -> "RingSamples":
        """All samples of a mark."""
        parts: list[OutlineSamples] = []
        clearance: list[float] = []
        turns: list[bool] = []
        bend: list[Floats] = []
        for x, y, radius, light, gap in mark.circles().tolist():
            for arc in _arcs(x, y, radius, light, max(1, math.ceil(2 * math.pi * radius / LONGEST_ARC / mark.size))):
                parts.append(arc)
                clearance.append(gap)
                turns.append(math.hypot(x, y) > 0.0)
                bend.append(-light * arc.normals / radius)
        for corners in mark.bars():
            side = OutlineSamples.of(corners, PER_EDGE)
            parts += [side.take(side.edge == k) for k in range(len(corners))]
            clearance += [mark.bar_width] * len(corners)
            turns += [True] * len(corners)
            bend += [np.zeros((PER_EDGE, 2))] * len(corners)
        room = mark.size * np.where(np.array(clearance) >= COARSE * mark.size, WIDE, NARROW)
        return cls(
            _joined(parts), np.repeat(clearance, PER_EDGE), np.repeat(room, PER_EDGE), np.repeat(turns, PER_EDGE),
            np.vstack(bend),
        )  # fmt: skip

    def clear(
        self, apart: float, reach: float, *, blur: float = 0.0, round_only: bool = False
    ) -> OutlineSamples | None:
        """Samples `apart` [m] from other edges, with room to be searched for within `reach` [m]; None: there are none.

        blur [m]: standard deviation of the picture's blur, which moves a round edge, light or dark inside, towards its
        centre by blur^2 / (2 radius): there the points are. round_only: of those only what the mark's turn leaves be.
        """
        keep = (self.clearance >= apart) & (self.room >= reach)
        if round_only:
            keep &= ~self.turns
        if not keep.any():
            return None
        kept = self.samples.take(keep)
        _, edge = np.unique(kept.edge, return_inverse=True)
        points = kept.points + 0.5 * blur**2 * self.bend[keep]
        return replace(kept, points=points, edge=edge.astype(np.intp))


@cache
def ring_samples(mark: RingMark) -> RingSamples:
    """The samples of a mark, made once."""
    return RingSamples.of(mark)


def _arcs(x: float, y: float, radius: float, light: float, number: int) -> list[OutlineSamples]:
    """A circle as arcs of PER_EDGE samples. They have no corners: none of their samples is ever near an end."""
    angle = (np.arange(number * PER_EDGE) + 0.5) / (number * PER_EDGE) * 2.0 * math.pi
    outward = np.column_stack([np.cos(angle), np.sin(angle)])
    tangents = np.column_stack([-outward[:, 1], outward[:, 0]])
    # a quarter of the length is the mean distance to an edge's ends, which is what lengths are made from
    to_corner = np.full(PER_EDGE, 2.0 * math.pi * radius / number / 4.0)
    along = np.arange(PER_EDGE)
    return [
        OutlineSamples(
            outward[part] * radius + (x, y), tangents[part], light * outward[part], np.zeros(PER_EDGE, np.intp),
            to_corner, along,
        )
        for part in (slice(k * PER_EDGE, (k + 1) * PER_EDGE) for k in range(number))
    ]  # fmt: skip


def _joined(parts: list[OutlineSamples]) -> OutlineSamples:
    return OutlineSamples(
        np.vstack([p.points for p in parts]),
        np.vstack([p.tangents for p in parts]),
        np.vstack([p.normals for p in parts]),
        np.repeat(np.arange(len(parts)), PER_EDGE),
        np.concatenate([p.to_corner for p in parts]),
        np.concatenate([p.along for p in parts]),
    )

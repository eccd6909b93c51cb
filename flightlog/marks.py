"""Outlines of the marks that vision looks for.

Mark axes: origin at the mark's centre, x right, y along the mark's axis (an H: along its legs; a ring: along its guide
line), z up, metres. A pad lies in the world with its mark axes along east and north.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Tone = Literal["white", "grey", "black"]  # of paint; the square around the mark is black


@dataclass(frozen=True)
class Disc:
    """A painted disc."""

    x: float  # [m] of its centre
    y: float  # [m]
    radius: float  # [m]
    tone: Tone


@dataclass(frozen=True)
class Polygon:
    """A painted polygon whose edges run along the mark's axes."""

    corners: tuple[tuple[float, float], ...]  # [m] counter-clockwise seen from above
    tone: Tone


Shape = Disc | Polygon


@dataclass(frozen=True)
class HMark:
    """A letter H: two legs and a bar halfway up."""

    leg: float = 1.0  # [m] length of the legs, along y
    width: float = 1.0  # [m] outer edge to outer edge, along x
    stroke: float = 0.2  # [m] breadth of legs and bar

    def __post_init__(self) -> None:
        if not (0 < self.stroke < min(self.leg, self.width / 2)):
            raise ValueError(f"H: stroke {self.stroke} m does not fit leg {self.leg} m and width {self.width} m")

    @property
    def square(self) -> float:
        """Side [m] of the dark square around it."""
        return 1.5 * max(self.leg, self.width)

    @property
    def turn(self) -> float:
        """Angle [rad] after which it looks the same: headings are known modulo this."""
        return math.pi

    def outline(self) -> Floats:
        """Corners (12, 2) [m], counter-clockwise seen from above, from the lower left leg's outer foot."""
        x, y, b = self.width / 2, self.leg / 2, self.stroke
        return np.array(
            [
                (-x, -y), (-x + b, -y), (-x + b, -b / 2), (x - b, -b / 2), (x - b, -y), (x, -y),
                (x, y), (x - b, y), (x - b, b / 2), (-x + b, b / 2), (-x + b, y), (-x, y),
            ]
        )  # fmt: skip

    def shapes(self) -> tuple[Shape, ...]:
        """What is painted on the dark square, in this order."""
        return (Polygon(tuple((float(x), float(y)) for x, y in self.outline()), "white"),)


@dataclass(frozen=True)
class RingMark:
    """Landmark of Wu 2019, section 1.2: white rings around a scaled landing grid, a guide line, a T on each side.

    The paper gives no dimensions: these are shares of the outermost ring's diameter. The innermost ring and the grid's
    holes are what is left in the picture close to the ground. Guide line and upright Ts make it look the same after a
    whole turn only.
    """

    size: float = 1.0  # [m] outer diameter of the outermost ring

    def __post_init__(self) -> None:
        if not 0.0 < self.size < math.inf:
            raise ValueError(f"ring: the outermost ring's diameter must be above 0 m (got {self.size})")

    @property
    def square(self) -> float:
        """Side [m] of the black square."""
        return 2.0 * self.size

    @property
    def turn(self) -> float:
        """Angle [rad] after which it looks the same: headings are known modulo this."""
        return 2.0 * math.pi

    @property
    def rings(self) -> tuple[tuple[float, float], ...]:
        """Inner and outer radius [m] of the white rings, outermost first."""
        return tuple((inner * self.size, outer * self.size) for inner, outer in _RINGS)

    @property
    def grid_radius(self) -> float:
        """Radius [m] of the light grey grid; the innermost ring lies on a black disc in its middle."""
        return _GRID * self.size

    @property
    def well_radius(self) -> float:
        """Radius [m] of the black disc in the grid's middle."""
        return _WELL * self.size

    @property
    def hole_radius(self) -> float:
        """Radius [m] of the grid's holes."""
        return _HOLE * self.size

    def holes(self) -> Floats:
        """Centres (N, 2) [m] of the grid's holes."""
        steps = np.arange(-4, 5) * _PITCH
        centres = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        radius = np.hypot(*centres.T)
        free = _HOLE + 0.006  # a hole keeps this distance from the grid's borders
        return np.asarray(centres[(radius > _WELL + free) & (radius < _GRID - free)] * self.size)

    def t_outlines(self) -> tuple[Floats, Floats]:
        """Corners (8, 2) [m] of the left and the right T, each counter-clockwise from the foot's left corner."""
        half, foot, top, b = _T_WIDTH / 2, -_T_HEIGHT / 2, _T_HEIGHT / 2, _T_STROKE
        t = np.array(
            [
                (-b / 2, foot), (b / 2, foot), (b / 2, top - b), (half, top - b),
                (half, top), (-half, top), (-half, top - b), (-b / 2, top - b),
            ]
        )  # fmt: skip
        return (t - (_T_AWAY, 0.0)) * self.size, (t + (_T_AWAY, 0.0)) * self.size

    def t_corners(self) -> Floats:
        """Corners (16, 2) [m] of both Ts, clockwise seen from above about the mark's centre, from its axis."""
        corners = np.vstack(self.t_outlines())
        azimuth = np.mod(np.arctan2(corners[:, 0], corners[:, 1]), 2.0 * np.pi)
        return corners[np.lexsort([np.hypot(*corners.T), np.round(azimuth, 9)])]

    def guide_outlines(self) -> tuple[Floats, ...]:
        """Corners (4, 2) [m] of each of the guide line's bars, counter-clockwise, the nearest to the rings first."""
        x = _GUIDE_WIDTH / 2
        return tuple(np.array([(-x, low), (x, low), (x, high), (-x, high)]) * self.size for low, high in _GUIDE)

    def circles(self) -> Floats:
        """Every round edge (N, 5): centre x, y [m], radius [m], +1 where it is lighter inside, else -1, and clearance.

        Clearance [m]: to the nearest other round edge. Rings come first, from the outermost edge inwards.
        """
        borders = [(radius, light) for inner, outer in self.rings for radius, light in ((outer, 1.0), (inner, -1.0))]
        borders += [(self.grid_radius, 1.0), (self.well_radius, -1.0)]
        rows = [(0.0, 0.0, radius, light) for radius, light in borders]
        rows += [(float(x), float(y), self.hole_radius, -1.0) for x, y in self.holes()]
        found = np.array(rows)
        centres, radius = found[:, :2], found[:, 2]
        apart = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
        beside = apart - radius[:, None] - radius[None]
        gap = np.where(beside >= 0.0, beside, np.abs(radius[:, None] - radius[None]) - apart)
        np.fill_diagonal(gap, 2.0 * radius)
        return np.column_stack([found, gap.min(axis=1)])

    def bars(self) -> tuple[Floats, ...]:
        """Corners (M, 2) [m] of every white outline with straight edges: both Ts and the guide line's bars."""
        return (*self.t_outlines(), *self.guide_outlines())

    @property
    def bar_width(self) -> float:
        """Breadth [m] of the Ts' strokes and the guide line."""
        return _T_STROKE * self.size

    def outline(self) -> Floats:
        """Corners (4, 2) [m] of the black square, counter-clockwise from the lower left."""
        return np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * self.square / 2

    def shapes(self) -> tuple[Shape, ...]:
        """What is painted on the black square, in this order: later paint covers earlier."""
        outer, middle, inner = self.rings
        return (
            *(Polygon(tuple((float(x), float(y)) for x, y in corners), "white") for corners in self.bars()),
            Disc(0.0, 0.0, outer[1], "white"),
            Disc(0.0, 0.0, outer[0], "black"),
            Disc(0.0, 0.0, middle[1], "white"),
            Disc(0.0, 0.0, middle[0], "black"),
            Disc(0.0, 0.0, self.grid_radius, "grey"),
            *(Disc(float(x), float(y), self.hole_radius, "black") for x, y in self.holes()),
            Disc(0.0, 0.0, self.well_radius, "black"),
            Disc(0.0, 0.0, inner[1], "white"),
            Disc(0.0, 0.0, inner[0], "black"),
        )


# shares of the outermost ring's diameter
_RINGS = ((0.38, 0.50), (0.21, 0.29), (0.018, 0.036))
_GRID, _WELL, _HOLE, _PITCH = 0.15, 0.054, 0.013, 0.04
_T_AWAY, _T_WIDTH, _T_HEIGHT, _T_STROKE = 0.75, 0.36, 0.44, 0.10
_GUIDE, _GUIDE_WIDTH = ((0.56, 0.72), (0.78, 0.94)), 0.10

Mark = HMark | RingMark

"""Outlines of the marks that vision looks for.

Mark axes: origin at the mark's centre, x right, y along the mark's axis (an H: along its legs), z up, metres.
A pad lies in the world with its mark axes along east and north.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class HMark:
    """A letter H: two legs and a bar halfway up."""

    leg: float = 1.0  # [m] length of the legs, along y
    width: float = 1.0  # [m] outer edge to outer edge, along x
    stroke: float = 0.2  # [m] breadth of legs and bar

    def __post_init__(self) -> None:
        if not (0 < self.stroke < min(self.leg, self.width / 2)):
            raise ValueError(f"H: stroke {self.stroke} m does not fit leg {self.leg} m and width {self.width} m")

    def outline(self) -> Floats:
        """Corners (12, 2) [m], counter-clockwise seen from above, from the lower left leg's outer foot."""
        x, y, b = self.width / 2, self.leg / 2, self.stroke
        return np.array(
            [
                (-x, -y), (-x + b, -y), (-x + b, -b / 2), (x - b, -b / 2), (x - b, -y), (x, -y),
                (x, y), (x - b, y), (x - b, b / 2), (-x + b, b / 2), (-x + b, y), (-x, y),
            ]
        )  # fmt: skip

"""The horizon's line as Huang, Li and Fan find it: Laplacian of Gaussian, Otsu, Hough (section 2).

What the paper leaves open is read so. The response is thresholded by its size, since the horizon answers on both
sides. A line is a candidate where the rows beside it differ: the "ratio of differences of adjacent lines" is the
difference of the mean grey levels above and below over their sum. Hough's cells are 1 deg by 1 px, as OpenCV's users
have them. The longest line is the one with most votes, and no line of less than a quarter of the width is one.
"""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from estimators.vision.threshold import otsu

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

SIGMA = 2.0  # [px] the paper's best
CELL_ANGLE, CELL_OFFSET = math.radians(1.0), 1.0  # [rad], [px]
SHORTEST = 0.25  # of the width
BESIDE = 6.0  # [px] how far beside a line its two sides are compared: beyond the filter's own width
LEAST_RATIO = 0.02
CANDIDATES = 20
QUIETEST = 0.5  # response to a third of a grey level's step: less is rounding


@dataclass(frozen=True)
class HuangLine:
    """A line of a picture, x cos(theta) + y sin(theta) = rho, y down."""

    rho: float  # [px]
    theta: float  # [rad] in (0, pi)

    @property
    def slope(self) -> float:
        """Of y = m x + b, y DOWN; equation 1's own m, y up, is its negative."""
        return -math.cos(self.theta) / math.sin(self.theta)

    def row(self, column: float) -> float:
        """Where it crosses a column [px]."""
        return (self.rho - column * math.cos(self.theta)) / math.sin(self.theta)

    @property
    def roll(self) -> float:
        """Equation 1 [rad], right side down positive."""
        return -math.atan(self.slope)

    def ground_share(self, width: int, height: int) -> float:
        """Equation 3: share of the picture below the line, while it leaves by the left and the right edge.

        b is the intercept at the left edge counted UP from the bottom, m the slope with y down; with any other reading
        the sign of the m term is wrong. The edges are the outer borders of the pixels.
        """
        b = height - 0.5 - self.row(-0.5)
        return (2.0 * b - self.slope * width) / (2.0 * height)


def _log_kernels() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Equation 7 as products of columns: Gaussian (N, 1) and its second derivative (N, 1)."""
    x = np.arange(-math.ceil(4 * SIGMA), math.ceil(4 * SIGMA) + 1.0)
    gauss = np.exp(-0.5 * (x / SIGMA) ** 2)
    second = (x**2 - SIGMA**2) / SIGMA**4 * gauss
    # cut off, it would answer to a flat picture
    second -= second.sum() * gauss / gauss.sum()
    return gauss[:, None].astype(np.float32), second[:, None].astype(np.float32)


GAUSS, SECOND = _log_kernels()


def edges(grey: Image) -> Image:
    """Mask (H, W), 255 where the response to the Laplacian of Gaussian exceeds Otsu's threshold."""
    across = cv2.sepFilter2D(grey, cv2.CV_32F, SECOND, GAUSS, borderType=cv2.BORDER_REPLICATE)
    down = cv2.sepFilter2D(grey, cv2.CV_32F, GAUSS, SECOND, borderType=cv2.BORDER_REPLICATE)
    size = cv2.absdiff(across, -down)
    largest = float(size.max())
    if largest < QUIETEST:
        return np.zeros_like(grey)
    scaled = cv2.convertScaleAbs(size, alpha=255.0 / largest)
    level = otsu(np.asarray(scaled, np.uint8))
    return np.asarray(cv2.threshold(scaled, level, 255, cv2.THRESH_BINARY)[1], np.uint8)


def find_line(image: Image) -> HuangLine | None:
    """The horizon in a picture (H, W, 3) RGB or (H, W); None where no line is long enough."""
    grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), np.uint8)
    width = grey.shape[1]
    found = cv2.HoughLines(
        edges(grey), CELL_OFFSET, CELL_ANGLE, math.ceil(SHORTEST * width), min_theta=CELL_ANGLE,
        max_theta=math.pi - CELL_ANGLE,
    )  # fmt: skip
    if found is None:
        return None
    for rho, theta in found.reshape(-1, 2)[:CANDIDATES].tolist():
        line = HuangLine(rho, theta)
        if _ratio(grey, line) >= LEAST_RATIO:
            return line
    return None


def _ratio(grey: Image, line: HuangLine) -> float:
    """Difference of the mean grey levels on the line's two sides over their sum."""
    height, width = grey.shape
    c, s = math.cos(line.theta), math.sin(line.theta)
    along = np.arange(-math.hypot(width, height), math.hypot(width, height), 2.0)
    foot = np.array([width / 2, height / 2])
    foot = foot + (line.rho - foot @ [c, s]) * np.array([c, s])
    points = foot + along[:, None] * [-s, c]
    above, below = np.rint(points - BESIDE * np.array([c, s])), np.rint(points + BESIDE * np.array([c, s]))
    inside = np.all((np.minimum(above, below) >= 0) & (np.maximum(above, below) < [width, height]), axis=1)
    if not inside.any():
        return 0.0
    a, b = above[inside].astype(int), below[inside].astype(int)
    upper, lower = float(grey[a[:, 1], a[:, 0]].mean()), float(grey[b[:, 1], b[:, 0]].mean())
    return abs(upper - lower) / max(upper + lower, 1.0)

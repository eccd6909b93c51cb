"""Sub-pixel places of step edges along given normals of a picture."""

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP = 0.5  # [px] between samples of a profile
SUPPORT = 3.0  # [px] half length of the matched kernel
SCALE = 1.0  # [px] standard deviation of the Gaussian whose derivative the kernel is
# a profile reaches this much further than the search does
GUARD = SUPPORT + 1.0


def _kernel() -> Floats:
    s = np.arange(1, round(SUPPORT / STEP) + 1) * STEP
    k = s * np.exp(-0.5 * (s / SCALE) ** 2)
    # a sharp step then answers with its height in grey levels
    return np.asarray(k / k.sum())


KERNEL = _kernel()


@numba.njit(cache=True)
def edge_offsets(image, points, normals, reach, polarity, kernel):
    """Offset [px] of the strongest edge along each normal, and its step height [grey levels].

    image (H, W) uint8; points, normals (N, 2) px, normals of unit length; search from -reach to +reach [px];
    polarity +1: brighter on the side the normal comes from, -1: darker. The matched kernel is the derivative of a
    Gaussian, antisymmetric about the place sought, so that a symmetric blur moves nothing; the peak is refined by a
    parabola. NaN where the profile leaves the picture or the peak lies at the search's end.
    """
    height, width = image.shape
    taps = len(kernel)
    m = int(np.ceil(reach / STEP))
    profile = np.empty(2 * (m + taps) + 1)
    response = np.empty(2 * m + 1)
    offsets = np.full(len(points), np.nan)
    heights = np.zeros(len(points))
    for i in range(len(points)):
        px, py = points[i, 0], points[i, 1]
        nx, ny = normals[i, 0], normals[i, 1]
        far = (m + taps) * STEP
        x_low, x_high = px - far * abs(nx), px + far * abs(nx)
        y_low, y_high = py - far * abs(ny), py + far * abs(ny)
        if not (x_low >= 0.0 and y_low >= 0.0 and x_high < width - 1.0 and y_high < height - 1.0):
            continue
        for j in range(len(profile)):
            s = (j - m - taps) * STEP
            x, y = px + s * nx, py + s * ny
            column, row = int(x), int(y)
            u, v = x - column, y - row
            top = image[row, column] * (1.0 - u) + image[row, column + 1] * u
            bottom = image[row + 1, column] * (1.0 - u) + image[row + 1, column + 1] * u
            profile[j] = top * (1.0 - v) + bottom * v
        best = 0
        for j in range(2 * m + 1):
            total = 0.0
            for k in range(taps):
                total += kernel[k] * (profile[j + taps - 1 - k] - profile[j + taps + 1 + k])
            response[j] = polarity * total
            if response[j] > response[best]:
                best = j
        heights[i] = response[best]
        if best == 0 or best == 2 * m:
            continue
        left, middle, right = response[best - 1], response[best], response[best + 1]
        curvature = left - 2.0 * middle + right
        shift = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
        offsets[i] = (best - m + shift) * STEP
    return offsets, heights

"""Sub-pixel places of step edges along given normals of a picture."""

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP = 0.5  # [px] between samples of a profile
SUPPORT = 3.5  # [px] half length of the matched kernel
SCALE = 1.2  # [px] standard deviation of the Gaussian whose derivative the kernel is
GUARD = SUPPORT + 1.0  # [px] from the picture's border, within which no edge can be found


def _kernel() -> Floats:
    s = np.arange(1, round(SUPPORT / STEP) + 1) * STEP
    k = s * np.exp(-0.5 * (s / SCALE) ** 2)
    # a sharp step then answers with its height in grey levels
    return np.asarray(k / k.sum())


KERNEL = _kernel()
AWAY = 4  # [samples] from an edge to where the response of a sharp one has fallen to a third


def sharpness(image: NDArray[np.uint8], points: Floats, normals: Floats, polarity: float) -> float:
    """How far the matched kernel's response to the points' mean profile falls within 2 px, on the side it falls less.

    image (H, W); points, normals (N, 2) px, the points on one edge or on edges of one direction; polarity as for
    `edge_offsets`. 0.65 for a step with the usual blur of 0.7 px, 0.5 with a ramp of 4 px, 0 on a long ramp: along it
    the place of the strongest response is chance.
    """
    reach = len(KERNEL) + AWAY
    along = np.arange(-reach, reach + 1) * STEP
    at = (points[:, None, :] + along[:, None] * normals[:, None, :]).astype(np.float32)
    u, v = np.ascontiguousarray(at[..., 0]), np.ascontiguousarray(at[..., 1])
    profile = cv2.remap(image, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).mean(axis=0)
    odd = np.concatenate([KERNEL[::-1], [0.0], -KERNEL])
    before, middle, after = polarity * np.correlate(profile, odd, "valid")[[0, AWAY, 2 * AWAY]]
    return float(1.0 - max(before, after) / middle) if middle > 0.0 else 0.0


@numba.njit(cache=True)
def _inside(place, slope, largest):
    """First and last s for which place + s slope lies in [0, largest]."""
    if abs(slope) < 1e-12:
        return (-1e9, 1e9) if 0.0 <= place <= largest else (1.0, -1.0)
    a, b = -place / slope, (largest - place) / slope
    return min(a, b), max(a, b)


@numba.njit(cache=True)
def edge_offsets(image, points, normals, reach, polarity, kernel):
    """Offset [px] of the strongest edge along each normal, and its step height [grey levels].

    image (H, W) uint8; points, normals (N, 2) px, normals of unit length; search from -reach to +reach [px];
    polarity +1: brighter on the side the normal comes from, -1: darker. The matched kernel is the derivative of a
    Gaussian, antisymmetric about the place sought, so that a symmetric blur moves nothing; the peak is refined by a
    parabola. The search ends where the kernel would leave the picture. NaN where the peak lies at the search's end.
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
        first, last = _inside(px, nx, width - 1.0)
        low, high = _inside(py, ny, height - 1.0)
        # samples of the profile that lie in the picture, counted from the model's edge
        first, last = max(first, low) / STEP, min(last, high) / STEP
        if not first < last:
            continue
        begin = max(-m, int(np.ceil(first)) + taps)
        end = min(m, int(np.floor(last)) - taps)
        if end - begin < 2:
            continue
        for j in range(begin - taps, end + taps + 1):
            x, y = px + j * STEP * nx, py + j * STEP * ny
            column, row = min(int(x), width - 2), min(int(y), height - 2)
            u, v = x - column, y - row
            top = image[row, column] * (1.0 - u) + image[row, column + 1] * u
            bottom = image[row + 1, column] * (1.0 - u) + image[row + 1, column + 1] * u
            profile[j + m + taps] = top * (1.0 - v) + bottom * v
        best = begin
        for j in range(begin, end + 1):
            total = 0.0
            for k in range(1, taps + 1):
                total += kernel[k - 1] * (profile[j + m + taps - k] - profile[j + m + taps + k])
            response[j + m] = polarity * total
            if response[j + m] > response[best + m]:
                best = j
        heights[i] = response[best + m]
        if best in (begin, end):
            continue
        left, middle, right = response[best + m - 1], response[best + m], response[best + m + 1]
        curvature = left - 2.0 * middle + right
        shift = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
        offsets[i] = (best + shift) * STEP
    return offsets, heights

"""Block matching by the sum of absolute differences: Zeng and Jiang, equation 1.

    SAD(i, j) = sum over m, n of |f_k(m, n) - f_k+1(m + i, n + j)|,  (i, j) = argmin over the search window

The print has f_k+1(m + 1, n + 1) and calls m x n the search range; it is the block.
"""

import cv2
import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]
Integers = NDArray[np.int64]

NOWHERE = np.iinfo(np.int32).max


@numba.njit(cache=True, error_model="numpy")
def _difference(first, second, row, column, row_2, column_2, size, enough):
    """SAD of two blocks; once it has reached `enough` the rest is left out."""
    total = np.int32(0)
    for m in range(size):
        for n in range(size):
            total += abs(np.int32(first[row + m, column + n]) - np.int32(second[row_2 + m, column_2 + n]))
        if total >= enough:
            return total
    return total


@numba.njit(cache=True, error_model="numpy")
def _match(first, second, corners, size, reach, out):
    height, width = second.shape
    for k in range(corners.shape[0]):
        row, column = corners[k, 1], corners[k, 0]
        best, best_i, best_j = np.int32(NOWHERE), 0, 0
        # from the middle outwards, row by row: of equals the smaller motion, and the sums end early
        for a in range(2 * reach + 1):
            j = (a + 1) // 2 if a % 2 else -(a // 2)
            for b in range(2 * reach + 1):
                i = (b + 1) // 2 if b % 2 else -(b // 2)
                r, c = row + j, column + i
                if r < 0 or c < 0 or r + size > height or c + size > width:
                    continue
                total = _difference(first, second, row, column, r, c, size, best)
                if total < best:
                    best, best_i, best_j = total, i, j
        out[k, 0], out[k, 1], out[k, 2] = best_i, best_j, best
        for side in range(4):
            r, c = row + best_j, column + best_i
            r += -1 if side == 2 else 1 if side == 3 else 0
            c += -1 if side == 0 else 1 if side == 1 else 0
            if best == NOWHERE or r < 0 or c < 0 or r + size > height or c + size > width:
                out[k, 3 + side] = NOWHERE
            else:
                out[k, 3 + side] = _difference(first, second, row, column, r, c, size, np.int32(NOWHERE))


def match(first: Image, second: Image, corners: Integers, size: int, reach: int) -> Integers:
    """Where blocks of the first picture lie in the second, by exhaustive search.

    Args:
        first: picture (H, W).
        second: picture of the same size.
        corners: (N, 2) [px] upper left corners x, y of the blocks, which lie inside the picture.
        size: [px] of a block's side.
        reach: [px] of the search, either way.

    Returns:
        (N, 7): motion x and y [px], SAD there, and one pixel to its left, right, above and below; NOWHERE where that
        block would leave the picture.
    """
    found = np.empty((len(corners), 7), np.int64)
    whole = np.ascontiguousarray(first), np.ascontiguousarray(second)  # compiled once
    _match(*whole, np.ascontiguousarray(corners, np.int64), size, reach, found)
    return found


def refine(found: Integers) -> Floats:
    """Parts of a pixel (N, 2) to add to the motion of `match`: the SAD about its least is a V, not a parabola.

    Two lines of equal and opposite slope through the three sums of an axis (equiangular fit); NaN where one is missing
    or there is no minimum.
    """
    least = found[:, 2].astype(float)[:, None]
    before, after = found[:, [3, 5]].astype(float), found[:, [4, 6]].astype(float)
    steepest = np.maximum(before, after) - least
    good = (np.maximum(before, after) < NOWHERE) & (steepest > 0.0)
    return np.where(good, 0.5 * (before - after) / np.where(good, steepest, 1.0), np.nan)


def texture(image: Image, corners: Integers, size: int) -> Floats:
    """How much there is to see in blocks (N,): mean absolute difference [grey levels] of pixels two apart, the lesser
    of both directions; a block without it has no minimum of its SAD to find.
    """
    x, y = corners[:, 0], corners[:, 1]

    def mean(kernel: Floats) -> Floats:
        sums = cv2.integral(np.abs(cv2.filter2D(image, cv2.CV_32F, kernel)))
        return np.asarray((sums[y + size, x + size] - sums[y, x + size] - sums[y + size, x] + sums[y, x]) / size**2)

    across = np.array([[-1.0, 0.0, 1.0]])
    return np.minimum(mean(across), mean(across.T))

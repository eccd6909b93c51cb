"""Robust linear least squares with a prior, for a few unknowns and some hundred measurements."""

import numba
import numpy as np

NOISE_FLOOR = 0.05  # [px] no edge is better known than this
HUBER, TUKEY = 1.345, 4.685  # 95 % efficient for Gaussian noise
ROUNDS = 5  # of reweighting; the first two by Huber, which needs no good start


@numba.njit(cache=True)
def spread(residuals):
    """Scale [px] of residuals (N,) from their median absolute value, not below the noise floor."""
    return max(NOISE_FLOOR, 1.4826 * np.median(np.abs(residuals)))


@numba.njit(cache=True)
def solve(jacobian, offsets, precision, to_prior):
    """Step (M,), the residuals (N,) that it leaves and their scale.

    jacobian (N, M); offsets (N,); precision (M,) of the prior, inverse variances; to_prior (M,): the step that would
    lead to the prior's mean.
    """
    n, m = jacobian.shape
    residuals = offsets - np.median(offsets)
    step = np.zeros(m)
    scale = 1.0
    for rounds in range(ROUNDS):
        scale = spread(residuals)
        normal = np.diag(precision)
        right = precision * to_prior
        for i in range(n):
            ratio = abs(residuals[i]) / scale
            if rounds < 2:
                weight = HUBER / max(ratio, HUBER)
            elif ratio < TUKEY:
                weight = (1.0 - (ratio / TUKEY) ** 2) ** 2
            else:
                continue
            weight /= scale * scale
            for j in range(m):
                wj = weight * jacobian[i, j]
                right[j] += wj * offsets[i]
                for k in range(j + 1):
                    normal[j, k] += wj * jacobian[i, k]
        for j in range(m):
            for k in range(j):
                normal[k, j] = normal[j, k]
        step = np.linalg.solve(normal, right)
        for i in range(n):
            total = offsets[i]
            for j in range(m):
                total -= jacobian[i, j] * step[j]
            residuals[i] = total
    return step, residuals, scale

"""Affine moment invariants (Lei 2012 equations 2-4, corrected after Flusser & Suk 1993).

Equation 3 prints I3 with u30 u03 - u21; the invariant has u30 u03 - u21 u12. The letter H is centrally symmetric, so
that I2 and I3 vanish and their logarithms are rounding noise: each logarithm is taken above a floor, and two
invariants of fourth order, I6 and I7, join in.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# I1, I2, I3, I6, I7: below these a rasterised symmetric shape of some 50 px shows only its pixels
FLOORS = np.array([1e-4, 3e-6, 1e-4, 1e-5, 1e-7])


def central_moments(mask: NDArray[np.uint8]) -> Floats:
    """Central moments (5, 5), [p, q] of x^p y^q, of a mask (H, W), each non-zero pixel of weight one; equation 2."""
    weights = (mask != 0).astype(np.float32)
    rows, columns = weights.sum(axis=1, dtype=float), weights.sum(axis=0, dtype=float)
    area = rows.sum()
    x = np.arange(mask.shape[1]) - columns @ np.arange(mask.shape[1]) / area
    y = np.arange(mask.shape[0]) - rows @ np.arange(mask.shape[0]) / area
    # scaled by the size before the powers, so that float32 holds them
    size = np.sqrt(area)
    powers = np.arange(5)
    x_powers = ((x / size)[:, None] ** powers).astype(np.float32)
    y_powers = ((y / size)[:, None] ** powers).astype(np.float32)
    scaled = (y_powers.T @ (weights @ x_powers)).T.astype(float)
    return np.asarray(scaled * size ** (powers[:, None] + powers[None, :]))


def affine_invariants(u: Floats) -> Floats:
    """Invariants (5,) I1, I2, I3, I6, I7 of central moments `u` (5, 5); equation 3."""
    a = u[0, 0]
    i1 = (u[2, 0] * u[0, 2] - u[1, 1] ** 2) / a**4
    i2 = (
        u[3, 0] ** 2 * u[0, 3] ** 2
        - 6 * u[3, 0] * u[2, 1] * u[1, 2] * u[0, 3]
        + 4 * u[3, 0] * u[1, 2] ** 3
        + 4 * u[2, 1] ** 3 * u[0, 3]
        - 3 * u[2, 1] ** 2 * u[1, 2] ** 2
    ) / a**10
    i3 = (
        u[2, 0] * (u[2, 1] * u[0, 3] - u[1, 2] ** 2)
        - u[1, 1] * (u[3, 0] * u[0, 3] - u[2, 1] * u[1, 2])
        + u[0, 2] * (u[3, 0] * u[1, 2] - u[2, 1] ** 2)
    ) / a**7
    i6 = (u[4, 0] * u[0, 4] - 4 * u[3, 1] * u[1, 3] + 3 * u[2, 2] ** 2) / a**6
    i7 = (
        u[4, 0] * u[0, 4] * u[2, 2]
        + 2 * u[3, 1] * u[2, 2] * u[1, 3]
        - u[4, 0] * u[1, 3] ** 2
        - u[0, 4] * u[3, 1] ** 2
        - u[2, 2] ** 3
    ) / a**9
    return np.array([i1, i2, i3, i6, i7])


def mismatch(a: Floats, b: Floats) -> float:
    """Sum of |lg|I_a| - lg|I_b|| over the invariants (5,) of two shapes, 0 for the same shape; equation 4."""
    return float(np.abs(np.log10(np.maximum(np.abs(a), FLOORS)) - np.log10(np.maximum(np.abs(b), FLOORS))).sum())

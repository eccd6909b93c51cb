"""Ellipses and circles through points by direct least squares.

Ellipse: Fitzgibbon, Pilu and Fisher 1999 in the numerically stable form of Halir and Flusser 1998: the conic
a x^2 + b x y + c y^2 + d x + e y + f = 0 with the least algebraic error under 4 a c - b^2 = 1, as only ellipses have.
Circle: the linear least squares of Wu 2019, section 2.2 (Kasa 1976): it is exact for a circle, and where the circle is
seen tilted its centre is not the image of the circle's centre.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ellipse:
    """An ellipse in the plane of its points, in their unit."""

    centre: Floats  # (2,)
    semi_axes: Floats  # (2,) the longer first
    angle: float  # [rad] of the longer axis, from x towards y, in (-pi/2, pi/2]
    conic: Floats  # (3, 3) symmetric: p' C p = 0 for p = (x, y, 1); negative inside

    def points(self, count: int) -> Floats:
        """Points (count, 2) on it, evenly in the parametric angle, from the end of the longer axis."""
        s = np.arange(count) * 2.0 * np.pi / count
        c, n = math.cos(self.angle), math.sin(self.angle)
        x, y = self.semi_axes[0] * np.cos(s), self.semi_axes[1] * np.sin(s)
        return np.asarray(self.centre + np.column_stack([c * x - n * y, n * x + c * y]))

    def distances(self, points: Floats) -> Floats:
        """Distance (N,) of points (N, 2), outside positive, to first order (Sampson)."""
        p = np.column_stack([points, np.ones(len(points))])
        to = p @ self.conic
        return np.asarray(np.sum(to * p, axis=1) / np.maximum(2.0 * np.hypot(to[:, 0], to[:, 1]), 1e-300))


@dataclass(frozen=True, eq=False)
class Circle:
    """A circle in the plane of its points, in their unit."""

    centre: Floats  # (2,)
    radius: float
    residual: float  # RMS of the points' distances to it


def from_conic(conic: Floats) -> Ellipse | None:
    """The ellipse of a symmetric (3, 3) conic; None for any other curve, and for one without points."""
    c = np.asarray(conic, float)
    block = c[:2, :2]
    determinant = block[0, 0] * block[1, 1] - block[0, 1] ** 2
    if not (np.all(np.isfinite(c)) and determinant > 0.0):
        return None
    if block[0, 0] < 0.0:
        c, block = -c, -block
    centre = np.linalg.solve(block, -c[:2, 2])
    level = -(c[2, 2] + c[:2, 2] @ centre)  # (p - centre)' block (p - centre) = level
    values, vectors = np.linalg.eigh(block)
    if level <= 0.0 or values[0] <= 0.0:
        return None
    x, y = vectors[:, 0]
    return Ellipse(centre, np.sqrt(level / values), math.pi / 2 - (math.pi / 2 - math.atan2(y, x)) % math.pi, c)


def fit_ellipse(points: Floats) -> Ellipse | None:
    """The direct fit to points (N, 2), N >= 6; None where they lie on no ellipse (on a line, or too few)."""
    points = np.asarray(points, float)
    if len(points) < 6:
        return None
    # about the centroid, at unit size: the squares and products keep their digits
    middle = points.mean(axis=0)
    size = math.sqrt(float(np.mean(np.sum((points - middle) ** 2, axis=1))) / 2.0)
    if not size > 0.0:
        return None
    x, y = ((points - middle) / size).T
    if not _spread(float(x @ x), float(x @ y), float(y @ y)) > 0.0:
        return None
    quadratic, linear = np.column_stack([x * x, x * y, y * y]), np.column_stack([x, y, np.ones_like(x)])
    s1, s2, s3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    try:
        back = -np.linalg.solve(s3, s2.T)  # the linear part that goes best with a quadratic one
    except np.linalg.LinAlgError:
        return None
    reduced = s1 + s2 @ back
    # times the inverse of the constraint matrix of 4 a c - b^2
    _, vectors = np.linalg.eig(np.array([reduced[2] / 2.0, -reduced[1], reduced[0] / 2.0]))
    vectors = np.real(vectors)
    inside = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    if not np.any(inside > 0.0):
        return None
    a, b, c = vectors[:, int(np.argmax(inside))]
    d, e, f = back @ np.array([a, b, c])
    normal = np.array([[a, b / 2.0, d / 2.0], [b / 2.0, c, e / 2.0], [d / 2.0, e / 2.0, f]])
    to_unit = np.array([[1.0 / size, 0.0, -middle[0] / size], [0.0, 1.0 / size, -middle[1] / size], [0.0, 0.0, 1.0]])
    return from_conic(to_unit.T @ normal @ to_unit)


def fit_circle(points: Floats) -> Circle | None:
    """The linear least-squares circle of points (N, 2), N >= 3; None where they lie on a line."""
    points = np.asarray(points, float)
    if len(points) < 3:
        return None
    middle = points.mean(axis=0)
    x, y = (points - middle).T
    square = x * x + y * y
    xx, xy, yy = float(x @ x), float(x @ y), float(y @ y)
    determinant = _spread(xx, xy, yy)
    if not determinant > 0.0:
        return None
    # about the centroid the third unknown, the mean of the squares, parts from the centre's two
    right, up = 0.5 * float(square @ x), 0.5 * float(square @ y)
    a, b = (yy * right - xy * up) / determinant, (xx * up - xy * right) / determinant
    radius = math.sqrt(float(square.mean()) + a * a + b * b)
    distances = np.hypot(x - a, y - b) - radius
    return Circle(middle + [a, b], radius, float(np.sqrt(np.mean(distances**2))))


def _spread(xx: float, xy: float, yy: float) -> float:
    """Determinant of the second moments of points; 0 where they lie on a line."""
    determinant = xx * yy - xy * xy
    return determinant if determinant > 1e-12 * (xx + yy) ** 2 else 0.0


def image_of_circle(to_picture: Floats, radius: float, centre: tuple[float, float] = (0.0, 0.0)) -> Ellipse | None:
    """What a homography (3, 3) makes of the circle about `centre`; None where that is no ellipse."""
    x, y = centre
    circle = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [-x, -y, x * x + y * y - radius * radius]])
    inverse = np.linalg.inv(to_picture)
    return from_conic(inverse.T @ circle @ inverse)

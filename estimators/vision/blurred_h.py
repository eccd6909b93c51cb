"""How a blurred H looks: the share of a pixel's light that comes from the mark, and its derivatives.

An H is three rectangles that do not overlap. Under a Gaussian blur each is a product of two differences of the error
function; a straight motion of the camera during the exposure is a mean over points along it.
"""

import math

import numba
import numpy as np

ROOT_HALF = math.sqrt(0.5)
ROOT_TAU = 1.0 / math.sqrt(2.0 * math.pi)

# columns of `appearance`'s derivatives
BY_X, BY_Y, MOVED_X, MOVED_Y, BY_WIDTH, BY_STROKE, BY_BLUR = range(7)


@numba.njit(cache=True)
def _step(x, sigma):
    """A blurred step: its value, and its slope [1/m]."""
    u = x / sigma
    if u > 6.0:
        return 1.0, 0.0
    if u < -6.0:
        return 0.0, 0.0
    return 0.5 * (1.0 + math.erf(u * ROOT_HALF)), ROOT_TAU * math.exp(-0.5 * u * u) / sigma


@numba.njit(cache=True)
def share(rays, to_mark, sweep, samples, sizes, sigmas, out):
    """Share of the mark's light into out (N,) for rays (N, 2), z = 1; the arguments are those of `appearance`."""
    a, b, s = 0.5 * sizes[0], 0.5 * sizes[1], sizes[2]
    for i in range(len(rays)):
        total = 0.0
        for k in range(samples):
            f = (k + 0.5) / samples - 0.5
            rx, ry = rays[i, 0] + f * sweep[0], rays[i, 1] + f * sweep[1]
            q = to_mark[2, 0] * rx + to_mark[2, 1] * ry + to_mark[2, 2]
            x = (to_mark[0, 0] * rx + to_mark[0, 1] * ry + to_mark[0, 2]) / q
            y = (to_mark[1, 0] * rx + to_mark[1, 1] * ry + to_mark[1, 2]) / q
            # an H is symmetric about both axes
            x, y = abs(x), abs(y)
            if x > a + 6.0 * sigmas[0] or y > b + 6.0 * sigmas[1]:
                continue
            outer, inner = _step(x + a, sigmas[0])[0] - _step(x - a, sigmas[0])[0], 0.0
            inner = _step(x + a - s, sigmas[0])[0] - _step(x - a + s, sigmas[0])[0]
            tall = _step(y + b, sigmas[1])[0] - _step(y - b, sigmas[1])[0]
            low = _step(y + 0.5 * s, sigmas[1])[0] - _step(y - 0.5 * s, sigmas[1])[0]
            total += (outer - inner) * tall + inner * low
        out[i] = total / samples


@numba.njit(cache=True)
def appearance(rays, to_mark, sweep, samples, sizes, sigmas):
    """Share (N,) of the mark's light for rays (N, 2), z = 1, and its derivatives (N, 7).

    to_mark (3, 3): homography from rays to mark axes [m]; sweep (2,): motion of the rays during the exposure, seen at
    `samples` points; sizes (3,): width, leg, stroke [m]; sigmas (2,) [m]: blur along the mark's x and y.
    Derivatives by the mark's x and y [1/m], by the same weighted with the place along the sweep (-0.5..0.5), by
    width and stroke [1/m], by the blur's logarithm.
    """
    n = len(rays)
    values, slopes = np.zeros(n), np.zeros((n, 7))
    a, b, s = 0.5 * sizes[0], 0.5 * sizes[1], sizes[2]
    sx, sy = sigmas[0], sigmas[1]
    for i in range(n):
        for k in range(samples):
            f = (k + 0.5) / samples - 0.5
            rx, ry = rays[i, 0] + f * sweep[0], rays[i, 1] + f * sweep[1]
            q = to_mark[2, 0] * rx + to_mark[2, 1] * ry + to_mark[2, 2]
            x = (to_mark[0, 0] * rx + to_mark[0, 1] * ry + to_mark[0, 2]) / q
            y = (to_mark[1, 0] * rx + to_mark[1, 1] * ry + to_mark[1, 2]) / q
            if abs(x) > a + 6.0 * sx or abs(y) > b + 6.0 * sy:
                continue
            v1, g1 = _step(x + a, sx)
            v2, g2 = _step(x - a, sx)
            v3, g3 = _step(x + a - s, sx)
            v4, g4 = _step(x - a + s, sx)
            v5, g5 = _step(y + b, sy)
            v6, g6 = _step(y - b, sy)
            v7, g7 = _step(y + 0.5 * s, sy)
            v8, g8 = _step(y - 0.5 * s, sy)
            outer, inner, tall, low = v1 - v2, v3 - v4, v5 - v6, v7 - v8
            values[i] += (outer - inner) * tall + inner * low
            cx = (g1 - g2 - g3 + g4) * tall + (g3 - g4) * low
            cy = (outer - inner) * (g5 - g6) + inner * (g7 - g8)
            slopes[i, 0] += cx
            slopes[i, 1] += cy
            slopes[i, 2] += f * cx
            slopes[i, 3] += f * cy
            slopes[i, 4] += 0.5 * ((g1 + g2 - g3 - g4) * tall + (g3 + g4) * low)
            slopes[i, 5] += (g3 + g4) * (tall - low) + inner * 0.5 * (g7 + g8)
            blur_x = -((x + a) * g1 - (x - a) * g2)
            blur_in = -((x + a - s) * g3 - (x - a + s) * g4)
            blur_tall = -((y + b) * g5 - (y - b) * g6)
            blur_low = -((y + 0.5 * s) * g7 - (y - 0.5 * s) * g8)
            slopes[i, 6] += (blur_x - blur_in) * tall + blur_in * low + (outer - inner) * blur_tall + inner * blur_low
    return values / samples, slopes / samples


@numba.njit(cache=True)
def parts(rays, to_mark, sweep, samples, sizes, sigmas):
    """Shares (N, 7) of the mark's parts: half legs left low, left high, right low, right high, bar, gaps low and high.

    The gaps are the two fields between the legs, which the mark leaves free. Arguments as of `appearance`.
    """
    out = np.zeros((len(rays), 7))
    a, b, s = 0.5 * sizes[0], 0.5 * sizes[1], sizes[2]
    for i in range(len(rays)):
        for k in range(samples):
            f = (k + 0.5) / samples - 0.5
            rx, ry = rays[i, 0] + f * sweep[0], rays[i, 1] + f * sweep[1]
            q = to_mark[2, 0] * rx + to_mark[2, 1] * ry + to_mark[2, 2]
            x = (to_mark[0, 0] * rx + to_mark[0, 1] * ry + to_mark[0, 2]) / q
            y = (to_mark[1, 0] * rx + to_mark[1, 1] * ry + to_mark[1, 2]) / q
            if abs(x) > a + 6.0 * sigmas[0] or abs(y) > b + 6.0 * sigmas[1]:
                continue
            x1, x2 = _step(x + a, sigmas[0])[0], _step(x + a - s, sigmas[0])[0]
            x3, x4 = _step(x - a + s, sigmas[0])[0], _step(x - a, sigmas[0])[0]
            y1, y2 = _step(y + b, sigmas[1])[0], _step(y + 0.5 * s, sigmas[1])[0]
            y3, y4 = _step(y - 0.5 * s, sigmas[1])[0], _step(y - b, sigmas[1])[0]
            middle = _step(y, sigmas[1])[0]
            out[i, 0] += (x1 - x2) * (y1 - middle)
            out[i, 1] += (x1 - x2) * (middle - y4)
            out[i, 2] += (x3 - x4) * (y1 - middle)
            out[i, 3] += (x3 - x4) * (middle - y4)
            out[i, 4] += (x2 - x3) * (y2 - y3)
            out[i, 5] += (x2 - x3) * (y1 - y2)
            out[i, 6] += (x2 - x3) * (y3 - y4)
    return out / samples

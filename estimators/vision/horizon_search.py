"""Where a horizon may be: the line that parts the picture into two unlike regions, then the end of the sky.

Regions: for every line of a coarse grid the picture's two parts are taken for Gaussian in colour, and the line that
makes the picture likeliest wins. Its measure is the logarithm of the determinants of the parts' covariances, each by
its share of the picture; Ettinger et al. (2002) add the determinants, which lets a small part count as much as a
large one. Clouds, fields and shadows vary a region but seldom part the picture in two.

End of the sky: far land is often nearly as pale as the sky, and the line above then stands at its near edge. So every
column of a strip across that line is parted for itself into an upper and a lower piece, each with a mean and a spread
of its own. The sky's spread is small, so even a faint band of far land costs it much. The line along which the columns
lose least together is the horizon; what one column may lose is limited, so that a tree, a tower or an aeroplane
does not bend it.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

STEEPEST = math.radians(75.0)  # of the line in the picture
COARSE_STEP = math.radians(3.0)
COARSE_SIZE = 48  # [px] longer side of the coarse picture
LEAST_SHARE = 0.03  # of the picture, on either side of the line
TEXTURE = 10.0  # [grey levels] of grain in every region: a flat one is not infinitely likely
ABOVE, BELOW = 0.165, 0.105  # of the longer side: the strip about a line
COLUMNS = 120  # places along the line
LEAST_PIECE = 4  # [px] of a column, above and below
QUIET = 2.0  # [grey levels] spread that no piece is below
MOST_LOSS = 120.0  # [nats] of one column of three colours
NEAR = 4.0  # [px] a column whose own best place is so near supports the line
BESIDE = 0.25  # of the longer side: the regions on either side of a line that are compared
QUARTER = 0.25  # of the width: Huang's shortest horizon
# turns about the line so far: most, step, what a turn by the most costs (share of the most loss)
ROUNDS = ((math.radians(6.0), math.radians(0.75), 0.08), (math.radians(5.0), math.radians(0.5), 0.08))


@dataclass(frozen=True, eq=False)
class Line:
    """Where the sky ends: y cos(angle) + x sin(angle) = offset, [px] from the middle of the search picture."""

    angle: float  # [rad] positive: rises to the right
    offset: float
    support: float  # [0..1] share of the columns whose own best place lies at the line
    along: Floats  # (N,) [px] places along the line of those columns, from its foot
    beside: Floats  # (N,) [px] how far below the line each of them has its own best place
    step: Floats  # (C,) colour above less colour below
    grain: float = 0.0  # texture above the line over texture below
    apart: float = 0.0  # difference of the regions' means above and below, over their spread


class HorizonSearch:
    """Finds where the sky ends in pictures (H, W, C) of one size."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        size = max(width, height)
        scale = COARSE_SIZE / size
        self._coarse = max(8, round(width * scale)), max(8, round(height * scale))
        self._scale = size / max(self._coarse)
        self._angles = np.arange(-STEEPEST, STEEPEST + 1e-9, COARSE_STEP)
        w, h = self._coarse
        y, x = (axis.ravel() - (n - 1) / 2 for axis, n in zip(np.mgrid[0:h, 0:w], (h, w), strict=True))
        self._half = math.ceil(math.hypot(w, h) / 2)
        self._bins = 2 * self._half + 1
        offsets = np.cos(self._angles)[:, None] * y + np.sin(self._angles)[:, None] * x
        rows = np.floor(offsets + 0.5).astype(int) + self._half + self._bins * np.arange(len(self._angles))[:, None]
        pixels = np.broadcast_to(np.arange(w * h), rows.shape)
        shape = len(self._angles) * self._bins, w * h
        self._sums = csr_matrix((np.ones(rows.size, np.float32), (rows.ravel(), pixels.ravel())), shape)
        self._along = np.linspace(-0.7, 0.7, COLUMNS) * size
        self._across = np.arange(-round(ABOVE * size), round(BELOW * size) + 1.0)

    def find(self, picture: Image) -> Line | None:
        """The line in a picture (H, W, C); None where no line is as long as a quarter of the width."""
        found: tuple[float, float] | None = self._regions(picture)
        smooth = np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.8), np.uint8)
        line = None
        for most, step, price in ROUNDS:
            if found is None:
                return None
            line = self._end_of_sky(smooth, *found, np.arange(-most, most + 1e-9, step), price)
            found = None if line is None else (line.angle, line.offset)
        return None if line is None else self._judged(picture, line)

    def _judged(self, picture: Image, line: Line) -> Line:
        """The line with what tells a sky from a field: its grain, and how far it differs from the ground."""
        colours = picture.reshape(self.height, self.width, -1)
        y, x = np.ogrid[0 : self.height, 0 : self.width]
        below = (y - (self.height - 1) / 2) * math.cos(line.angle) + (x - (self.width - 1) / 2) * math.sin(line.angle)
        below = below - line.offset
        near = np.abs(below) < BESIDE * max(self.width, self.height)
        sky, ground = near & (below < 0.0), near & (below > 0.0)
        size = float(np.linalg.norm(line.step))
        if size <= 0.0 or not sky.any() or not ground.any():
            return line
        texture = np.abs(cv2.Laplacian(picture, cv2.CV_16S)).reshape(colours.shape)[..., 0]
        grain = float(texture[below < 0.0].mean()) / max(float(texture[below > 0.0].mean()), 0.1)
        a, b = (colours[part] @ (line.step / size) for part in (sky, ground))
        spread = math.sqrt(0.5 * float(a.var() + b.var()) + 9.0)
        return replace(line, grain=grain, apart=float(a.mean() - b.mean()) / spread)

    def _regions(self, picture: Image) -> tuple[float, float]:
        """Angle [rad] and offset [px] of the likeliest line."""
        small = cv2.resize(picture, self._coarse, interpolation=cv2.INTER_AREA).reshape(-1, picture.shape[2])
        # about the mean, so that single precision serves
        values = small.astype(np.float32) - small.mean(axis=0, dtype=np.float32)
        c = values.shape[1]
        i, j = np.triu_indices(c)
        moments = np.column_stack([np.ones(len(values), np.float32), values, values[:, i] * values[:, j]])
        above = (self._sums @ moments).reshape(len(self._angles), self._bins, -1).cumsum(axis=1)
        whole = above[:, -1:]
        total = float(len(values))
        likelihood = np.zeros(above.shape[:2])
        for part in (above, whole - above):
            number = np.maximum(part[..., :1], 1.0)
            mean = part[..., 1 : c + 1] / number
            covariance = np.empty((*part.shape[:2], c, c))
            covariance[..., i, j] = covariance[..., j, i] = part[..., c + 1 :] / number
            covariance -= mean[..., :, None] * mean[..., None, :]
            covariance += TEXTURE**2 * np.eye(c)
            likelihood -= part[..., 0] / total * np.log(_determinant(covariance))
            likelihood[part[..., 0] < LEAST_SHARE * total] = -np.inf
        row, column = np.unravel_index(np.argmax(likelihood), likelihood.shape)
        # the bins above are those up to this one: the line runs half a pixel further
        return float(self._angles[row]), (int(column) - self._half + 0.5) * self._scale

    def _end_of_sky(self, smooth: Image, angle: float, offset: float, turns: Floats, price: float) -> Line | None:
        """The line near another one that the columns across it, parted there, can best bear."""
        along, across = self._along, self._across
        c, s = math.cos(angle), math.sin(angle)
        x = along[:, None] * c + (offset + across) * s + (self.width - 1) / 2
        y = -along[:, None] * s + (offset + across) * c + (self.height - 1) / 2
        inside = (x >= 0) & (x <= self.width - 1) & (y >= 0) & (y <= self.height - 1)
        strip = cv2.remap(smooth, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
        strip = strip.reshape(*x.shape, -1)
        losses, best = _losses(strip, inside)
        spacing = float(along[1] - along[0])
        score, number = _sheared(losses, spacing * np.tan(turns))
        score /= MOST_LOSS * np.maximum(number, 1.0)
        score -= price * (turns[:, None] / turns[-1]) ** 2
        score[number < max(0.5 * number.max(), QUARTER * self.width / spacing)] = -1.0
        i, k = np.unravel_index(np.argmax(score), score.shape)
        if score[i, k] <= 0.0:
            return None
        turn = float(turns[i])
        if 0 < i < len(turns) - 1 and score[i - 1 : i + 2, k].min() > -1.0:
            left, middle, right = score[i - 1 : i + 2, k]
            if left - 2.0 * middle + right < 0.0:
                turn += 0.5 * (left - right) / (left - 2.0 * middle + right) * float(turns[1] - turns[0])
        # a piece that ends before row k ends half a pixel above it
        place = across[0] + k - 0.5 + along * math.tan(turn)
        there = (best >= 0) & (place > across[0]) & (place < across[-1])
        near = there & (np.abs(across[0] + best - 0.5 - place) <= NEAR)
        if not near.any():
            return None
        columns = np.flatnonzero(near)
        rows = np.clip(np.rint(place - across[0]).astype(int), 3, len(across) - 4)[near]
        step = np.mean([strip[columns, rows - d].astype(float) - strip[columns, rows + d] for d in (2, 3)], axis=(0, 1))
        ends = across[0] + _steepest(strip[columns] @ step, best[near])
        return Line(
            angle - turn, (offset + across[0] + k - 0.5) * math.cos(turn), float(near.sum() / there.sum()),
            along[near], ends - place[near], step,
        )  # fmt: skip


def _determinant(m: Floats) -> Floats:
    """Of matrices (..., 1, 1) or (..., 3, 3): many times as fast as the general one."""
    if m.shape[-1] == 1:
        return np.asarray(m[..., 0, 0])
    return np.asarray(np.sum(m[..., 0, :] * np.cross(m[..., 1, :], m[..., 2, :]), axis=-1))


def _steepest(profiles: Floats, before: NDArray[np.int64]) -> Floats:
    """Row (N,) of the steepest fall of profiles (N, R) near the row before which each was parted, by a parabola.

    The mixed pixels of a blurred edge go to the piece that varies more, so the parting itself is off by a pixel.
    """
    reach = np.arange(-3, 3)
    middle = np.clip(before, 4, profiles.shape[1] - 4)
    rows = middle[:, None] + reach
    number = np.arange(len(profiles))[:, None]
    fall = profiles[number, rows - 1] - profiles[number, rows]  # half a pixel above `rows`
    best = np.argmax(fall[:, 1:-1], axis=1) + 1
    number = number[:, 0]
    left, top, right = fall[number, best - 1], fall[number, best], fall[number, best + 1]
    curvature = left - 2.0 * top + right
    shift = np.where(curvature < 0.0, 0.5 * (left - right) / np.where(curvature < 0.0, curvature, -1.0), 0.0)
    return np.asarray(rows[number, best] - 0.5 + np.clip(shift, -0.5, 0.5))


@numba.njit(cache=True)
def _losses(strip, inside):
    """What each column of a strip (N, R, C) loses by being parted before row r (N, R + 1), and its best place (N,).

    [nats] more than at its best place; NaN and -1 where a piece would be too short. A piece of n pixels with variance
    v costs n log v, added over the colours: twice the negative logarithm of its Gaussian likelihood.
    """
    count, rows, colours = strip.shape
    out = np.full((count, rows + 1), np.nan)
    best = np.full(count, -1)
    sums = np.zeros((rows + 1, colours))
    squares = np.zeros((rows + 1, colours))
    numbers = np.zeros(rows + 1)
    floor = QUIET * QUIET
    for i in range(count):
        for r in range(rows):
            take = 1.0 if inside[i, r] else 0.0
            numbers[r + 1] = numbers[r] + take
            for c in range(colours):
                value = take * strip[i, r, c]
                sums[r + 1, c] = sums[r, c] + value
                squares[r + 1, c] = squares[r, c] + value * value
        least = np.inf
        for r in range(rows + 1):
            upper, lower = numbers[r], numbers[rows] - numbers[r]
            if upper < LEAST_PIECE or lower < LEAST_PIECE:
                continue
            loss = 0.0
            for c in range(colours):
                a, b = sums[r, c], sums[rows, c] - sums[r, c]
                spread_a = squares[r, c] - a * a / upper
                spread_b = squares[rows, c] - squares[r, c] - b * b / lower
                loss += upper * math.log((spread_a + 3.0 * floor) / (upper + 3.0))
                loss += lower * math.log((spread_b + 3.0 * floor) / (lower + 3.0))
            out[i, r] = loss * 3.0 / colours
            if out[i, r] < least:
                least = out[i, r]
                best[i] = r
        for r in range(rows + 1):
            out[i, r] -= least
    return out, best


@numba.njit(cache=True)
def _sheared(losses, shears):
    """What is spared of the most loss along lines, and over how many columns, (S, R) each.

    losses (N, R); shears (S,): rows further down per column; a line of row r crosses the middle of the columns there.
    """
    count, rows = losses.shape
    spared = np.zeros((len(shears), rows))
    number = np.zeros((len(shears), rows))
    for j in range(len(shears)):
        for i in range(count):
            shift = shears[j] * (i - 0.5 * (count - 1))
            whole = math.floor(shift)
            share = shift - whole
            for r in range(max(0, -whole), min(rows, rows - whole - 1)):
                loss = (1.0 - share) * losses[i, r + whole] + share * losses[i, r + whole + 1]
                if not math.isnan(loss):
                    spared[j, r] += MOST_LOSS - min(loss, MOST_LOSS)
                    number[j, r] += 1.0
    return spared, number

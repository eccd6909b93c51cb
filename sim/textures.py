"""Pictures painted on the ground: the mark from its outline, grass and waves from band-limited noise.

All painters are deterministic and return uint8 RGB (H, W, 3); row 0 is north, column 0 is west.
"""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from flightlog.marks import Disc, Mark, Tone

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]

MARK_TEXELS = 1536  # over the whole pad: about 1 mm a texel
PAINT = 0.93  # reflectance of the mark
GREY = 0.58  # of its light grey parts
ASPHALT = 0.17  # of the square around it
TONES: dict[Tone, float] = {"white": PAINT, "grey": GREY, "black": ASPHALT}


def coverage(outline: Floats, side: float, texels: int) -> Floats:
    """Share (texels, texels) of each texel's area inside an outline (N, 2) [m] whose edges run along the axes.

    Exact: Green's theorem, one outer product for each of the outline's edges along x. The picture spans
    [-side/2, side/2] in both axes; row 0 is the texel at +y, as textures are stored.
    """
    low = (np.arange(texels) / texels - 0.5) * side
    texel = side / texels
    whole = np.zeros((texels, texels))
    (west, south), (east, north) = outline.min(axis=0), outline.max(axis=0)
    columns, rows = _span(west, east, side, texels), _span(south, north, side, texels)
    area = whole[rows, columns]
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 != y1:
            if x0 != x1:
                raise ValueError("outline has an edge that runs along neither axis")
            continue
        along = np.clip(np.array([[x0], [x1]]) - low[columns], 0.0, texel)
        below = np.clip(y0 - low[rows], 0.0, texel)
        area += np.outer(below, along[0] - along[1])  # counter-clockwise: the lower edges, which run to +x, subtract
    area /= texel**2
    return whole[::-1]


def _span(low: float, high: float, side: float, texels: int) -> slice:
    """The texels that lie between two places [m], and one more on either side."""
    first, last = ((place / side + 0.5) * texels for place in (low, high))
    return slice(max(int(first) - 1, 0), min(int(last) + 2, texels))


def disc_coverage(x: float, y: float, radius: float, side: float, texels: int) -> Floats:
    """Share (texels, texels) of each texel's area inside a disc, its centre and radius [m]; picture as in `coverage`.

    The edge is taken as straight within a texel: wrong by texel / (8 radius) of one at most.
    """
    centres = ((np.arange(texels) + 0.5) / texels - 0.5) * side
    columns_near, rows_near = (_span(at - radius, at + radius, side, texels) for at in (x, y))
    whole = np.zeros((texels, texels))
    east, north = centres[None, columns_near] - x, centres[rows_near, None] - y
    away = np.hypot(east, north)
    share = (away < radius).astype(float)
    rim = np.abs(away - radius) < side / texels
    rows, columns = np.nonzero(rim)
    inward = (radius - away[rim]) * texels / side  # [texels] of the edge beyond the texel's centre
    # a half plane covers a unit square by its integrated trapezoid: the square's shadow along the edge's normal
    along = np.abs(np.stack([east[0, columns], north[rows, 0]])) / np.maximum(away[rim], 1e-12)
    long, short = along.max(axis=0), np.maximum(along.min(axis=0), 1e-9)
    ramp = [np.maximum(inward + sign * 0.5 * long + other * 0.5 * short, 0.0) ** 2 for sign, other in _CORNERS]
    share[rim] = np.clip((ramp[0] - ramp[1] - ramp[2] + ramp[3]) / (2.0 * long * short), 0.0, 1.0)
    whole[rows_near, columns_near] = share
    return whole[::-1]


_CORNERS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def noise(shape: tuple[int, int], slope: float, seed: int, shortest: float = 2.0) -> Floats:
    """Periodic noise of unit variance; its amplitude falls as frequency**-slope, down to `shortest` texels."""
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
    frequency = np.hypot(fy, fx)
    frequency[0, 0] = np.inf
    amplitude = frequency**-slope * np.exp(-((frequency * shortest) ** 2))
    rng = np.random.default_rng(seed)
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal(shape)) * amplitude, s=shape)
    return np.asarray(field / field.std())


def _picture(values: Floats) -> Picture:
    return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)


@cache
def paint_mark(mark: Mark, texels: int = MARK_TEXELS) -> Picture:
    """A mark on its dark square; edges lie where `mark.shapes()` has them, texels on them mixed by area."""
    grain = noise((512, 512), 0.5, seed=1, shortest=6.0).astype(np.float32)
    repeats = -(-texels // 512)
    ground = np.tile(ASPHALT + 0.012 * grain, (repeats, repeats))[:texels, :texels]
    for shape in mark.shapes():
        if isinstance(shape, Disc):
            share = disc_coverage(shape.x, shape.y, shape.radius, mark.square, texels)
        else:
            share = coverage(np.array(shape.corners), mark.square, texels)
        ground = ground + share.astype(np.float32) * (TONES[shape.tone] - ground)
    return np.asarray(cv2.cvtColor(_picture(ground), cv2.COLOR_GRAY2RGB), np.uint8)


@cache
def paint_grass(texels: int) -> Picture:
    """Mown grass: a spectrum close to 1/f, so that there is something to see from every height."""
    broad = noise((texels, texels), 1.3, seed=2)
    blades = noise((texels, texels), 0.35, seed=3)
    straw = np.clip(0.5 + 0.45 * noise((texels, texels), 1.0, seed=4), 0.0, 1.0)[..., None]
    shade = np.clip(1.0 + 0.14 * broad + 0.20 * blades, 0.35, 1.7)[..., None]
    colour = (1.0 - straw) * np.array([0.25, 0.37, 0.15]) + straw * np.array([0.38, 0.43, 0.21])
    return _picture(colour * shade)


@cache
def paint_waves(texels: int) -> Picture:
    """A choppy sea: crests drawn out across the wind, a few of them white."""
    chop = noise((texels, texels // 2), 1.15, seed=5).repeat(2, axis=1)
    swell = noise((texels, texels), 1.5, seed=6)
    height = 0.7 * chop + 0.7 * swell
    colour = np.array([0.10, 0.25, 0.33]) + 0.045 * np.clip(height, -2, 3)[..., None] * np.array([0.7, 1.0, 1.05])
    foam = np.clip((height - 2.35) * 1.6, 0.0, 0.75)[..., None]
    return _picture(colour * (1.0 - foam) + 0.85 * foam)


@cache
def paint_deck(texels: int) -> Picture:
    """A flight deck of 14 m by 20 m: worn non-skid paint on plates, points to tie down to, a line along its edge."""
    x, y = np.meshgrid((np.arange(texels) + 0.5) / texels * 14.0, (np.arange(texels) + 0.5) / texels * 20.0)
    worn = 1.0 + 0.07 * noise((texels, texels), 0.9, seed=13) + 0.05 * noise((texels, texels), 0.1, seed=14)
    colour = np.array([0.30, 0.33, 0.32]) * worn[..., None]
    seam = np.minimum(np.minimum(x % 2.0, 2.0 - x % 2.0), np.minimum(y % 2.5, 2.5 - y % 2.5))
    colour *= (1.0 - 0.3 * np.clip(1.5 - seam / 0.02, 0.0, 1.0))[..., None]
    tied = np.hypot((x - 1.0) % 2.0 - 1.0, (y - 1.25) % 2.5 - 1.25)
    colour *= (1.0 - 0.5 * np.clip((0.09 - tied) / 0.02, 0.0, 1.0))[..., None]
    edge = np.minimum(np.minimum(x, 14.0 - x), np.minimum(y, 20.0 - y))
    line = np.clip((0.06 - np.abs(edge - 0.35)) / 0.02 + 0.5, 0.0, 1.0)[..., None]
    return _picture(colour + line * (0.8 - colour))


FAR_SIDE = 3600.0  # [m] of the far ground's picture
FIELDS = np.array(  # grass, meadow, straw, wood, plough
    [(0.30, 0.41, 0.17), (0.36, 0.44, 0.20), (0.46, 0.45, 0.25), (0.26, 0.36, 0.16), (0.40, 0.35, 0.24)]
)
FADE = (250.0, 1500.0)  # [m] distances between which it fades into the far colour


def _fade(ground: Floats, far: tuple[float, float, float]) -> Picture:
    """A picture of the far ground (N, N, 3) that turns into the far colour with distance."""
    texels = len(ground)
    c = ((2.0 * np.arange(texels) + 1.0) / texels - 1.0) * FAR_SIDE / 2
    distance = np.hypot(c[:, None], c[None, :])
    share = np.clip(np.log(distance / FADE[0]) / np.log(FADE[1] / FADE[0]), 0.0, 1.0)[..., None]
    share = share * share * (3.0 - 2.0 * share)
    return _picture(ground + share * (np.array(far) - ground))


@cache
def paint_meadow(texels: int, far: tuple[float, float, float]) -> Picture:
    """Fields around the mown grass: patches of green, straw and plough, parted by hedges."""
    rng = np.random.default_rng(9)
    c = (np.arange(texels) + 0.5) / texels * FAR_SIDE
    x, y = np.meshgrid(c, c)
    bend = 14.0 * noise((texels, texels), 1.6, seed=10)
    x, y = 0.94 * x + 0.34 * y + bend, -0.34 * x + 0.94 * y - bend
    column = np.floor(x / 170.0).astype(int)
    row = np.floor((y + 61.0 * (column % 3)) / 120.0).astype(int)
    plan = FIELDS[rng.choice(len(FIELDS), size=(64, 64), p=[0.34, 0.27, 0.14, 0.17, 0.08])]
    colour = plan[row % 64, column % 64] * (1.0 + 0.07 * noise((texels, texels), 0.8, seed=11))[..., None]
    edge = np.minimum(x % 170.0, (y + 61.0 * (column % 3)) % 120.0)
    hedge = np.clip(1.5 - edge / 4.0, 0.0, 1.0)[..., None]
    colour = colour + hedge * (np.array([0.14, 0.22, 0.10]) - colour)
    # mown grass goes on for a while beyond the detailed square
    middle = (texels - 1) / 2 * FAR_SIDE / texels
    i, j = np.meshgrid(np.arange(texels) * FAR_SIDE / texels - middle, np.arange(texels) * FAR_SIDE / texels - middle)
    near = (1.0 / (1.0 + np.exp((np.maximum(np.abs(i) / 1.3, np.abs(j)) - 95.0) / 3.0)))[..., None]
    return _fade(colour + near * (np.array([0.315, 0.40, 0.18]) - colour), far)


@cache
def paint_swell(texels: int, far: tuple[float, float, float]) -> Picture:
    """The sea beyond the near waves."""
    height = noise((texels, texels // 2), 0.9, seed=12).repeat(2, axis=1)
    colour = np.array([0.10, 0.25, 0.33]) + 0.018 * height[..., None] * np.array([0.7, 1.0, 1.05])
    return _fade(colour, far)

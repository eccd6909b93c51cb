"""Skies painted as cube maps: gradient, clouds, and what stands on the horizon.

The lower half of each cube is the colour into which the ground fades. The edge between the halves lies between two rows
of texels of the four side faces, so the line is straight and at elevation 0 whatever the far clipping plane. With `dip`
the lower part begins DIP_ROOM below, and a far disc drawn in front of it carries the true line.
"""

import math
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from sim.textures import Picture, noise

Floats = NDArray[np.float32]

DIP_ROOM = math.radians(3.0)  # [rad] below the horizon to which the sky goes on, behind the far disc
PALE = np.array([0.80, 0.86, 0.92], np.float32)  # the sky at the horizon
DEEP = np.array([0.27, 0.47, 0.78], np.float32)  # and at the zenith
CLOUD_TEXELS = 384  # of a face; clouds are soft and are painted coarser than the horizon


@dataclass(frozen=True)
class Silhouette:
    """One range of hills or an island on the horizon."""

    azimuth_deg: float  # of its middle, clockwise from north
    breadth_deg: float  # half of its angular width
    height_deg: float  # of its summit
    rough: float  # [1] how jagged
    colour: tuple[float, float, float]


def directions(texels: int, rows: slice = slice(None)) -> Floats:
    """Unit vectors (6, rows, texels, 3) ENU of a cube map's texels, in MuJoCo's order: +x, -x, +z, -z, -y, +y.

    MuJoCo stores the faces right, left, up, down, front, back; front is -y, back +y, and sides are mirrored as seen
    from inside (determined by rendering a cube of numbered faces; a test does so again).
    """
    c = ((2.0 * np.arange(texels) + 1.0) / texels - 1.0).astype(np.float32)
    a, b = np.meshgrid(c, c[rows])  # a: along a row, b: down the rows
    one = np.ones_like(a)
    faces = [(one, a, -b), (-one, -a, -b), (a, -b, one), (a, b, -one), (a, -one, -b), (-a, one, -b)]
    out = np.stack([np.stack(face, axis=-1) for face in faces])
    return np.asarray(out / np.linalg.norm(out, axis=-1, keepdims=True))


def _air(d: Floats, cover: float) -> Floats:
    """Colour (..., 3) of gradient and clouds in the directions d (..., 3); `cover`: share of the sky under cloud."""
    up = d[..., 2]
    share = (1.0 - np.exp(-3.2 * np.clip(up, 0.0, 1.0))) / (1.0 - np.exp(-3.2))
    colour = PALE + share[..., None] * (DEEP - PALE)
    # a flat layer of clouds, drawn together towards the horizon as perspective does, and fading into haze there
    layer = noise((512, 512), 1.55, seed=7).astype(np.float32)
    scale = 0.09 * 512 / np.maximum(up, 0.02)
    u, v = ((d[..., k] * scale % 512).astype(np.float32).reshape(-1, d.shape[-2]) for k in (0, 1))
    density = cv2.remap(layer, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP).reshape(up.shape)
    cloud = np.clip((density - 2.6 * (0.5 - cover)) * 0.9, 0.0, 1.0) * np.clip(up / 0.12 - 0.15, 0.0, 1.0)
    shaded = 0.97 - 0.16 * np.clip(density - 0.6, 0.0, 1.0)
    return np.asarray(colour + cloud[..., None] * (shaded[..., None] - colour))


def _raise(colour: Floats, d: Floats, hill: Silhouette, ridge: Floats, texel: float) -> None:
    """Paint one silhouette over `colour` (..., 3); its upper edge is mixed over one texel."""
    elevation, azimuth = np.arcsin(d[..., 2]), np.arctan2(d[..., 0], d[..., 1])
    middle, breadth, height = np.radians([hill.azimuth_deg, hill.breadth_deg, hill.height_deg])
    offset = (azimuth - middle + np.pi) % (2 * np.pi) - np.pi
    jagged = np.interp(azimuth % (2 * np.pi), np.linspace(0.0, 2 * np.pi, len(ridge) + 1), [*ridge, ridge[0]])
    summit = height * np.clip(1.0 - (offset / breadth) ** 2, 0.0, None) * (1.0 + hill.rough * jagged)
    # nothing, not even half a texel at the horizon, where there is no hill
    share = np.clip((summit - elevation) / texel + 0.5, 0.0, 1.0) * np.clip(summit / texel, 0.0, 1.0)
    haze = 0.25 * np.exp(-np.maximum(elevation, 0.0) / 0.03)[..., None]
    colour += share[..., None] * (np.array(hill.colour, np.float32) * (1.0 - haze) + PALE * haze - colour)


def paint_sky(
    texels: int, far: tuple[float, float, float], cover: float, silhouettes: tuple[Silhouette, ...], dip: bool
) -> Picture:
    """Cube map (6 * texels, texels, 3); `far`: colour of the ground's far end, `cover`: share of sky under cloud."""
    coarse = np.rint(255.0 * np.clip(_air(directions(CLOUD_TEXELS), cover), 0.0, 1.0)).astype(np.uint8)
    picture = np.stack([cv2.resize(face, (texels, texels), interpolation=cv2.INTER_LINEAR) for face in coarse])
    sides, middle = [0, 1, 4, 5], texels // 2
    line = middle + (round(np.tan(DIP_ROOM) * middle) if dip else 0)
    # hills and islands stand in the rows just above the middle; with dip they go on below it, behind the disc
    highest = np.tan(np.radians(2.0 * max((s.height_deg for s in silhouettes), default=0.0)))
    rows = slice(middle - math.ceil(1.5 * highest * middle) - 2, line)
    ridge = noise((16, 4096), 1.0, seed=8, shortest=9.0)[0].astype(np.float32)
    band, seen = picture[sides, rows].astype(np.float32) / 255.0, directions(texels, rows)[sides]
    for hill in silhouettes:
        _raise(band, seen, hill, ridge, np.pi / 2 / texels)
    picture[sides, rows] = np.rint(255.0 * np.clip(band, 0.0, 1.0))
    ground = np.rint(255.0 * np.array(far)).astype(np.uint8)
    picture[sides, line:] = ground
    picture[3] = ground
    return picture.reshape(6 * texels, texels, 3)


HILLS = (
    Silhouette(300.0, 55.0, 1.9, 0.30, (0.50, 0.58, 0.66)),
    Silhouette(340.0, 40.0, 1.2, 0.25, (0.38, 0.48, 0.46)),
    Silhouette(120.0, 35.0, 1.4, 0.30, (0.46, 0.55, 0.60)),
    Silhouette(185.0, 18.0, 0.8, 0.20, (0.36, 0.46, 0.40)),
)
ISLANDS = (
    Silhouette(25.0, 7.0, 1.5, 0.35, (0.36, 0.44, 0.46)),
    Silhouette(41.0, 2.5, 0.7, 0.25, (0.42, 0.50, 0.54)),
    Silhouette(155.0, 10.0, 1.1, 0.35, (0.40, 0.48, 0.52)),
    Silhouette(260.0, 5.0, 1.9, 0.40, (0.33, 0.41, 0.42)),
)


@cache
def paint_field_sky(texels: int, far: tuple[float, float, float], dip: bool) -> Picture:
    """Fair-weather clouds over low hills."""
    return paint_sky(texels, far, 0.42, HILLS, dip)


@cache
def paint_sea_sky(texels: int, far: tuple[float, float, float], dip: bool) -> Picture:
    """More clouds, a few islands."""
    return paint_sky(texels, far, 0.55, ISLANDS, dip)

"""Pictures of the courtyard: worn concrete slabs underfoot, plastered walls.

All painters are deterministic and return uint8 RGB (H, W, 3).
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from sim.textures import Picture, noise

Floats = NDArray[np.float64]

FLOOR_SIDE = 2.4  # [m] after which the floor's picture is repeated
SLABS = 6  # a side of it: 0.4 m each
JOINT = 0.006  # [m] width of the joints


def _picture(values: Floats) -> Picture:
    return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)


@cache
def paint_paving(texels: int) -> Picture:
    """Concrete slabs: each of its own shade, grit of some millimetres, stains of some decimetres, sanded joints."""
    rng = np.random.default_rng(21)
    c = (np.arange(texels) + 0.5) / texels * SLABS
    slab = c.astype(int)
    shade = (0.55 + 0.04 * rng.standard_normal((SLABS, SLABS)))[slab[:, None], slab[None, :]]
    stains = noise((texels, texels), 1.6, seed=22)
    grit = noise((texels, texels), 0.4, seed=23, shortest=3.0)
    pebbles = noise((texels, texels), 0.0, seed=24, shortest=5.0)
    value = shade * (1.0 + 0.06 * stains + 0.07 * grit)
    value = value + 0.10 * np.clip(pebbles - 1.6, 0.0, 1.5) - 0.15 * np.clip(-pebbles - 1.7, 0.0, 1.5)
    # distance to the nearest joint, whose edges are a little broken
    away = np.abs((c + 0.5) % 1.0 - 0.5) * FLOOR_SIDE / SLABS
    joint = np.minimum(away[:, None], away[None, :]) + 0.0012 * noise((texels, texels), 0.3, seed=25, shortest=4.0)
    sand = np.clip((JOINT / 2 + 0.001 - joint) / 0.002, 0.0, 1.0)
    value = value + sand * (0.24 * (1.0 + 0.2 * grit) - value)
    return _picture(value[..., None] * np.array([1.0, 0.985, 0.95]))


@cache
def paint_plaster(texels: int) -> Picture:
    """A plastered wall, darker and dirtier towards its foot."""
    rise = (1.0 - (np.arange(texels) + 0.5) / texels)[:, None]
    value = 0.78 - 0.2 * np.exp(-rise / 0.08) + 0.03 * noise((texels, texels), 1.2, seed=26)
    value = value * (1.0 + 0.04 * noise((texels, texels), 0.4, seed=27))
    return _picture(value[..., None] * np.array([1.0, 0.96, 0.87]))

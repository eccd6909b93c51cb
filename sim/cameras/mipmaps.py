"""Levels of detail of the mark's texture, filtered so that an edge stays where it is painted.

A graphics card averages 2 x 2 texels from level to level. An edge that does not lie on a texel's border then has a
lopsided profile: its area is right, but the place of its steepest slope is off by up to 0.03 texels, always the same
way, and a 1 m H at 10 m looked 0.06 % too small. A little Gaussian blur before each level is sampled makes profiles
the same wherever the edge lies, and the next finer level than usual keeps pictures as sharp as pixels of finite area.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

SPREAD = 0.8  # [texels] standard deviation of the blur before a level is sampled
FINER = -1.0  # [levels] than the one whose texels are as large as pixels
OVERSAMPLED = 4  # a level is blurred where texels are so many times smaller


def levels(picture: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """A square picture (N, N, 3) at N, N/2, N/4, ... 1 texels, each from the first."""
    fine = picture.astype(np.float32)
    out, texels = [], len(picture)
    while texels >= 1:
        times = min(OVERSAMPLED, len(picture) // texels)
        level = cv2.resize(fine, (times * texels, times * texels), interpolation=cv2.INTER_AREA)
        level = cv2.GaussianBlur(level, (0, 0), SPREAD * times, borderType=cv2.BORDER_REPLICATE)
        level = cv2.resize(level, (texels, texels), interpolation=cv2.INTER_AREA)
        out.append(np.rint(level).astype(np.uint8))
        texels //= 2
    return out


def upload(texture: int, picture: NDArray[np.uint8]) -> None:
    """Replace the levels of an OpenGL texture of the current context by those of `picture` (N, N, 3), its own size."""
    from OpenGL import GL

    GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
    GL.glPixelStorei(GL.GL_UNPACK_ALIGNMENT, 1)
    kind = int(GL.glGetTexLevelParameteriv(GL.GL_TEXTURE_2D, 0, GL.GL_TEXTURE_INTERNAL_FORMAT))
    for i, level in enumerate(levels(picture)):
        n = len(level)
        GL.glTexImage2D(GL.GL_TEXTURE_2D, i, kind, n, n, 0, GL.GL_RGB, GL.GL_UNSIGNED_BYTE, level)
    GL.glTexParameterf(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_LOD_BIAS, FINER)

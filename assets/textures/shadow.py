"""Paints the vehicle's blob shadow, `shadow.png`, on 1.6 x 0.8 m: fuselage and boom along x.

The rotor's own shadow is left out: two blades cover a twentieth of the disc, and blending costs by the area.
Run it as `python shadow.py`; it writes beside itself.
"""

from pathlib import Path

import cv2
import numpy as np

LENGTH, BREADTH = 1.6, 0.8  # [m]; the scenes' shadow geoms are as large
TEXEL = 0.01  # [m]


def opacity() -> np.ndarray:
    """Share of light taken away, (80, 160); row 0 at +y, column 0 at -x."""
    x, y = np.meshgrid(
        np.arange(-LENGTH / 2 + TEXEL / 2, LENGTH / 2, TEXEL), np.arange(BREADTH / 2 - TEXEL / 2, -BREADTH / 2, -TEXEL)
    )
    body = np.exp(-(np.hypot((x - 0.24) / 0.34, y / 0.15) ** 2))
    boom = np.exp(-((y / 0.055) ** 2)) / (1.0 + np.exp((x - 0.1) / 0.05)) / (1.0 + np.exp(-(x + 0.70) / 0.03))
    dark = 1.0 - (1.0 - 0.46 * body) * (1.0 - 0.25 * boom)
    # nothing may be left at the edge
    inside = np.minimum(LENGTH / 2 - np.abs(x), BREADTH / 2 - np.abs(y))
    return dark * np.clip(inside / 0.08, 0.0, 1.0)


if __name__ == "__main__":
    dark = opacity()
    picture = np.zeros((*dark.shape, 4), np.uint8)
    picture[..., 3] = np.rint(255.0 * dark)
    cv2.imwrite(str(Path(__file__).with_name("shadow.png")), picture)

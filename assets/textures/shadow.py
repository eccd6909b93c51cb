"""Paints the vehicle's blob shadow, `shadow.png`, on a square of 2 m: fuselage along x, under a faint rotor disc.

Run it as `python shadow.py`; it writes beside itself.
"""

from pathlib import Path

import cv2
import numpy as np

TEXELS = 128


def opacity() -> np.ndarray:
    """Share of light taken away (TEXELS, TEXELS); row 0 at +y, column 0 at -x."""
    c = (2.0 * np.arange(TEXELS) + 1.0) / TEXELS - 1.0
    x, y = np.meshgrid(c, -c)
    body = np.exp(-np.hypot((x - 0.12) / 0.30, y / 0.11) ** 2)
    boom = np.exp(-((y / 0.05) ** 2)) / (1.0 + np.exp((x + 0.02) / 0.04)) / (1.0 + np.exp(-(x + 0.92) / 0.03))
    rotor = 1.0 / (1.0 + np.exp((np.hypot(x, y) - 0.70) / 0.05))
    dark = 1.0 - (1.0 - 0.42 * body) * (1.0 - 0.22 * boom) * (1.0 - 0.14 * rotor)
    # nothing may be left at the square's edge
    return dark * np.clip((1.0 - np.maximum(np.abs(x), np.abs(y))) / 0.08, 0.0, 1.0)


if __name__ == "__main__":
    picture = np.zeros((TEXELS, TEXELS, 4), np.uint8)
    picture[..., 3] = np.rint(255.0 * opacity())
    cv2.imwrite(str(Path(__file__).with_name("shadow.png")), picture)

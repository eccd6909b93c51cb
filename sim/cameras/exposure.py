"""Exposure: light into grey levels, with saturation."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Exposure:
    """A linear sensor: level = gain * light, clipped at 255. With `target`, the gain follows the picture."""

    gain: float = 1.0  # [1] 1: a white wall in the sun of a clear day comes to about 200
    target: float | None = None  # [grey level] mean that auto exposure steers to; None: fixed gain
    speed: float = 0.25  # [1] share of the way, in log gain, that auto exposure goes each frame

    def next_gain(self, gain: float, mean: float, strength: float) -> float:
        """The gain for the next frame from the mean level [0..255] before exposure of this one."""
        if self.target is None:
            return self.gain
        wanted = self.target / max(mean * strength, 1e-3)
        return float(np.clip(gain * (wanted / gain) ** self.speed, 1 / 64, 64))


@dataclass(frozen=True)
class Curve:
    """The table that an exposure comes to."""

    factor: float  # gain times strength of the light

    @cached_property
    def table(self) -> NDArray[np.uint8]:
        """Levels (256,) after exposure of the rendered levels."""
        return np.rint(np.clip(np.arange(256) * self.factor, 0, 255)).astype(np.uint8)

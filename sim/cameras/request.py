"""What is asked of the renderer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim.light import Light


@dataclass(frozen=True, eq=False, slots=True)
class FrameRequest:
    """One picture to take."""

    camera: str
    t: float  # [s] time of the exposure
    index: int  # frame number of this camera; decides its noise
    qpos: NDArray[np.float64]  # (nq,) generalised positions at t
    qvel: NDArray[np.float64]  # (nv,) generalised velocities at t, for motion blur
    light: Light

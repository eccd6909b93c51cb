"""The height sensors as Lei 2012 believes them, equations 8 to 12, 15 and 17.

Equation 8, pressure to height, is `flightlog.atmosphere`. The others say how each height departs from the true one h0:

    barometer   h_q = h0 + eps_b + w_q     equation 9: a constant bias and white noise
    GPS         h_g = h0 + w_g             equation 10
    vision      h_v = h0 + w_v             equation 11
    ultrasound  h_c = h0 + w_c below 3 m, anything above      equation 12

The paper's own flights contradict 10: on the stairs the GPS is off by 0.76 m on the average with a deviation of
0.165 m, which is a bias and not white noise. The world's sensors have that bias; the published filter does not know it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

BARO, GPS, VISION, SONAR = "baro", "gps", "vision", "sonar"
HIGH = (BARO, GPS, VISION)  # equation 15
NEAR = (GPS, VISION, SONAR)  # equation 17


@dataclass(frozen=True)
class LeiSensors:
    """Standard deviations of the white noises [m], from the paper's stairs (table 2), and the ranger's reach [m]."""

    baro: float = 0.092
    gps: float = 0.165
    vision: float = 0.351
    sonar: float = 0.003
    reach: float = 3.0

    def variance(self, sensor: str) -> float:
        """Of one sample [m^2]."""
        return float(getattr(self, sensor)) ** 2


def row(sensor: str, states: int, bias: int) -> Floats:
    """The sensor's row (states,) of H: the height is state 0, eps_b state `bias`.

    Equation 16 as printed; equation 18 prints the 1 x 1 unit matrix for three measurements of one state, which is read
    as a column of ones.
    """
    h = np.zeros(states)
    h[0] = 1.0
    if sensor == BARO:
        h[bias] = 1.0
    return h

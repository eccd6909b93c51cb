"""The weather of a flight, as a scenario gives it."""

from dataclasses import dataclass
from typing import Literal

Turbulence = Literal["none", "dryden", "light", "moderate", "severe"]


@dataclass(frozen=True)
class Weather:
    """Mean wind at 10 m, turbulence and the air at the pad."""

    wind: float = 1.5  # [m/s] mean, 10 m above the ground
    wind_from: float = 4.36  # [rad] clockwise from north
    turbulence: Turbulence = "dryden"  # dryden: as strong as belongs to the mean wind
    temperature: float = 288.15  # [K] at the pad
    pressure: float = 101_325.0  # [Pa] at the pad
    shear: float = 1.0  # of the mean wind over the height; 1: the usual profile, 0: none

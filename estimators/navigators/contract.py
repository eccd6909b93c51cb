"""What every navigator is: measurements in, state out."""

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from estimators.eyes import Eyes
from flightlog.equipment import Equipment
from flightlog.signals import Controls, Measurement, StateEstimate

Floats = NDArray[np.float64]

Variant = Literal["helideck", "published"]  # the best made of an idea, or the paper with its misprints corrected


class Navigator(Protocol):
    """Measurements in, state out."""

    @property
    def detections(self) -> Sequence[Measurement]:
        """What vision found in the pictures of the last update."""
        ...

    @property
    def overlays(self) -> Mapping[str, Sequence[Floats]]:
        """By camera, lines (N, 2) [px] to draw over its last picture."""
        ...

    @property
    def rejected(self) -> Mapping[str, int]:
        """Samples by topic that were not used."""
        ...

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        """What has arrived since the last call, in order of arrival; called at the inertial sensor's rate."""
        ...


@runtime_checkable
class Steered(Protocol):
    """A navigator that predicts by a model of the vehicle, and so wants to be told its controls."""

    def steer(self, controls: Controls) -> None:
        """The controls as sent from now on; called after each update."""
        ...


Look = Callable[[Equipment, Variant], Eyes]
"""Which front ends a navigator wants; called only where pictures will come."""

Build = Callable[[Equipment, Eyes, Variant], Navigator]
"""The navigator itself, for the sensors as known aboard and the eyes it asked for."""

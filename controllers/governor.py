"""Rotor speed to throttle: LQR with integral, and the collective's power reckoned in beforehand."""

from dataclasses import dataclass

import numpy as np

from controllers.plant import SAMPLE_TIME, LinearPlant
from controllers.regulator import bryson, lqr, residualise

INTEGRAL, SPEED = 3.0, 2.5  # Bryson's largest values [rad], [rad/s]
THROTTLE = 0.03  # [1]


@dataclass(frozen=True)
class GovernorGains:
    """Of the governor."""

    proportional: float  # [s] throttle per rotor speed error
    integral: float  # [1]
    collective: float  # [1/rad] throttle per collective
    trim_throttle: float  # [1]
    trim_collective: float  # [rad]
    rotor_speed: float  # [rad/s] to be held


def design_governor(plant: LinearPlant) -> GovernorGains:
    """Gains for this plant, throttle, engine, inflow and collective servo at rest."""
    keep = plant.states("engine.speed")
    fast = plant.states("engine.throttle", "servo.throttle", "main_rotor.inflow", "servo.collective")
    columns = plant.inputs("throttle", "collective")
    damping, effect = residualise(plant.A, plant.B[:, columns], keep, fast)
    a = np.array([[0.0, 1.0], [0.0, damping[0, 0]]])  # integral of speed, speed
    b = np.array([[0.0], [effect[0, 0]]])
    integral, proportional = lqr(a, b, bryson(INTEGRAL, SPEED), bryson(THROTTLE))[0].tolist()
    return GovernorGains(
        proportional=proportional,
        integral=integral,
        collective=-effect[0, 1] / effect[0, 0],
        trim_throttle=plant.trim.throttle,
        trim_collective=plant.trim.collective,
        rotor_speed=plant.rotor_speed,
    )


class Governor:
    """The governor in flight."""

    def __init__(self, gains: GovernorGains) -> None:
        self._gains = gains
        self._steady = 0.0  # [1] integral part

    def update(self, rotor_speed: float, collective: float) -> float:
        """Throttle [0..1] from rotor speed [rad/s] and the collective sent [rad]."""
        gains = self._gains
        error = gains.rotor_speed - rotor_speed
        throttle = gains.trim_throttle + gains.collective * (collective - gains.trim_collective)
        throttle += gains.proportional * error + self._steady
        limited = min(max(throttle, 0.0), 1.0)
        if error * (throttle - limited) <= 0.0:
            self._steady += gains.integral * SAMPLE_TIME * error
        return limited

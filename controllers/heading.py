"""Heading to tail: LQR on heading and yaw rate with integral, and the engine's torque reckoned in beforehand.

The tail rotor's blade pitch for n times the trimmed torque is, by blade element and momentum theory,

    theta = theta_T n + theta_i sqrt(n),

theta_T + theta_i the pitch at trim, theta_T + theta_i/2 its slope there, which the matrices give. So the nose stays
where it is when the throttle shuts.
"""

import math
from dataclasses import dataclass

import numpy as np

from controllers.plant import SAMPLE_TIME, LinearPlant
from controllers.regulator import bryson, lqr, residualise

INTEGRAL, HEADING, RATE = 0.3, 0.20, 0.50  # Bryson's largest values [rad s], [rad], [rad/s]
TAIL = 0.02  # [rad]
STEADY_LIMIT = 0.15  # [rad] integral part
ERROR_LIMIT = 0.35  # [rad] of heading error that the loop acts on at once


@dataclass(frozen=True)
class HeadingGains:
    """Of the heading loop."""

    heading: float  # [1] tail per heading error
    rate: float  # [s] tail per yaw rate
    integral: float  # [1/s]
    thrust_pitch: float  # [rad] theta_T, with the sign of the tail control
    inflow_pitch: float  # [rad] theta_i
    engine_share: float  # [1] of its lag that the engine makes up in a period
    trim_tail: float  # [rad]
    trim_throttle: float  # [1]
    limit: float  # [rad]


def design_heading(plant: LinearPlant) -> HeadingGains:
    """Gains for this plant, the tail servo at rest."""
    tail, yaw = plant.inputs("tail"), plant.states("wz")
    damping, effect = residualise(plant.A, plant.B[:, tail], yaw, plant.states("servo.tail"))
    a, b = np.zeros((3, 3)), np.zeros((3, 1))  # integral of heading, heading, turn to the right
    a[0, 1] = a[1, 2] = 1.0
    a[2, 2], b[2, 0] = damping[0, 0], -effect[0, 0]
    integral, heading, rate = lqr(a, b, bryson(INTEGRAL, HEADING, RATE), bryson(TAIL))[0].tolist()
    engine = plant.states("engine.throttle")
    torque = plant.A[yaw[0], engine[0]] if engine else plant.B[yaw[0], plant.inputs("throttle")[0]]
    lag = sum(-1.0 / plant.A[i, i] for i in plant.states("engine.throttle", "servo.throttle"))
    lag -= sum(-1.0 / plant.A[i, i] for i in plant.states("servo.tail"))  # the tail's own comes on top
    slope = -torque / effect[0, 0] * plant.trim.throttle  # [rad] tail per share of the trimmed torque
    inflow_pitch = min(max(2.0 * (plant.tail_pitch - abs(slope)), 0.0), 2.0 * abs(slope))
    return HeadingGains(
        heading=heading,
        rate=rate,
        integral=integral,
        thrust_pitch=math.copysign(abs(slope) - 0.5 * inflow_pitch, slope),
        inflow_pitch=math.copysign(inflow_pitch, slope),
        engine_share=1.0 - math.exp(-SAMPLE_TIME / lag) if lag > 0.0 else 1.0,
        trim_tail=plant.trim.tail,
        trim_throttle=plant.trim.throttle,
        limit=plant.upper.tail,
    )


class HeadingLoop:
    """The loop in flight."""

    def __init__(self, gains: HeadingGains) -> None:
        self._gains = gains
        self._steady = 0.0  # [rad] integral part
        self._engine = gains.trim_throttle  # what the engine is thought to give

    def update(self, heading: float, wz: float, wanted: float, throttle: float, hold: bool) -> float:
        """Tail [rad] for a heading wanted [rad], the throttle as last sent; hold: the integral rests."""
        gains = self._gains
        self._engine += gains.engine_share * (throttle - self._engine)
        error = (wanted - heading + math.pi) % (2.0 * math.pi) - math.pi
        error = min(max(error, -ERROR_LIMIT), ERROR_LIMIT)
        feedback = gains.heading * error + gains.rate * wz + self._steady
        torque = max(self._engine / gains.trim_throttle, 0.0)
        ahead = gains.thrust_pitch * (torque - 1.0) + gains.inflow_pitch * (math.sqrt(torque) - 1.0)
        tail = gains.trim_tail + feedback + ahead
        limited = min(max(tail, -gains.limit), gains.limit)
        if not hold and error * (tail - limited) <= 0.0:
            steady = self._steady + gains.integral * SAMPLE_TIME * error
            self._steady = min(max(steady, -STEADY_LIMIT), STEADY_LIMIT)
        return limited

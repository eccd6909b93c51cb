"""Height to collective: a reference that moves as a helicopter can, a climb-rate loop, and the rotor's own law.

The loop asks for an acceleration; the law turns it into blade pitch by blade element and momentum theory,

    theta = 6 C_T/(sigma a) + 3/2 lambda:   theta = theta_T n (Omega_0/Omega)^2 + theta_i sqrt(n) (Omega_0/Omega) g(z)

with n the load factor, tilt reckoned in, theta_i = 3/2 v_h/(Omega_0 R), theta_T the rest of the trimmed pitch and
g = (1 - (R/4z)^2)^(3/2) what the ground leaves of the inflow (Cheeseman and Bennett, ARC R&M 3021, 1955). So the same
loop holds its sink rate into the ground cushion and on a rotor that runs down.
"""

import math
from dataclasses import dataclass

import numpy as np

from controllers.plant import SAMPLE_TIME, LinearPlant
from controllers.position import split
from controllers.regulator import bryson, lqr, residualise
from flightlog.constants import GRAVITY

INTEGRAL, HEIGHT, CLIMB = 0.5, 0.25, 0.39  # Bryson's largest values [m s], [m], [m/s]
COLLECTIVE = 0.018  # [rad]
STEADY_LIMIT = 1.5  # [m/s^2] integral part
CLIMB_LIMIT = 1.5  # [m/s] correction of the height error
LOADS = (0.6, 1.4)  # [1] load factor
SLOWEST = 0.3  # [1] share of the rotor speed below which the law is no longer believed
REFERENCE_ACCELERATION = 0.5  # [m/s^2]
REFERENCE_RATE = 0.8  # [1/s] at which the reference closes in on its target
REFERENCE_LEAD = 0.6  # [m] largest distance between the reference and the height


@dataclass(frozen=True)
class AltitudeGains:
    """Of the height and climb-rate loops, and of the rotor's law."""

    height: float  # [1/s] climb rate per height error
    climb: float  # [1/s] acceleration per climb-rate error
    integral: float  # [1/s^2]
    thrust_pitch: float  # [rad] theta_T
    inflow_pitch: float  # [rad] theta_i
    lowest: float  # [rad] stops of the collective
    highest: float
    rotor_speed: float  # [rad/s] Omega_0
    rotor_radius: float  # [m]
    hub_height: float  # [m] above the body origin


def design_altitude(plant: LinearPlant) -> AltitudeGains:
    """Gains for this plant: servo and inflow at rest, rotor speed held by the governor."""
    keep = plant.states("vz")
    fast = plant.states("main_rotor.inflow", "servo.collective")
    damping, effect = residualise(plant.A, plant.B[:, plant.inputs("collective")], keep, fast)
    a, b = np.zeros((3, 3)), np.zeros((3, 1))  # integral of height, height, climb rate
    a[0, 1] = a[1, 2] = 1.0
    a[2, 2], b[2, 0] = damping[0, 0], effect[0, 0]
    gain = lqr(a, b, bryson(INTEGRAL, HEIGHT, CLIMB), bryson(COLLECTIVE))[0].tolist()
    inflow_pitch = 1.5 * plant.induced_velocity / (plant.rotor_speed * plant.rotor_radius)
    thrust_pitch = plant.trim.collective - inflow_pitch
    slope = GRAVITY / (thrust_pitch + 0.5 * inflow_pitch)  # [m/s^2 per rad] of the law, inflow at rest
    climb, faster, slower = split(*(slope * value for value in gain))
    return AltitudeGains(
        height=faster,
        climb=climb,
        integral=climb * slower,
        thrust_pitch=thrust_pitch,
        inflow_pitch=inflow_pitch,
        lowest=plant.lower.collective,
        highest=plant.upper.collective,
        rotor_speed=plant.rotor_speed,
        rotor_radius=plant.rotor_radius,
        hub_height=plant.hub_height,
    )


class HeightReference:
    """A height that goes to its target no faster than told and changes its speed gently."""

    def __init__(self, height: float, climb: float = 0.0) -> None:
        self.height = height  # [m]
        self.climb = climb  # [m/s]

    def update(self, target: float, rate: float, height_now: float) -> None:
        """One period on, towards `target` [m] at most at `rate` [m/s]; stays near the height that is."""
        wanted = min(max(REFERENCE_RATE * (target - self.height), -rate), rate)
        step = REFERENCE_ACCELERATION * SAMPLE_TIME
        self.climb += min(max(wanted - self.climb, -step), step)
        self.height += self.climb * SAMPLE_TIME
        self.height = min(max(self.height, height_now - REFERENCE_LEAD), height_now + REFERENCE_LEAD)


def collective_law(gains: AltitudeGains, load: float, rotor_speed: float, height: float, ground_effect: bool) -> float:
    """Blade pitch [rad] for a thrust of `load` times the weight; height [m] of the body origin above the ground."""
    ratio = gains.rotor_speed / max(rotor_speed, SLOWEST * gains.rotor_speed)
    cushion = 1.0
    if ground_effect:
        hub = max(height + gains.hub_height, 0.5 * gains.rotor_radius)  # the formula ends there
        cushion = (1.0 - (gains.rotor_radius / (4.0 * hub)) ** 2) ** 1.5
    return ratio * (gains.thrust_pitch * load * ratio + gains.inflow_pitch * math.sqrt(load) * cushion)


class AltitudeLoop:
    """The loop in flight."""

    def __init__(self, gains: AltitudeGains) -> None:
        self._gains = gains
        self._steady = 0.0  # [m/s^2] integral part
        self.saturated = 0  # at which end the load or the collective stands: -1, 0, 1

    def update(
        self,
        reference: HeightReference,
        height: float,
        climb: float,
        upright: float,
        rotor_speed: float,
        ground_effect: bool,
        hold: bool,
    ) -> float:
        """Collective [rad].

        height [m], climb [m/s] of the body origin; upright: cosine of the tilt; hold: the integral rests.
        """
        gains = self._gains
        wanted = reference.climb + min(max(gains.height * (reference.height - height), -CLIMB_LIMIT), CLIMB_LIMIT)
        error = wanted - climb
        load = 1.0 + (gains.climb * error + self._steady) / GRAVITY
        limited = min(max(load, LOADS[0]), LOADS[1])
        pitch = collective_law(gains, limited / upright, rotor_speed, height, ground_effect)
        collective = min(max(pitch, gains.lowest), gains.highest)
        excess = (load - limited) + (pitch - collective)
        self.saturated = int(excess > 0.0) - int(excess < 0.0)
        if not hold and error * self.saturated <= 0.0:
            steady = self._steady + gains.integral * SAMPLE_TIME * error
            self._steady = min(max(steady, -STEADY_LIMIT), STEADY_LIMIT)
        return collective

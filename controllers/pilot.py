"""The pilot: a state estimate in, controls out, 250 times a second."""

import math

from controllers.altitude import AltitudeLoop, HeightReference
from controllers.attitude import AttitudeLoop
from controllers.gains import Gains
from controllers.governor import Governor
from controllers.heading import HeadingLoop
from controllers.plant import SAMPLE_TIME
from controllers.position import PositionLoop
from controllers.sequence import Demand, Phase, Sequence
from controllers.velocity import VelocityLoop
from flightlog.signals import Controls, StateEstimate

LEVEL_LEAD = 0.10  # [s] by which the roll against the tail rotor's push is taken out before the throttle shuts
GROUND_COLLECTIVE_RATE = 0.08  # [rad/s] on the ground
SEQUENCE_EVERY = 5  # periods: the plan is asked 50 times a second
GROUND_TIME = 0.5  # [s] in which cyclic and tail come to rest there


class Pilot:
    """Flies a sequence with the gains designed for a vehicle; knows of the flight only what the estimate says."""

    def __init__(self, gains: Gains, sequence: Sequence, heading: float | None = None) -> None:
        """Holds `heading` [rad]; the heading at the first update where None."""
        self.gains = gains
        self.sequence = sequence
        self._heading = heading
        self._position = PositionLoop(gains.position)
        self._velocity = VelocityLoop(gains.velocity)
        self._attitude = AttitudeLoop(gains.attitude)
        self._altitude = AltitudeLoop(gains.altitude)
        self._tail = HeadingLoop(gains.heading)
        self._governor = Governor(gains.governor)
        self._reference: HeightReference | None = None
        self._sent = gains.trim
        self._periods = 0
        self._demand: Demand
        self._unpowered = 0.0  # [s] since the sequence wanted the throttle shut

    @property
    def phase(self) -> Phase:
        """Where the sequence stands."""
        return self.sequence.phase

    @property
    def finished(self) -> bool:
        """Whether the sequence has come to its end."""
        return self.sequence.finished

    @property
    def events(self) -> list[tuple[float, str]]:
        """(t [s], what happened) so far, in order."""
        return self.sequence.events

    def set_target(self, east: float, north: float) -> None:
        """Move the point to be flown to [m] from the pad's centre."""
        self.sequence.set_target(east, north)

    def set_heading(self, heading: float) -> None:
        """Point the nose to `heading` [rad] from now on."""
        self._heading = heading

    def update(self, state: StateEstimate) -> Controls:
        """Controls for the period that begins; call every SAMPLE_TIME."""
        e, n, height = state.position.tolist()
        ve, vn, climb = state.velocity.tolist()
        wx, wy, wz = state.rates.tolist()
        if self._reference is None:
            self._reference = HeightReference(height, climb)
            self._velocity.take_over(ve, vn, state.roll, state.pitch, state.heading, height)
            if self._heading is None:
                self._heading = state.heading
        assert self._heading is not None
        if self._periods % SEQUENCE_EVERY == 0:
            self._demand = self.sequence.update(state)
        self._periods += 1
        demand = self._demand
        if not demand.flying:
            self._sent = self._on_ground()
            return self._sent

        self._unpowered = 0.0 if demand.powered else self._unpowered + SAMPLE_TIME
        reference = self._reference
        reference.update(demand.height, demand.rate, height)
        collective = self._altitude.update(
            reference,
            height,
            climb,
            math.cos(state.roll) * math.cos(state.pitch),
            state.rotor_speed,
            demand.ground_effect,
            hold=not demand.powered,
        )
        throttle = 0.0
        if self._unpowered <= LEVEL_LEAD:
            throttle = self._governor.update(state.rotor_speed, collective)

        wanted_e, wanted_n = self._position.update(demand.east - e, demand.north - n, demand.speed_limit)
        roll, pitch = self._velocity.update(
            wanted_e,
            wanted_n,
            ve,
            vn,
            state.heading,
            height,
            demand.tilt_limit,
            level=1.0 if demand.powered else 0.0,
            hold=not demand.powered,
        )
        lateral, longitudinal = self._attitude.update(state.roll, state.pitch, wx, wy, roll, pitch)
        tail = self._tail.update(state.heading, wz, self._heading, throttle, hold=not demand.powered)
        self._sent = Controls(collective, lateral, longitudinal, tail, throttle)
        return self._sent

    def _on_ground(self) -> Controls:
        """Collective down slowly, cyclic and tail to rest, throttle shut."""
        sent = self._sent
        fade = 1.0 - SAMPLE_TIME / GROUND_TIME
        return Controls(
            max(sent.collective - GROUND_COLLECTIVE_RATE * SAMPLE_TIME, self.gains.altitude.lowest),
            sent.lateral * fade,
            sent.longitudinal * fade,
            sent.tail * fade,
            0.0,
        )

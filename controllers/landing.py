"""The landing of Lei et al. 2012 as a machine of phases.

Go to P1 (0, 0, 10), hover, check position and speed, descend on fused height, below 2 m fly the collective against
the ground cushion, below 0.2 m of skid height shut the throttle and hold the sink rate on the slowing rotor until
contact. It leaves for a go-around when the pad or the limits are lost, three times at most; then it holds at P1.

All is judged from the estimate. Heights are those of the body origin over the pad, `low` that of the skids.
"""

import math
from dataclasses import dataclass

from controllers.sequence import Demand, Phase
from flightlog.signals import StateEstimate


@dataclass(frozen=True)
class LandingLimits:
    """Numbers of the sequence; lengths [m], times [s], angles [rad]."""

    height: float = 10.0  # of P1, body origin
    near: float = 1.0  # horizontal and vertical distance that counts as having arrived at P1
    hover_time: float = 2.0
    check_time: float = 2.0  # for which all of the check must hold
    check_position: float = 0.35  # horizontal
    check_height: float = 0.30
    check_speed: float = 0.30  # [m/s] in space
    check_patience: float = 12.0  # after which twice these limits will do
    rates: tuple[tuple[float, float], ...] = ((4.0, 0.8), (2.0, 0.5), (1.0, 0.4), (0.0, 0.3))  # above low: [m/s]
    cone_base: float = 0.15  # horizontal error allowed on the ground ...
    cone_slope: float = 0.12  # ... and more per metre of height
    flare_below: float = 2.0  # low
    cutoff_below: float = 0.2  # low
    cutoff_sink: float = 0.25  # [m/s] after cut-off
    cutoff_speed: float = 0.25  # [m/s] horizontal, above which the throttle stays open
    wait_below: float = 0.5  # low: from here down, sinks only when slow enough to touch down
    pad_age_high: float = 1.0  # for which the pad may go unseen ...
    pad_age_low: float = 3.0  # ... and below `blind_below`, where it no longer fits the picture
    blind_below: float = 0.8  # body origin
    patience: float = 4.0  # for which the pad may be lost, or the limits left, before going around
    spread: float = 0.5  # largest standard deviation of the horizontal position
    tilt: float = 0.30  # above which a landing is broken off
    steps: tuple[float, ...] = ()  # heights of the body origin at which the descent pauses ...
    step_time: float = 4.0  # ... for so long each
    step_near: float = 0.15  # that counts as having come down to one
    tries: int = 3
    again_height: float = 5.0  # of a go-around
    contact_low: float = 0.06  # skids this near to the ground ...
    contact_speed: float = 0.12  # [m/s] ... and vertically this slow ...
    contact_time: float = 0.10  # ... for so long have touched it
    contact_late: float = 2.5  # after cut-off, when no rotor flies any more: then standing still alone will do
    stuck_speed: float = 0.08  # [m/s] vertically this slow ...
    stuck_time: float = 1.5  # ... for so long while asked to sink: on the ground, whatever the height says
    rest_time: float = 3.0  # after contact, until finished
    tilt_high: float = math.radians(6.0)  # allowed to the pilot on the way to P1
    tilt_low: float = math.radians(3.2)  # and from P1 down


class Landing:
    """The sequence in flight."""

    def __init__(self, skid_height: float, limits: LandingLimits | None = None) -> None:
        """skid_height: body origin above the skids' plane [m]."""
        self.limits = limits or LandingLimits()
        self.phase = Phase.APPROACH
        self.finished = False
        self.events: list[tuple[float, str]] = []
        self.tries = 0
        self._skid_height = skid_height
        self._target = (0.0, 0.0)
        self._since = math.nan  # when this phase began
        self._good = 0.0  # since when the check holds, the limits are kept, the skids stand still
        self._sinking = 0.0  # when it last sank, or was not asked to
        self._check_height = self.limits.height
        self._steps = sorted(self.limits.steps, reverse=True)  # still to come
        self._paused = math.nan  # since when at the first of them
        self._step = {
            Phase.APPROACH: self._approach,
            Phase.HOVER: self._hover,
            Phase.CHECK: self._check,
            Phase.DESCEND: self._descend,
            Phase.FLARE: self._flare,
            Phase.CUTOFF: self._cutoff,
            Phase.LANDED: self._landed,
            Phase.GO_AROUND: self._go_around,
            Phase.HOLD: self._hold,
        }

    def set_target(self, east: float, north: float) -> None:
        """Move the point to land on [m] from the pad's centre."""
        self._target = (east, north)

    def update(self, state: StateEstimate) -> Demand:
        """The demand of this period."""
        if math.isnan(self._since):
            self._enter(Phase.APPROACH, state.t)
        e, n, height = state.position.tolist()
        ve, vn, climb = state.velocity.tolist()
        error = math.hypot(e - self._target[0], n - self._target[1])
        return self._step[self.phase](state, error, height, math.hypot(ve, vn), climb)

    # --- phases: each judges the state, may enter another, and gives the demand ---------------------------------------

    def _approach(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        limits = self.limits
        if error < limits.near and abs(height - limits.height) < limits.near:
            self._enter(Phase.HOVER, state.t)
        return self._over_pad(limits.height, 1.0, limits.tilt_high)

    def _hover(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        limits = self.limits
        if state.t - self._since >= limits.hover_time:
            self._enter(Phase.CHECK, state.t)
        return self._over_pad(limits.height, 1.0, limits.tilt_high)

    def _check(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        limits = self.limits
        seen = self._pad_seen(state, height)
        if not seen and state.t - self._since > limits.check_patience:
            self._check_height = limits.height  # further up, more is in the picture
        slack = 1.0 if state.t - self._since < limits.check_patience else 2.0
        good = (
            error < slack * limits.check_position
            and abs(height - self._check_height) < slack * limits.check_height
            and math.hypot(speed, climb) < slack * limits.check_speed
            and seen
        )
        if not good:
            self._good = state.t
        elif state.t - self._good >= limits.check_time:
            self.tries += 1
            self._enter(Phase.DESCEND, state.t)
        return self._over_pad(self._check_height, 1.0, limits.tilt_low)

    def _descend(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        if height - self._skid_height < self.limits.flare_below:
            self._enter(Phase.FLARE, state.t)
        return self._down(state, error, height, speed)

    def _flare(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        limits = self.limits
        low = height - self._skid_height
        if low < limits.cutoff_below and error < self._cone(height) and speed < limits.cutoff_speed:
            self._enter(Phase.CUTOFF, state.t)
            return self._cutoff(state, error, height, speed, climb)
        demand = self._down(state, error, height, speed)
        asked = demand.rate >= 2.0 * limits.stuck_speed and demand.height < 0.0
        if abs(climb) > limits.stuck_speed or not asked or self.phase is not Phase.FLARE:
            self._sinking = state.t
        elif state.t - self._sinking > limits.stuck_time:
            self._enter(Phase.CUTOFF, state.t, f"does not sink any more at {low:.2f} m")
        if low < limits.cutoff_below and self.phase is Phase.FLARE:  # not fit to touch down: wait, just above
            return demand._replace(height=self._skid_height + limits.wait_below, rate=0.3)
        return demand

    def _cutoff(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        limits = self.limits
        low = height - self._skid_height
        touching = low < limits.contact_low or state.t - self._since > limits.contact_late
        if not touching or abs(climb) > limits.contact_speed:
            self._good = state.t
        elif state.t - self._good >= limits.contact_time:
            self._enter(Phase.LANDED, state.t)
        demand = self._over_pad(-math.inf, limits.cutoff_sink, limits.tilt_low)
        return demand._replace(ground_effect=True, powered=False)

    def _landed(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        self.finished = state.t - self._since >= self.limits.rest_time
        return self._over_pad(height, 0.0, 0.0)._replace(ground_effect=True, powered=False, flying=False)

    def _go_around(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        limits = self.limits
        if error < limits.near and abs(height - limits.again_height) < limits.near:
            self._check_height = limits.again_height
            self._enter(Phase.CHECK, state.t)
        return self._over_pad(limits.again_height, 1.0, limits.tilt_high)

    def _hold(self, state: StateEstimate, error: float, height: float, speed: float, climb: float) -> Demand:
        return self._over_pad(self.limits.height, 1.0, self.limits.tilt_high)

    # --- what they share ------------------------------------------------------------------------------------------

    def _enter(self, phase: Phase, t: float, why: str = "") -> None:
        self.phase = phase
        self._since = self._good = self._sinking = t
        self.events.append((t, f"{phase.value}: {why}" if why else phase.value))

    def _over_pad(self, height: float, rate: float, tilt: float) -> Demand:
        return Demand(*self._target, height, rate, 1.5, tilt)

    def _cone(self, height: float) -> float:
        return self.limits.cone_base + self.limits.cone_slope * max(height - self._skid_height, 0.0)

    def _pad_seen(self, state: StateEstimate, height: float) -> bool:
        limits = self.limits
        oldest = limits.pad_age_low if height < limits.blind_below else limits.pad_age_high
        spread = float(max(state.std_position[0], state.std_position[1]))
        return state.pad_age < oldest and spread < limits.spread

    def _down(self, state: StateEstimate, error: float, height: float, speed: float) -> Demand:
        """Sink by the schedule inside the cone, slower near its edge; break off where pad or limits stay lost."""
        limits = self.limits
        cone, low = self._cone(height), height - self._skid_height
        seen = self._pad_seen(state, height)
        if seen and error < cone:
            self._good = state.t
        tilted = max(abs(state.roll), abs(state.pitch)) > limits.tilt
        if tilted or state.t - self._good > limits.patience:
            why = "tilt" if tilted else "pad lost" if not seen else "off centre"
            if self.tries < limits.tries:
                self._enter(Phase.GO_AROUND, state.t, why)
            else:
                self._enter(Phase.HOLD, state.t, f"{why}, {self.tries} tries spent")
            return self._over_pad(height, 0.0, limits.tilt_low)
        rate = next((rate for above, rate in limits.rates if low > above), limits.rates[-1][1])
        share = min(max(2.0 * (1.0 - error / cone), 0.0), 1.0)  # full rate in the inner half of the cone
        if not seen or (low < limits.wait_below and speed > limits.cutoff_speed):
            share = 0.0
        demand = self._over_pad(self._floor(state.t, height), rate * share, limits.tilt_low)
        return demand._replace(ground_effect=self.phase is not Phase.DESCEND)

    def _floor(self, t: float, height: float) -> float:
        """The height of the step to come down to, or where one pauses; -inf when none is left."""
        while self._steps:
            if math.isnan(self._paused) and height < self._steps[0] + self.limits.step_near:
                self._paused = t
                self.events.append((t, f"step at {self._steps[0]:g} m"))
            if math.isnan(self._paused) or t - self._paused < self.limits.step_time:
                return self._steps[0]
            self._steps.pop(0)
            self._paused = math.nan
        return -math.inf

"""The adaptive Kalman filter of Lei 2012, equations 15 to 27, in all the readings that the paper leaves open.

    x- = x + integral of f dt      (19)   f: equation 14, the climb rate of the vertical model
    P- = P + Q                     (21)
    K  = P- H' (H P- H' + R)^-1           S = H P- H' + R (26)
    x+ = x- + K* (z - H x-)               r = z - H x- (25)
    P+ = (1 - K* H) P-             (24)
    K* = K where |r_i| <= 2 sqrt(S_ii), else n K, n in [0, 1]      (27)

Open, and how each may be read:

- 27 names one residual i of several. `AkfReading.scaled`: its column of K is scaled ("columns"), or all of K
  by the worst ("whole").
- 27 has two branches; the text has three and contradicts itself ("when the residual is small reduce K, when very large
  set K to zero": the first should read "fairly large"). `gain`: "three" takes n = 2 sqrt(S)/|r| up to five deviations
  and 0 beyond; "huber" that n without an end; "constant" a fixed n.
- 24 holds for the optimal gain alone. `covariance`: "joseph", or "printed" (made symmetric, which it no longer is).
- 21 has no transition matrix, which is right for x = [h, eps_b] alone. `prediction`: "open" runs the vertical model
  beside the filter, as 14 and 19 say; "coupled" makes its climb rate a state with P- = F P F' + Q; "still" has f = 0.
- The set of measurements changes at 3 m: by what the ranger says ("measured"; beyond its reach it says anything), or by
  the predicted height with hysteresis and only after several echoes that agree with it ("hardened").
- eps_b is kept below 3 m and taken up again above. `crossed`: its correlation with the height is kept (exact, eps_b is
  constant) or dropped.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimators.lei_sensors import BARO, HIGH, NEAR, SONAR, LeiSensors, row
from estimators.vertical_model import OMEGA, RAPTOR90, THETA, V, VerticalModel

Floats = NDArray[np.float64]

FASTEST = 2.0  # [m/s] of the vertical model
SOFT, HARD = 2.0, 5.0  # [standard deviations] equation 27, and where "very large" begins


@dataclass(frozen=True)
class AkfReading:
    """One reading of what the paper leaves open, and the numbers that it does not give."""

    gain: Literal["three", "huber", "constant"] = "three"
    scaled: Literal["columns", "whole"] = "columns"
    n: float = 0.3  # of gain "constant"
    covariance: Literal["joseph", "printed"] = "joseph"
    prediction: Literal["open", "coupled", "still"] = "coupled"
    orders: Literal[2, 5] = 5  # states of the vertical model: climb rate alone on measured rotor speed, or all
    switch: Literal["measured", "hardened"] = "measured"
    crossed: bool = True
    height_walk: float = 0.05  # [m/sqrt(s)] Q of the height
    climb_walk: float = 0.3  # [m/s/sqrt(s)] of the climb rate, "coupled": gusts and what the model lacks
    bias_walk: float = 0.01  # [m/sqrt(s)] of eps_b
    sensors: LeiSensors = field(default_factory=LeiSensors)


class Correction(NamedTuple):
    """What one measurement vector has done."""

    x: Floats  # (n,)
    p: Floats  # (n, n)
    residual: Floats  # (m,) equation 25
    spread: Floats  # (m, m) equation 26
    weight: Floats  # (m,) what the columns of K were multiplied by


def weights(residual: Floats, deviation: Floats, reading: AkfReading) -> Floats:
    """Equation 27: by what each component's gain (m,) is multiplied, from residuals and their deviations."""
    ratio = np.abs(residual) / deviation
    if reading.gain == "constant":
        weight = np.where(ratio <= SOFT, 1.0, reading.n)
    else:
        weight = np.minimum(1.0, SOFT / np.maximum(ratio, 1e-12))
        if reading.gain == "three":
            weight = np.where(ratio > HARD, 0.0, weight)
    return np.full_like(weight, weight.min()) if reading.scaled == "whole" else weight


def correct(x: Floats, p: Floats, z: Floats, h: Floats, r: Floats, reading: AkfReading) -> Correction:
    """Equations 22 to 27: the state x (n,), p (n, n) corrected by z = h x (m,) with covariance r (m, m)."""
    residual = z - h @ x
    spread = h @ p @ h.T + r
    weight = weights(residual, np.sqrt(np.diag(spread)), reading)
    gain = np.linalg.solve(spread, h @ p).T * weight
    keep = np.eye(len(x)) - gain @ h
    after = keep @ p
    if reading.covariance == "joseph":
        after = after @ keep.T + gain @ r @ gain.T
    return Correction(x + gain @ residual, 0.5 * (after + after.T), residual, spread, weight)


class LeiFilter:
    """Height above the pad and barometer bias. Heights are of the body origin [m].

    Samples are kept until the next `cycle`, which uses them as though they were of its own time: the paper knows of no
    latency. Of several samples of a sensor in a cycle the last counts; a sensor that is silent has no row.
    """

    BELIEVED, OUT_OF = 4, 6  # "hardened": so many of the last echoes must have agreed
    LEAVE = 1.1  # "hardened": of the reach at which the near set is entered, hysteresis

    def __init__(self, reading: AkfReading = AkfReading(), model: VerticalModel = RAPTOR90) -> None:
        """Knows nothing of the height."""
        self.reading, self.model = reading, model
        self.coupled = reading.prediction == "coupled"
        self.bias = 2 if self.coupled else 1
        states = self.bias + 1
        self.x: Floats = np.zeros(states)
        self.p: Floats = np.diag([100.0**2, *([3.0**2] if self.coupled else []), 1.0])
        self.near = False
        self.last: Correction | None = None
        self._heard: dict[str, float] = {}
        self._range = math.nan
        self._agreed: deque[bool] = deque(maxlen=self.OUT_OF)
        self._vertical: Floats | None = None  # (5,) of the model
        self._kept = 1.0  # [m^2] variance of eps_b while it is frozen
        self.begun = False  # whether a height has been heard

    @property
    def height(self) -> float:
        """[m]."""
        return float(self.x[0])

    @property
    def deviation(self) -> float:
        """Standard deviation of the height that the filter states [m]."""
        return math.sqrt(self.p[0, 0])

    @property
    def climb(self) -> float:
        """Climb rate [m/s] that the prediction uses."""
        if self.coupled:
            return float(self.x[1])
        return float(self._vertical[V]) if self._vertical is not None and self.reading.prediction == "open" else 0.0

    def hear(self, sensor: str, height: float) -> None:
        """A height [m] by baro, gps or vision."""
        self._heard[sensor] = height

    def echo(self, distance: float, height: float) -> None:
        """What the ranger says [m], NaN without an echo, and the height that it means."""
        self._range = distance
        if math.isfinite(distance):
            self._heard[SONAR] = height
            gate = max(0.15, 4.0 * math.hypot(self.deviation, self.reading.sensors.sonar))
            self._agreed.append(abs(height - self.height) < gate)
        else:
            self._heard.pop(SONAR, None)
            self._agreed.append(False)

    def cycle(self, dt: float, throttle: float, collective: float, rotor: float) -> None:
        """On by dt [s] with the controls [0..1], [rad] and the rotor's speed [rad/s] of that time; NaN: not known."""
        self._predict(dt, throttle, collective, rotor)
        self._choose()
        names = [name for name in (NEAR if self.near else HIGH) if name in self._heard]
        if names:
            sensors = self.reading.sensors
            z = np.array([self._heard[name] for name in names])
            h = np.array([row(name, len(self.x), self.bias) for name in names])
            r = np.diag([sensors.variance(name) for name in names])
            if not self.begun:
                self._begin(names, z)
            self.last = correct(self.x, self.p, z, h, r, self.reading)
            self.x, self.p = self.last.x, self.last.p
        self._heard.clear()

    def _begin(self, names: list[str], z: Floats) -> None:
        """The first heights of all are the start, whatever equation 27 makes of so large a residual."""
        known = [value for name, value in zip(names, z, strict=True) if name != BARO]
        self.x[0] = known[0] if known else z[0]
        self.p[0, 0] = 1.0
        self.begun = True

    def _predict(self, dt: float, throttle: float, collective: float, rotor: float) -> None:
        reading = self.reading
        rise, acceleration, damping = self._run_model(dt, throttle, collective, rotor)
        f = np.eye(len(self.x))
        q = np.zeros_like(self.p)
        q[0, 0], q[-1, -1] = reading.height_walk**2 * dt, reading.bias_walk**2 * dt
        if self.coupled:
            self.x[0] += dt * self.x[1] + 0.5 * dt * dt * acceleration
            self.x[1] += dt * acceleration
            f[0, 1], f[1, 1] = dt, 1.0 + dt * damping
            walk = reading.climb_walk**2
            q[:2, :2] += walk * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        else:
            self.x[0] += rise
        if self.near and not reading.crossed:
            q[-1, -1] = 0.0
        self.p = f @ self.p @ f.T + q

    def _run_model(self, dt: float, throttle: float, collective: float, rotor: float) -> tuple[float, float, float]:
        """(rise [m] of an open run, acceleration [m/s^2], its derivative by the climb rate [1/s]) over dt."""
        if self.reading.prediction == "still" or not math.isfinite(collective + throttle + rotor):
            return 0.0, 0.0, 0.0
        if self._vertical is None:
            self._vertical = self.model.settled(collective, rotor)
        x = self._vertical
        x[OMEGA] = rotor
        # equation 13 holds about the flights that it was fitted to: its x2^2 pulls a fast sinking machine further down
        before = x[V] = max(-FASTEST, min(FASTEST, float(self.x[1] if self.coupled else x[V])))
        if self.reading.orders == 2:
            # the collective as sent: the climb rate alone is integrated
            x[OMEGA:] = self.model.settled(collective, rotor)[OMEGA:]
            middle = before + 0.5 * dt * float(self.model.climb(before, x[OMEGA], x[THETA]))
            acceleration = float(self.model.climb(middle, x[OMEGA], x[THETA]))
            after = x.copy()
            after[V] = before + dt * acceleration
        else:
            after = self.model.step(x, np.array([throttle, collective]), dt)
            acceleration = (float(after[V]) - before) / dt
        self._vertical = after
        return 0.5 * dt * (before + float(after[V])), acceleration, self.model.damping(before)

    def _choose(self) -> None:
        """Which of the two sets of measurements is in use from now on."""
        reading, before = self.reading, self.near
        if reading.switch == "measured":
            self.near = self._range <= reading.sensors.reach  # no echo is one from afar
        elif self.near:
            self.near = self.height < reading.sensors.reach and any(self._agreed)
        else:
            self.near = self.height < reading.sensors.reach / self.LEAVE and sum(self._agreed) >= self.BELIEVED
        if self.near and not before:
            self._kept = float(self.p[-1, -1])
        if not reading.crossed and (self.near or before):
            # frozen on the way down, restored on the way up: the height knows nothing of it
            self.p[-1, :-1] = self.p[:-1, -1] = 0.0
            self.p[-1, -1] = self._kept

"""One flight in linear form: innovations, and what every parameter does to them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.signal import lfilter

from flightlog.rotations import matrix
from identification import kinematics as k
from identification.barometer import port
from identification.beginning import SETTLED
from identification.causes import CATALOGUE, Cause, Change
from identification.declared import declared, offsets
from identification.drive import Driven, Noise, gust_slopes, judge
from identification.flight import Flight
from identification.gusts import usual
from identification.model import Model, tolerance_of
from identification.noise_fit import Settled
from identification.null import APPARENT
from identification.signatures import Signatures
from identification.slopes import WINDS, knob_slopes, rate_slopes, shear_slope, wind_slopes
from identification.stack import Rows
from identification.whitening import sensor_signatures
from sim.vehicle import Vehicle
from sim.wind.mean import mean_speed

Floats = NDArray[np.float64]

DRIVEN = 100  # number of the first channel of the model's; below stand those of the sensors
FORGOTTEN = 0.9  # of a surprise, a node later
WIND_CLOSE, WIND_ROUNDS = 0.15, 5  # [m/s] within which a flight's wind is where it belongs; tries to get there
WIND_REACH = 3.0  # [m/s] that one of them may go
SPEEDS, DIRECTIONS = (2.5, 5.0, 7.5, 10.0, 12.5, 15.0), 12  # of winds that are looked at first
LOOKS = 3  # with slopes of their own, from each of two beginnings
# fitted while noise is set high it goes to nothing, and gusts that it follows at once keep it there: see `helicopter`
INFLOW = "terms.main_rotor.inflow_mass"
# what the cause `wind` has in common for all flights, and the flight's own that shows alike
SHARED = {"environment.wind_e": "wind.e", "environment.wind_n": "wind.n", "environment.wind_shear": "local.shear"}
WINDY = tuple(SHARED)[:2]
# where the inertial sensor's clock is ahead, commands act that much later by it
IMU_CLOCK, COMMANDS = "sensors.imu.clock", ("terms.servo.delay", "terms.servo.throttle_delay")
PORT = "sensors.baro.port_coefficient"
SHEAR = "environment.wind_shear"
# of a flight's own shear: grass of 1 cm to scrub of 30 cm of roughness changes the profile below 10 m by so much
SHEAR_STD = 0.3


def testable(vehicle: Vehicle, topics: set[str]) -> tuple[list[Cause], dict[str, list[str]]]:
    """Causes that these topics can show on this kind of vehicle, and what the others lack."""
    kind = vehicle.document["kind"]
    of_kind = [cause for cause in CATALOGUE.values() if kind in cause.kinds and not cause.counted]
    lacking = {cause.name: [topic for topic in cause.needs if topic not in topics] for cause in of_kind}
    return [cause for cause in of_kind if not lacking[cause.name]], {n: m for n, m in lacking.items() if m}


@dataclass(frozen=True, eq=False)
class _Laid:
    """A sheet's columns side by side."""

    own: Signatures  # (R, P)
    local: Floats  # (R, L)
    square: Floats  # (P + L, P + L) products of all columns
    every: tuple[Floats, bool]  # (L, L) factor of the locals' information
    but_wind: tuple[Floats, bool]  # (L - 2, L - 2) the same without the wind


class Sheet:
    """One flight under one model: what the model says, how it changes with every number, and all of it whitened."""

    def __init__(self, model: Model, flight: Flight, causes: Sequence[Cause], keys: Sequence[str]) -> None:
        """keys: of the knobs whose signatures are wanted."""
        self.model, self.flight, self.keys = model, flight, list(keys)
        nodes, scalars = len(flight.motion.t), len(flight.motion.kinds)
        self.t: Floats = np.concatenate([flight.motion.times, np.repeat(flight.motion.t, 7)])
        self.channel: NDArray[np.int64] = np.concatenate(
            [flight.motion.kinds, DRIVEN + np.tile(np.arange(7), nodes)]
        ).astype(np.int64)
        # a sensor's first words say how far its bias is from nothing; the model's filter is not at rest yet, and what
        # the camera sees is not linear in where the filter still believes to be
        early = (self.channel >= DRIVEN) | (self.channel >= k.PAD)
        self._late = (self.t >= flight.motion.t[0] + SETTLED) | ~early
        self.spread = float(model.vehicle.document["environment"]["wind_std"]["value"])
        self._sensors(causes, scalars, nodes)
        self.wind: Floats = np.array([*model.vehicle.wind[:2], 0.0])  # about which all is linear; at 10 m
        self.columns: dict[str, Floats] = {}
        self._seen: Floats = flight.motion.whitened  # innovations of the sensors
        self._laid: _Laid

    def _sensors(self, causes: Sequence[Cause], scalars: int, nodes: int) -> None:
        """What does not depend on the model: changes of the measurements, by key."""
        flight, vehicle = self.flight, self.model.vehicle
        changes: dict[str, Change] = {}
        for cause in causes:
            if cause.changes is not None:
                found = cause.changes(flight, vehicle)
                changes |= {p.key: change for p, change in zip(cause.parameters, found, strict=True)}
        known, stand_off = declared(flight, vehicle), offsets(flight, vehicle)
        if "baro" in vehicle.sensors and (flight.motion.kinds == k.BARO).any():  # of no size before the wind is known
            open_by = float(tolerance_of(vehicle.document, PORT, "1"))
            known.append((f"local.{PORT}", Change(np.zeros(scalars)), open_by))
        changes |= {key: change for key, change, _ in known}
        self.local_keys = ["local.shear", *(key for key, _, _ in (*known, *stand_off))]
        own = (std for _, _, std in (*known, *stand_off))
        self.local_std: Floats = np.array([self.spread, self.spread, SHEAR_STD, *own])
        self._measured = {key: np.zeros((nodes, 7)) for key in changes}
        every = (*changes.items(), *((key, change) for key, change, _ in stand_off))
        self._turning = {key: change.turning for key, change in every if change.turning is not None}
        self._rates = {key: change.rate for key, change in changes.items() if change.rate is not None}
        dz = np.zeros((scalars, len(changes)))
        df, dw = np.zeros((nodes, 3, len(changes))), np.zeros((nodes, 3, len(changes)))
        begin, first = np.zeros((k.STATES, len(changes))), matrix(flight.motion.attitude[0])
        for c, (key, change) in enumerate(changes.items()):
            if change.scalars is not None:
                dz[:, c] = change.scalars
            if change.force is not None:
                self._measured[key][:, :3] = change.force
            if change.rate is not None:
                self._measured[key][:, 3:6] = change.rate
            if change.state is None:
                df[:, :, c], dw[:, :, c] = self._measured[key][:, :3], self._measured[key][:, 3:6]
            else:
                begin[change.state, c] = -1.0  # believed less true
                if k.CASE <= change.state < k.CASE + 3:  # the start was levelled by what the case feels
                    begin[k.PHI : k.PHI + 2, c] = first[:2, change.state - k.CASE]
            if change.rotor is not None:
                self._measured[key][:, 6] = change.rotor
        m = flight.motion
        above = sensor_signatures(m.way, m.rows, m.gains, m.answers, m.first, m.step, m.decay, dz, df, dw, begin)
        self._above = dict(zip(changes, above.T, strict=True))
        for key, change, _ in stand_off:
            self._measured[key] = np.zeros((nodes, 7))
            if change.force is not None:
                self._measured[key][:, :3] = change.force
            if change.rate is not None:
                self._rates[key] = change.rate
        # what is local is often what a cause would change too
        self._same = {key: key.removeprefix("local.") for key in self._rates if key.removeprefix("local.") in changes}
        self._rates = {key: rate for key, rate in self._rates.items() if self._same.get(key, key) == key}

    def _take_port(self) -> None:
        """What the air that passes does to the barometer, in the present wind."""
        motion, key = self.flight.motion, f"local.{PORT}"
        if key not in self._above:
            return
        share = np.array([mean_speed(height, 1.0) for height in motion.position[:, 2]])[:, None]
        lag, at = self.flight.baro_lag, motion.kinds == k.BARO
        high = port(motion.velocity[:, :2] - share * self.wind[:2], lag, motion.step)
        dz, still = np.zeros((len(at), 1)), np.zeros((len(motion.t), 3, 1))
        dz[at, 0] = np.interp(motion.times[at] + lag, motion.t, high)
        self._above[key] = self._above[PORT] = sensor_signatures(
            motion.way, motion.rows, motion.gains, motion.answers, motion.first, motion.step, motion.decay, dz, still,
            still, np.zeros((k.STATES, 1)),
        )[:, 0]  # fmt: skip
        self._seen = motion.whitened - self.flight.baro_port * self._above[key]

    def linearise(self, at: Mapping[str, float] | None = None, rough: bool = False) -> None:
        """Take all slopes anew about some knobs' values (the nominal ones where not given) and the present wind."""
        self.at = {key: (at or {}).get(key, self.model.knobs[key].nominal) for key in self.keys}
        self.slopes = knob_slopes(self.model, self.flight, self.wind, self.keys, self.at, rough)
        self.slopes[SHEAR] = self.slopes["local.shear"] = shear_slope(self.model, self.flight, self.wind, self.at)
        self._take_port()
        self.by_wind = wind_slopes(self.model, self.flight, self.wind, self.at)
        found = rate_slopes(self.model, self.flight, self.wind, self._rates, self.at)
        self.by_rate = found | {key: found[of] for key, of in self._same.items()}
        slopes = gust_slopes(self.model, self.flight, self.wind, {k: v for k, v in self.at.items() if k != INFLOW})
        self.gust = usual(self.flight, self.wind, slopes)

    def look_for_wind(self, noise: Noise, free: Mapping[str, float]) -> None:
        """Take the wind, among many, under which what is free (deviations by key) explains the flight best.

        Slopes hold about one wind only, so each that is promising is looked at again with its own: from where the
        nominal model, and from where the slopes of the usual wind lead.
        """
        usual_wind, still = np.array([*self.model.vehicle.wind[:2], 0.0]), np.zeros(3)
        turns = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        about = [still, *(size * np.array([np.cos(a), np.sin(a), 0.0]) for size in SPEEDS for a in turns)]
        winds = [usual_wind + wind for wind in about]
        spent = np.sum(np.square(about), axis=1) / self.spread**2
        answers = self.model.answers(self.flight.drive, [(wind, {}, still) for wind in winds])
        plain, costs = self._costs(answers, winds[0], noise, free)
        seen = {0: float(costs[0] + spent[0])}
        for start in (int(np.argmin(plain + spent)), int(np.argmin(costs + spent))):
            here = start
            for _ in range(LOOKS):
                if here in seen:
                    break
                _, costs = self._costs(answers, winds[here], noise, free)
                seen[here] = float(costs[here] + spent[here])
                here = int(np.argmin(costs + spent))
        self.wind = winds[min(seen, key=lambda i: seen[i])]

    def _costs(
        self, answers: Sequence[Floats], wind: Floats, noise: Noise, free: Mapping[str, float]
    ) -> tuple[Floats, Floats]:
        """Squares (W,) that the model's answers (N, 7) to W winds leave; the same, what is free about one taken out."""
        self.wind = wind
        self.linearise({}, rough=True)
        self.whiten(noise)
        inside = self.channel >= DRIVEN
        first = judge(self.flight, wind, answers[0], self.gust, noise)
        further = first.whiten(np.stack([answer - answers[0] for answer in answers], axis=-1))
        left = first.residual.reshape(-1, 1) + further.reshape(-1, len(answers))
        left[~self._late[inside]] = 0.0
        own = [self._laid.own[key] * free[key] for key in self._laid.own if free.get(key, 0.0) > 0.0]
        explained = np.column_stack([*own, *(self._laid.local * self.local_std).T[2:]])[inside]
        pull = explained.T @ left
        inner = cho_factor(np.eye(len(pull)) + explained.T @ explained)
        plain = np.sum(left**2, axis=0)
        return plain, plain - np.sum(pull * cho_solve(inner, pull), axis=0)

    def whiten(self, noise: Noise) -> None:
        """Whiten everything under these noise levels."""
        self.noise = noise
        self._driven = self.driven(self.at)
        self.columns = self._columns(self.slopes | self.by_wind, self._expected())
        self._lay()
        self._kept = self.at, self.slopes, self.by_wind, self.columns, self._laid

    def surprise(self) -> Floats:
        """(N, 3) [rad/s] by how much each node's rate was another than expected, some nodes before."""
        spreads, every = self._driven.spreads[:, 3:6], range(3)
        used = np.isfinite(spreads) & (spreads > 0.0)
        new = np.where(used, self._driven.residual[:, 3:6] * np.where(used, spreads, 0.0), 0.0)
        # what the filter had not believed of the surprise before is none now
        new[1:] -= (1.0 - self._driven.gains[:-1, 3:6][:, every, [3, 4, 5]]) * new[:-1]
        return np.asarray(lfilter([1.0], [1.0, -FORGOTTEN], new, axis=0))

    def _expected(self) -> dict[str, Floats]:
        """What sensors' errors add to force, rate and rotor speed, by rates as they were expected.

        A scale is not to be told by how well it shrinks what nobody expected: r = e + s (w + e) has its least square
        where s is negative, whatever the scale.
        """
        found, surprise = dict(self._measured), self.surprise()
        for key, turning in self._turning.items():
            found[key] = found[key].copy()
            found[key][:, 3:6] -= surprise @ turning.T
        return found

    def start_over(self) -> None:
        """Go back to the slopes of the last whitening, so that no fit depends on those before it."""
        self.at, self.slopes, self.by_wind, self.columns, self._laid = self._kept

    def driven(self, changes: Mapping[str, float], wind: Floats | None = None) -> Driven:
        """The model's answer with some knobs changed (and another wind), and its innovations."""
        wind = self.wind if wind is None else wind
        answer = self.model.answer(self.flight.drive, wind, changes)
        return judge(self.flight, wind, answer, self.gust, self.noise)

    def settled(
        self, knobs: Mapping[str, float], seen: Mapping[str, float], local: Floats, wind: Floats | None = None
    ) -> Settled:
        """The flight's answer with some knobs at other values, what its sensors add (`seen`, `local` (L,)) put in."""
        wind = self.wind if wind is None else wind
        answer = self.model.answer(self.flight.drive, wind, knobs)
        added = np.zeros_like(answer)
        own = {key: size for key, size in seen.items() if key not in WINDY}
        for key, value in (*own.items(), *zip(self.local_keys, local[2:].tolist(), strict=True)):
            if key in self.slopes:
                answer += self.slopes[key] * value
            if key in self.by_rate:
                answer += self.by_rate[key] * value
            if key in self._measured:
                added += self._measured[key] * value
        # a rate or speed that a sensor adds to is, for the answer, its change
        answer[:, :3] += added[:, :3]
        answer[1:, 3:] += np.diff(added[:, 3:], axis=0) / self.flight.motion.step
        return Settled(self.flight, wind, answer, self.gust)

    def refresh(self, keys: Sequence[str], at: Mapping[str, float]) -> None:
        """Take the slopes of some knobs anew about a changed model."""
        self.at = self.at | {key: at.get(key, self.model.knobs[key].nominal) for key in keys}
        found = knob_slopes(self.model, self.flight, self.wind, keys, at)
        self.slopes = self.slopes | found
        columns = self._columns(found, {})
        if IMU_CLOCK in self.columns:
            changed = sum(columns[key] - self.columns[key] for key in COMMANDS if key in columns)
            columns[IMU_CLOCK] = self.columns[IMU_CLOCK] + changed
        self.columns = self.columns | columns
        self._lay()

    def _columns(self, model: Mapping[str, Floats], measured: Mapping[str, Floats]) -> dict[str, Floats]:
        model = {key: slope for key, slope in model.items() if key not in SHARED}
        keys = [*model, *measured]
        if not keys:
            return {}
        nodes, scalars = len(self.flight.motion.t), len(self.flight.motion.kinds)
        nothing = np.zeros((nodes, 7))
        # what a number adds to the true answer, the model lacks; what a sensor adds to the rate, the model does answer
        answer = np.stack([*model.values(), *(-self.by_rate.get(key, nothing) for key in measured)], axis=-1)
        seen = np.stack([*(nothing for _ in model), *measured.values()], axis=-1)
        below = self._driven.whiten(-answer, seen).reshape(7 * nodes, len(keys))
        empty = np.zeros(scalars)
        found = {}
        for c, key in enumerate(keys):
            column = np.concatenate([self._above.get(key, empty), below[:, c]])
            column[~self._late] = 0.0
            found[key] = column
        if IMU_CLOCK in found:
            found[IMU_CLOCK] = found[IMU_CLOCK] + sum(found[key] for key in COMMANDS if key in found)
        return found | {key: found[own] for key, own in SHARED.items() if own in found}

    def _lay(self) -> None:
        """The columns side by side, and their products."""
        names = (*WINDS, *self.local_keys)
        own = {key: c for key, c in self.columns.items() if key not in names}
        signatures = Signatures(tuple(own), np.column_stack(list(own.values())))
        local: Floats = np.column_stack([self.columns[key] for key in names])
        whole = np.hstack([signatures.matrix, local])
        square: Floats = whole.T @ whole
        inner = square[len(own) :, len(own) :] * self.local_std[:, None] * self.local_std + np.eye(len(names))
        self._laid = _Laid(signatures, local, square, cho_factor(inner), cho_factor(inner[2:, 2:]))

    def residual(self, knobs: Mapping[str, float], wind: Floats | None = None) -> Floats:
        """Whitened innovations (R,) with some knobs changed; zero where they do not count."""
        driven = self.driven(knobs, wind)
        residual = np.concatenate([self._seen, driven.residual.ravel()])
        residual[~self._late] = 0.0
        return residual

    def rows(self, knobs: Mapping[str, float], seen: Mapping[str, float]) -> Rows:
        """The linear form with some knobs at other values, and some of the sensors' parameters off by so much (`seen`).

        Drag and flapping are not linear in the wind: the residual is taken at the wind that fits the flight best.
        """
        declared_wind = np.array(self.model.vehicle.wind[:2]) + [seen.get(key, 0.0) for key in WINDY]
        added = np.zeros(len(self.t))
        for key, size in seen.items():
            if key not in WINDY:
                added += self.columns[key] * size
        wind = self.wind
        residual = self.residual(knobs, wind) - added
        asked, cost = self._asked(residual, wind[:2] - declared_wind)
        for _ in range(WIND_ROUNDS):
            asked = wind[:2] - declared_wind + np.clip(asked - wind[:2] + declared_wind, -WIND_REACH, WIND_REACH)
            to = np.array([*(declared_wind + asked), 0.0])
            if np.abs(to - wind).max() < WIND_CLOSE:
                break
            other = self.residual(knobs, to) - added
            further, lower = self._asked(other, asked)
            if lower < cost:
                wind, residual, cost, asked = to, other, lower, further
            else:
                asked = 0.5 * (asked + wind[:2] - declared_wind)
        local = np.zeros(len(self.local_std))
        local[:2] = wind[:2] - declared_wind
        laid = self._laid
        return Rows(residual, laid.own, laid.local, self.local_std, self.channel, self.t, local, laid.square)

    def _asked(self, residual: Floats, wind: Floats) -> tuple[Floats, float]:
        """The wind (2,) that a residual taken at another one asks for, and half the square that is left at that one.

        Both beyond what is usual.
        """
        by = self._laid.local
        pull = self.local_std * (by.T @ (residual + by[:, :2] @ wind))
        asked = (self.local_std * cho_solve(self._laid.every, pull))[:2]
        spent = wind / self.local_std[:2]
        free = self.local_std[2:] * (by[:, 2:].T @ residual)
        rest = free @ cho_solve(self._laid.but_wind, free)
        return asked, 0.5 * float(residual @ residual + spent @ spent - rest)


def solve(rows: Rows, std: Mapping[str, float]) -> tuple[dict[str, float], Floats, Floats]:
    """Everything free within these deviations: parameters, locals (L,) in all, and the residual (R,) that is left."""
    keys = [key for key in rows.signatures if std.get(key, 0.0) > 0.0]
    scale = np.concatenate([rows.local_std, [std[key] for key in keys]])
    full = np.column_stack([rows.local, *(rows.signatures[key] for key in keys)]) * scale
    whole = rows.residual + rows.local @ rows.at
    solved = np.linalg.solve(np.eye(full.shape[1]) + full.T @ full, full.T @ whole)
    count = len(rows.local_std)
    values = dict(zip(keys, (scale * solved)[count:].tolist(), strict=True))
    return values, scale[:count] * solved[:count], np.asarray(whole - full @ solved)


def priors(model: Model, causes: Sequence[Cause]) -> tuple[dict[str, float], dict[str, float]]:
    """By parameter key, what may be without any cause, and how large a cause may make it."""
    tolerances = {knob.key: knob.tolerance for knob in model.toleranced}
    for cause in causes:
        for p in cause.parameters:
            if p.tolerance is not None:
                tolerances[p.key] = float(tolerance_of(model.vehicle.document, p.tolerance, p.unit))
    for key, apparent in APPARENT.items():
        if any(p.key == key for cause in causes for p in cause.parameters):
            tolerances[key] = float(np.hypot(tolerances.get(key, 0.0), apparent))
    spreads = {p.key: max(p.spread, 3.0 * tolerances.get(p.key, 0.0)) for cause in causes for p in cause.parameters}
    return tolerances, spreads

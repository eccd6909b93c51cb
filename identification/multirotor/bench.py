"""Flights of one multirotor in linear form; see `identification.bench.Bench`."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from flightlog.constants import GRAVITY
from flightlog.tables import Table
from identification import evidence as ev
from identification.bench import Baseline, Bench, Channel
from identification.causes.contract import Cause
from identification.multirotor import noise as nz
from identification.multirotor import quick
from identification.multirotor.causes import testable
from identification.multirotor.flight import Flight, has_imu, prepare
from identification.multirotor.motion import CHANNELS, UNITS
from identification.multirotor.quick import Moving
from identification.stack import Rows, stack
from sim.multirotor.file import Multirotor

Floats = NDArray[np.float64]

ROUNDS = 4  # of the noise fit
BELIEF = 4  # flights that the declared repeatability counts for
FITS = 3  # rounds of the fit to normal flights
WIDE = 1.0  # of a cause's spread, for what such a fit may move
SURE = 0.02  # of a prior, where none is declared, is how well a balance repeats
ORDER = {True: 3, False: 4}  # nodes of the noise's memory, by whether accelerations come from an estimate
MADE = 0.12  # [s] speed that gusts make depends on them: times their square over that of the speed, [1/s] of false drag
STILL = 1e-4  # [m^2/s^2] of speed, at least
DRAG, CLIMB = "terms.drag.linear", "terms.inflow.climb"
BIAS = 0.05  # [m/s^2] of an inertial sensor's force
STEP = 0.2  # of a prior, for a derivative
REPEATED = {"thrust": ("terms.thrust.scale",), "cg": ("terms.cg_offset.x", "terms.cg_offset.y"),
            "yaw": ("terms.yaw_trim.arm",)}  # fmt: skip
ALSO = ("terms.yaw_trim.per_volt", "terms.inflow.climb", "terms.inflow.ahead")  # what else normal flights tell
SAG = "terms.battery_sag.sag"
REST = "terms.battery_sag.rest"
# what may differ once the battery was charged or exchanged, and the number of `terms.handled` that says by how much
HANDLED = {"terms.thrust.scale": "thrust", "terms.cg_offset.x": "cg", "terms.cg_offset.y": "cg"}
CHARGED = (
    0.02  # of the voltage at rest, by which it is higher after a charge; a flight of half a minute costs a hundredth
)
DRIVERS = {"time": "s", "height": "m", "speed": "m/s", "voltage": "V"}
REFERENCE = "terms.battery_sag.reference"
EARLY = 3.0  # standard deviations of a stamp, by which commands may act before it
WHITE = 0.25  # largest correlation of neighbours among what is left of a channel


class MultirotorBench:
    """Flights of one multirotor."""

    every_set = True  # few causes, quickly fitted: the search looks at all sets of them
    threshold = 7.0  # [nats] of its own: chosen by hand; balances of sets with nothing wrong came to 4

    def __init__(
        self, logs: Mapping[str, Mapping[str, Table]], vehicle: Multirotor, like: "MultirotorBench | None" = None
    ) -> None:
        """Prepare the flights and fit the noise; UserError for a log that cannot carry a diagnosis."""
        self.vehicle = vehicle
        self.names: Sequence[str] = list(logs)
        by_estimate = not all(has_imu(tables) for tables in logs.values())
        self.flights: list[Flight] = [prepare(name, tables, vehicle, by_estimate) for name, tables in logs.items()]
        moving = not (by_estimate or vehicle.by_speed)  # measured speeds are behind what a lag delays
        self._moving: Moving | None = (
            Moving(
                [quick.prepare(f, tables, vehicle) for f, tables in zip(self.flights, logs.values(), strict=True)],
                vehicle, like._moving if like is not None else None,
            )
            if moving else None
        )  # fmt: skip
        if self._moving is not None and not self._moving.tells:
            self._moving = None
        topics = set.intersection(*(set(tables) for tables in logs.values()))
        if any(np.isnan(flight.voltage).any() for flight in self.flights):
            topics -= {"battery"}
        self.causes: Sequence[Cause]
        self.causes, self.not_testable = testable(vehicle, topics, self._moving is not None)
        self.channels: Mapping[int, Channel] = {
            i: Channel(name, unit) for i, (name, unit) in enumerate(zip(CHANNELS, UNITS, strict=True))
        }
        own = {p.key: p for cause in self.causes for p in cause.parameters}
        numbers = vehicle.numbers
        hidden = ("terms.repeatability", "terms.handled", "inertia", *(() if self._moving else ("terms.motor",)))
        self.tolerances: Mapping[str, float] = (
            {
                key: number.tolerance
                for key, number in numbers.items()
                if number.tolerance > 0.0 and not key.startswith(hidden)
            }
            | self._handled()
            | self._stamped()
        )
        self.spreads: Mapping[str, float] = {
            key: max(p.spread, 3.0 * self.tolerances.get(key, 0.0)) for key, p in own.items()
        }
        anchors = (key for keys in REPEATED.values() for key in keys)
        keys = sorted({*own, *self.tolerances, *anchors})
        self.nominal: Mapping[str, float] = {key: numbers[key].value for key in keys}
        self.units: Mapping[str, str] = {key: number.unit for key, number in numbers.items()}
        self._slopes: list[dict[str, list[Floats]]] = [{} for _ in self.flights]
        self._whitened: list[tuple[dict[str, Floats], Floats, Floats] | None] = [None for _ in self.flights]
        self._noise: Mapping[int, nz.Autoregression]
        self._noise = like._noise if like is not None else self._fit_noise()
        self.baseline = self._judge()

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """See `Bench.rows`."""
        found = self._balance(flight, changes, fresh)
        if self._moving is None:
            return found
        return _both(found, self._moving.rows(flight, changes, list(self.nominal)))

    def _balance(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """The rows about the balance."""
        self._linearise(flight, changes, fresh)
        item = self.flights[flight]
        signatures, local, std = self._white(flight)
        count = len(item.t)
        return Rows(
            residual=self._whiten(item, self._residual(flight, changes)),
            signatures=signatures,
            local=local,
            local_std=std,
            channel=np.repeat([s.channel for s in item.seen], count),
            t=np.tile(item.t, len(item.seen)),
        )

    def bounded(self, key: str, value: float) -> float:
        """See `Bench.bounded`; commands may be stamped late, and a file's delay is none below nothing."""
        number = self.vehicle.numbers[key]
        low = -EARLY * self.tolerances[key] if key == quick.DELAY and key in self.tolerances else number.low
        return min(max(value, low), number.high)

    def nominal_fit(self) -> tuple[list[str], list[float], Floats]:
        """What normal flights tell of this airframe: keys, values, covariance.

        A balance does not tell mass from thrust or one rotor's torque from another's: those stay as they stand and are
        taken as known, and the balance itself is fitted. The reference of the battery's voltage goes where these
        flights were, so that sag changes nothing there (it is fitted beside, and not written: terms are not added); how
        well the balance repeats is taken from their scatter.
        """
        keys = [key for keys in REPEATED.values() for key in keys]
        moves = [key for key in (*ALSO, *quick.KEYS) if self.tolerances.get(key, 0.0) > 0.0]
        keys += moves
        wide = {key: max(self.tolerances.get(key, 0.0), WIDE * self.spreads.get(key, 0.0)) for key in keys}
        wide = {key: std if std > 0.0 else self._repeated(key) / SURE for key, std in wide.items()}
        at = {key: self.nominal.get(key, self.vehicle.numbers[key].value) for key in keys}
        free, there = list(keys), {}
        volts = np.concatenate([flight.voltage for flight in self.flights])
        if SAG in self.spreads:
            there[REFERENCE] = float(volts.mean())
            free, wide[SAG], at[SAG] = [*keys, SAG], self.spreads[SAG], self.nominal[SAG]
        spread = np.zeros((len(free), len(free)))
        for _ in range(FITS):
            s = stack([self.rows(i, at | there, free) for i in range(len(self.flights))], free)
            scale = np.array([wide[key] for key in free])
            inner = np.eye(len(free)) + scale[:, None] * s.information * scale
            step = scale * np.linalg.solve(inner, scale * s.score)
            at = {key: self.bounded(key, at[key] + d) for key, d in zip(free, step, strict=True)}
            spread = scale[:, None] * np.linalg.inv(inner) * scale
        fitted = {key: max(at[key], self.vehicle.numbers[key].low) for key in keys} | self._scatter(at | there)
        rests = [flight.rest for flight in self.flights if np.isfinite(flight.rest)]
        if rests:
            there[REST] = max(rests)
        known = {key: self.vehicle.numbers[key].value for key in self.tolerances if key not in fitted}
        values = fitted | known | there
        spread = spread[: len(keys), : len(keys)]
        spread += np.diag([self._repeated(key) ** 2 for key in keys])  # the next session is another one
        for key in moves:  # gusts bend what shows in the motion alone: it is never surer than by a half
            i = keys.index(key)
            spread[i, i] = max(spread[i, i], (0.5 * self.tolerances[key]) ** 2)
        covariance = np.zeros((len(values), len(values)))
        covariance[: len(keys), : len(keys)] = spread
        return list(values), list(values.values()), covariance

    def _stamped(self) -> dict[str, float]:
        """How late commands may be without any cause: nobody knows when within a step they were sent."""
        if self._moving is None:
            return {}
        step = max(flight.logged for flight in self.flights)
        return {quick.DELAY: float(np.hypot(self.vehicle.numbers[quick.DELAY].tolerance, quick.STAMPED * step))}

    def _handled(self) -> dict[str, float]:
        """Wider tolerances where the battery was charged or exchanged since the flights that the numbers come from."""
        numbers = self.vehicle.numbers
        before = numbers[REST].value
        rests = [flight.rest for flight in self.flights if np.isfinite(flight.rest)]
        if before <= 0.0 or not rests or max(rests) < (1.0 + CHARGED) * before:
            return {}
        found = {
            key: np.hypot(numbers[key].tolerance, numbers[f"terms.handled.{n}"].value) for key, n in HANDLED.items()
        }
        rotor = numbers["terms.handled.rotor"].value
        for i in range(self.vehicle.rotors):
            key = f"rotors.{i}.thrust_scale"
            found[key] = np.hypot(numbers[key].tolerance, rotor)
        return {key: float(std) for key, std in found.items() if std > 0.0}

    def _repeated(self, key: str) -> float:
        """How well the number behind a key repeats from flight to flight."""
        name = next((name for name, keys in REPEATED.items() if key in keys), None)
        return 0.0 if name is None else self.vehicle.numbers[f"terms.repeatability.{name}"].value

    def _scatter(self, at: Mapping[str, float]) -> dict[str, float]:
        """Repeatability of the balance, what the file declares counting as much as BELIEF flights."""
        found = {}
        rows = [self.rows(i, at) for i in range(len(self.flights))]
        for name in REPEATED:
            declared = self.vehicle.numbers[f"terms.repeatability.{name}"].value
            square, count = BELIEF * declared**2, float(BELIEF)
            for key in REPEATED[name]:
                own = [item.signatures[key] for item in rows]
                each = [s @ item.residual / max(float(s @ s), 1e-12) for s, item in zip(own, rows, strict=True)]
                noise = float(np.mean([1.0 / max(float(s @ s), 1e-12) for s in own]))
                square += max(float(np.sum((np.array(each) - np.mean(each)) ** 2)) - (len(each) - 1) * noise, 0.0)
                count += len(each) - 1
            found[f"terms.repeatability.{name}"] = float(np.sqrt(square / count))
        return found

    def drivers(self, flight: int) -> Mapping[str, tuple[str, Floats, Floats]]:
        """What a residual of one flight may depend on: label, times and values by name."""
        t = self.flights[flight].t
        return {name: (f"{name} [{DRIVERS[name]}]", t, v) for name, v in self._courses(flight).items()}

    def courses(self) -> Sequence[tuple[str, str, Sequence[tuple[Floats, Floats]]]]:
        """The same of all flights: name, unit and the course (times, values) on each."""
        names = set.intersection(*(set(self._courses(i)) for i in range(len(self.flights))))
        return [
            (name, unit, [(f.t, self._courses(i)[name]) for i, f in enumerate(self.flights)])
            for name, unit in DRIVERS.items()
            if name in names
        ]

    def _courses(self, flight: int) -> dict[str, Floats]:
        item = self.flights[flight]
        found = {"time": item.t - item.t[0], "height": item.height, "speed": item.speed, "voltage": item.voltage}
        return {name: values for name, values in found.items() if np.isfinite(values).all()}

    def _white(self, flight: int) -> tuple[dict[str, Floats], Floats, Floats]:
        """Signatures (R,) by key, locals (R, L) and their deviations (L,), as long as slopes and noise are the same."""
        known = self._whitened[flight]
        if known is None:
            item, slopes = self.flights[flight], self._slopes[flight]
            local, std = self._local(flight)
            columns = [*(slopes[key] for key in self.nominal), *local]
            whole = self._whiten(item, [np.column_stack([c[i] for c in columns]) for i in range(len(item.seen))])
            signatures = {key: whole[:, i].copy() for i, key in enumerate(self.nominal)}
            known = self._whitened[flight] = signatures, whole[:, len(self.nominal) :].copy(), std
        return known

    def white(self, flight: int, which: int, values: Floats) -> Floats:
        """Whitened rows (K, C) of effects (K, C) in one flight's channel number `which` of those it has seen."""
        item = self.flights[flight]
        return self._noise[item.seen[which].channel].whiten(values, item.spans)

    def _whiten(self, item: Flight, parts: Sequence[Floats]) -> Floats:
        """Channels (K, ...) one behind the other as whitened rows (R, ...)."""
        pairs = zip(item.seen, parts, strict=True)
        return np.concatenate([self._noise[s.channel].whiten(part, item.spans) for s, part in pairs])

    def _residual(self, flight: int, changes: Mapping[str, float]) -> list[Floats]:
        """Measured less expected, a channel each (K,)."""
        item = self.flights[flight]
        expected = item.expected(self.vehicle, changes)
        return [s.measured - e for s, e in zip(item.seen, expected, strict=True)]

    def _linearise(self, flight: int, changes: Mapping[str, float], fresh: Collection[str]) -> None:
        known = self._slopes[flight]
        wanted = [key for key in self.nominal if key in fresh or key not in known]
        if not wanted:
            return
        self._whitened[flight] = None
        item, values = self.flights[flight], self.vehicle.values(changes)
        base = item.expected(self.vehicle, values)
        for key in wanted:
            number = self.vehicle.numbers[key]
            width = max(self.spreads.get(key, 0.0), self.tolerances.get(key, 0.0))
            step = STEP * width if width > 0.0 else 1e-3 * max(abs(number.value), 1.0)
            if values[key] + step > number.high:
                step = -step
            moved = item.expected(self.vehicle, values | {key: values[key] + step})
            known[key] = [(m - b) / step for m, b in zip(moved, base, strict=True)]

    def _local(self, flight: int) -> tuple[list[list[Floats]], Floats]:
        """What belongs to one flight alone: its columns, a channel each, and standard deviations."""
        item, slopes = self.flights[flight], self._slopes[flight]
        columns: list[list[Floats]] = []
        std: list[float] = []
        for name, keys in REPEATED.items():
            spread = self.vehicle.numbers[f"terms.repeatability.{name}"].value
            columns += [slopes[key] for key in keys]
            std += [spread] * len(keys)
        along = np.interp(item.t, item.t[[0, -1]], [-1.0, 1.0])  # yaw drifts within a flight as it does between flights
        columns.append([part * along for part in slopes["terms.yaw_trim.arm"]])
        std.append(self.vehicle.numbers["terms.repeatability.yaw"].value)
        if not item.by_estimate:
            for axis in range(3):
                columns.append([np.full(len(item.t), float(s.channel == axis)) for s in item.seen])
                std.append(BIAS)
            gust = float(np.mean([self._noise[axis].lags[0] for axis in range(3)]))
            for key, unit, axes in ((DRAG, self.vehicle.mass, (0, 1)), (CLIMB, 1.0 / GRAVITY, (2,))):
                columns.append(slopes[key] if key in slopes else [np.zeros(len(item.t)) for _ in item.seen])
                speed = item.inputs.velocity[item.flown][:, axes].var(axis=0).mean()
                std.append(unit * MADE * gust / max(float(speed), STILL))
        return columns, np.array(std)

    def _fit_noise(self) -> dict[int, nz.Autoregression]:
        """Noise from what is left after everything that has a name was taken out."""
        wide = {key: max(self.tolerances.get(key, 0.0), self.spreads.get(key, 0.0)) for key in self.nominal}
        channels = [s.channel for s in self.flights[0].seen]
        first = [self._residual(i, {}) for i in range(len(self.flights))]
        spans = [flight.spans for flight in self.flights]
        order = ORDER[self.flights[0].by_estimate]
        self._noise = {
            channel: nz.white([parts[c] for parts in first], spans, order) for c, channel in enumerate(channels)
        }
        for _ in range(ROUNDS):
            left = self._left(wide)
            self._noise = {
                channel: nz.fit([parts[c] for parts in left], spans, order) for c, channel in enumerate(channels)
            }
            self._whitened = [None for _ in self.flights]
        return dict(self._noise)

    def _left(self, std: Mapping[str, float]) -> list[list[Floats]]:
        """What all flights leave, in their own units, once everything free was fitted to each."""
        found = []
        for i in range(len(self.flights)):
            values, local, _ = ev.solve(self._balance(i, {}), std)
            columns, _ = self._local(i)
            parts = [part.copy() for part in self._residual(i, {})]
            for c in range(len(parts)):
                for key, value in values.items():
                    parts[c] -= value * self._slopes[i][key][c]
                for value, column in zip(local, columns, strict=True):
                    parts[c] -= value * column[c]
            found.append(parts)
        return found

    def _judge(self) -> Baseline:
        """Whether what is left is white, once everything that has a name was taken out."""
        names = {s.channel: (CHANNELS[s.channel], UNITS[s.channel]) for s in self.flights[0].seen}
        levels = {names[c][0]: (noise.std, names[c][1]) for c, noise in self._noise.items()}
        wide = {key: max(self.tolerances.get(key, 0.0), self.spreads.get(key, 0.0)) for key in self.nominal}
        left = self._left(wide)
        for c, (number, noise) in enumerate(self._noise.items()):
            white = [noise.whiten(p[c], f.spans) for p, f in zip(left, self.flights, strict=True)]
            pairs = [(w[a + 1 : b], w[a : b - 1]) for w, f in zip(white, self.flights, strict=True) for a, b in f.spans]
            here, before = np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs])
            near = float(np.corrcoef(here, before)[0, 1])
            if abs(near) > max(WHITE, 4.0 / np.sqrt(len(here))):
                reason = f"what is left of {CHANNELS[number]} is no noise: neighbours are correlated by {near:.2f}"
                return Baseline(False, reason, levels)
        return Baseline(True, None, levels)


def _both(balance: Rows, moving: Rows) -> Rows:
    """One behind the other, each with what is free in it alone."""
    rows, locals_ = len(balance.residual), len(balance.local_std)
    local = np.zeros((rows + len(moving.residual), locals_ + len(moving.local_std)))
    local[:rows, :locals_], local[rows:, locals_:] = balance.local, moving.local
    return Rows(
        residual=np.concatenate([balance.residual, moving.residual]),
        signatures={key: np.concatenate([own, moving.signatures[key]]) for key, own in balance.signatures.items()},
        local=local,
        local_std=np.concatenate([balance.local_std, moving.local_std]),
        channel=np.concatenate([balance.channel, moving.channel]),
        t=np.concatenate([balance.t, moving.t]),
    )


def open_bench(
    logs: Mapping[str, Mapping[str, Table]], vehicle: Multirotor, like: Bench | None = None
) -> MultirotorBench:
    """See `identification.bench.OpenBench`."""
    return MultirotorBench(logs, vehicle, like if isinstance(like, MultirotorBench) else None)

"""Helicopters: motion by the sensors, forces by the model along it."""

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.tables import Table
from identification import about, noise_fit
from identification import evidence as ev
from identification import kinematics as k
from identification.bench import Baseline, Bench, Channel
from identification.causes import CATALOGUE
from identification.causes.contract import Cause
from identification.drive import Noise
from identification.dynamics import CHANNELS, UNITS
from identification.evidence import Sheet
from identification.flight import Flight, prepare
from identification.model import Model
from identification.refit import refit
from identification.stack import Rows
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

START = Noise(
    gust_share=(1.5, 1.5, 1.5), process=(0.0, 0.0, 0.0, 2e-3, 1e-3, 1e-3, 0.05),
    noise=(0.05, 0.05, 0.05, 1e-3, 1e-3, 1e-3, 0.22),
)  # fmt: skip
# times the noise of force, moment and rotor speed while everything is set free: what is linear about the nominal
# numbers says little of the true ones, least of all by moments, which show a hundredth of what tolerances leave open
DIM = ((4.0, 100.0, 20.0), (4.0, 30.0, 8.0), (3.0, 15.0, 4.0))
STEPS = 4  # tries at each
# by how much of itself, or of its standard deviation, an error may still change before flights are prepared anew for it
SETTLED_BY, SETTLED_WITHIN, PLAY_BY = 0.1, 0.7, 0.02
# [m/s] of wind at 10 m, and gusts over those that belong to it, from which on more evidence is asked for, by hand: null
# sets blew at up to 6.5 with gusts of 1.6 at most. In 8.6 a centre of mass was named at 92 nats, in 10 a droop at 120,
# where gusts were twice as strong as belongs to the wind a droop at 25
STRONG, STEEP, GUSTY = 6.5, 8, 2.0
ASTRAY = 3.0  # tolerances that the inflow's mass may be low by: beyond lies a valley in which lags are false
MOVED = 0.5  # of a tolerance, beyond which a slope is taken anew

MEASURED = ("m/s^2",) * 3 + ("rad/s",) * 4  # moments are seen by what rates make of them
SCALAR_UNITS = {"gps": "m", "baro": "m", "sonar": "m", "mag": "uT", "pad": "m"}


class HelicopterBench:
    """Flights of one helicopter; see `identification.bench.Bench`."""

    # [nats] the best cause of 60 sets of three 60 s flights with nothing wrong gained 10.0 at most; an exponential of
    # the highest fifth puts one set in 500 at 14.1 (docs/diagnosis.md, "Blind benchmark: helicopter"). Beside by hand
    threshold, beside = 14.1, 15.0
    # root mean square of 46 known numbers' errors in those that the linear fit states: no model is exact
    widened = 1.32
    apart = True  # flights share nothing that is written: they may be taken side by side

    def __init__(
        self, logs: Mapping[str, Mapping[str, Table]], vehicle: Vehicle, like: "HelicopterBench | None" = None,
        prepared_at: Mapping[str, float] | None = None, in_force: Mapping[str, float] | None = None,
        before: "HelicopterBench | None" = None,
    ) -> None:  # fmt: skip
        """Prepare the flights and fit the noise; UserError for a log that cannot carry a diagnosis.

        prepared_at: errors of sensors, absolute by key, with which the motion is filtered. in_force: numbers of rough
        causes about which the noise is fitted. before: the same flights prepared otherwise, whose winds and numbers are
        where this one begins.
        """
        self.vehicle, self._logs = vehicle, logs
        self.names: Sequence[str] = list(logs)
        self.model = Model(vehicle)
        units = {p.key: p.unit for cause in CATALOGUE.values() for p in cause.parameters}
        given = prepared_at if like is None else like.prepared_at
        measuring = about.with_errors(vehicle, given, units) if given else vehicle
        self.prepared_at: Mapping[str, float] = {
            key: about.number(measuring, key, units[key], value) for key, value in (given or {}).items()
        }
        self.in_force: Mapping[str, float] = dict(in_force or {})
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            self.flights: list[Flight] = list(pool.map(lambda log: prepare(log[0], log[1], measuring), logs.items()))
        topics = set.intersection(*(set(tables) for tables in logs.values()))
        self.causes: Sequence[Cause]
        self.not_testable: Mapping[str, Sequence[str]]
        self.causes, self.not_testable = ev.testable(vehicle, topics)
        self.channels: Mapping[int, Channel] = {
            **{i: Channel(name, SCALAR_UNITS[name.partition(".")[0]]) for i, name in enumerate(k.CHANNELS)},
            **{100 + i: Channel(name, unit) for i, (name, unit) in enumerate(zip(CHANNELS, UNITS, strict=True))},
        }
        self.sensor_channels: Sequence[int] = [number for number in self.channels if number < ev.DRIVEN]
        self._describe()
        self.sheets = [Sheet(self.model, flight, self.causes, self._knob_keys) for flight in self.flights]
        self._settle(like, before)
        self.caution = caution(
            [sheet.wind for sheet in self.sheets], [max(sheet.noise.gust_share) for sheet in self.sheets]
        )
        self.threshold, self.beside = self.caution * type(self).threshold, self.caution * type(self).beside
        self.baseline = self._judge()

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """See `Bench.rows`."""
        sheet = self.sheets[flight]
        knobs = {key: value for key, value in changes.items() if key in self.model.knobs}
        wanted = [key for key in self._knob_keys if key in fresh and self._moved(sheet, key, knobs)]
        if wanted:
            sheet.refresh(wanted, knobs)
        return sheet.rows(knobs, self.errors(changes))

    def errors(self, values: Mapping[str, float]) -> dict[str, float]:
        """By key, how far the sensors' numbers, nominal where not given, are from those that filtered the motion."""
        keys = {key: None for key in (*values, *self.prepared_at) if key not in self.model.knobs}
        return {
            key: values.get(key, self.nominal[key]) - self.prepared_at.get(key, self.nominal[key]) for key in keys
        }

    def settled(self, causes: Sequence[Cause], at: Mapping[str, float], std: Mapping[str, float]) -> bool:
        """Whether flights were prepared with these causes' errors of sensors, and play, about as large as in `at`.

        std: of what is in `at`, by key. What no vehicle file may say cannot be prepared any better.
        """
        found, taken = self._taken_out(causes, at), {**self.prepared_at, **self.in_force}
        return not self._possible(found) or all(
            key in taken
            and abs(value - taken[key])
            <= max(
                (PLAY_BY if key in self.in_force else SETTLED_BY) * abs(value - self.nominal[key]),
                SETTLED_WITHIN * std[key],
            )
            for key, value in found.items()
        )

    def anew(
        self, causes: Sequence[Cause], at: Mapping[str, float], std: Mapping[str, float]
    ) -> "HelicopterBench | None":
        """The same flights, filtered with these causes' errors of sensors as in `at`, and with their play in force.

        None where just this was taken out already, by about as much (`settled`).
        """
        found = self._taken_out(causes, at)
        errors = {key: value for key, value in found.items() if key not in self.model.knobs}
        play = {key: value for key, value in found.items() if key in self.model.knobs}
        fewer = {*self.prepared_at, *self.in_force} - found.keys()
        if not self._possible(found) or (not fewer and self.settled(causes, at, std)):
            return None
        alike = self if self.prepared_at or self.in_force else None  # what was distorted leads astray
        return HelicopterBench(self._logs, self.vehicle, prepared_at=errors, in_force=play, before=alike)

    def _taken_out(self, causes: Sequence[Cause], at: Mapping[str, float]) -> dict[str, float]:
        """What of these causes the flights can be prepared with."""
        plain = [p.key for cause in causes if cause.changes is not None for p in cause.parameters]
        rough = [p.key for cause in causes if cause.starts for p in cause.parameters]
        keys = [*(key for key in plain if key.startswith(about.OF_SENSORS)), *rough]
        return {key: at[key] for key in keys if key in at}

    def _possible(self, found: Mapping[str, float]) -> bool:
        """Whether a vehicle file may say so."""
        try:
            about.with_errors(self.vehicle, {k: v for k, v in found.items() if k not in self.model.knobs}, self.units)
        except UserError:
            return False
        return True

    def renew(self, at: Mapping[str, float] | None) -> None:
        """Take the slopes of what has moved anew about these values, all where nothing has.

        None: go back to those that every fit begins with.
        """
        if at is None:
            for sheet in self.sheets:
                sheet.start_over()
            return
        knobs = {key: value for key, value in at.items() if key in self.model.knobs}

        def again(sheet: Sheet) -> None:
            moved = [key for key in self._knob_keys if self._moved(sheet, key, knobs)]
            sheet.refresh(moved or self._knob_keys, knobs)

        self._each(again)

    def start(self, names: Sequence[str]) -> Mapping[str, float]:
        """Where a fit of these causes begins: where everything set free leads, the true numbers being near."""
        return self.reached

    def bounded(self, key: str, value: float) -> float:
        """See `Bench.bounded`."""
        knob = self.model.knobs.get(key)
        if knob is None:
            return value
        low = max(knob.low, knob.nominal - ASTRAY * knob.tolerance) if key == ev.INFLOW and knob.tolerance else knob.low
        return min(max(value, low), knob.high)

    def courses(self) -> Sequence[tuple[str, str, Sequence[tuple[Floats, Floats]]]]:
        """See `regions.Driven`."""
        motions = [flight.motion for flight in self.flights]
        return [
            ("height", "m", [(m.t, m.position[:, 2]) for m in motions]),
            ("speed", "m/s", [(m.t, np.linalg.norm(m.velocity[:, :2], axis=1)) for m in motions]),
            ("time", "s", [(m.t, m.t - m.t[0]) for m in motions]),
        ]

    def _describe(self) -> None:
        own = {p.key: p for cause in self.causes for p in cause.parameters}
        knobs = self.model.knobs
        self._knob_keys = sorted({*(key for key in own if key in knobs), *(kn.key for kn in self.model.toleranced)})
        self.nominal: Mapping[str, float] = {
            **{key: about.number(self.vehicle, key, p.unit, p.nominal) for key, p in own.items() if key not in knobs},
            **{key: knobs[key].nominal for key in self._knob_keys},
        }
        self.units: Mapping[str, str] = {
            **{key: p.unit for key, p in own.items()}, **{key: knobs[key].unit for key in self._knob_keys}
        }  # fmt: skip
        self.tolerances: Mapping[str, float]
        self.spreads: Mapping[str, float]
        self.tolerances, self.spreads = ev.priors(self.model, self.causes)

    def _moved(self, sheet: Sheet, key: str, knobs: Mapping[str, float]) -> bool:
        """Whether a slope was taken too far from where the model is now."""
        scale = self.tolerances.get(key, 0.0) or self.spreads[key]
        return abs(knobs.get(key, self.nominal[key]) - sheet.at[key]) > MOVED * scale

    def _settle(self, like: "HelicopterBench | None", before: "HelicopterBench | None") -> None:
        """Everything that has a name is set free: wind, slopes and noise are taken where that leads.

        So the noise is what no cause explains, whether a cause is at work or not.
        """
        free = [c for c in self.causes if not c.starts or any(p.key in self.in_force for p in c.parameters)]
        at = {key: value for key, value in self.prepared_at.items() if key in self.nominal} | dict(self.in_force)
        stages: list[tuple[tuple[float, float, float], list[Cause]]]
        stages = list(zip(DIM, ([], free, free), strict=True))
        if before is None:
            self._each(lambda sheet: sheet.look_for_wind(dimmed(START, DIM[0]), self.tolerances))
        else:
            stages, at = stages[-1:], dict(before.reached) | at
            for sheet, old in zip(self.sheets, before.sheets, strict=True):
                sheet.wind = old.wind.copy()
        for stage, causes in stages:
            self._linearise(at, [dimmed(START, stage)] * len(self.sheets), rough=True)
            at = dict(refit(self, causes, start=at, rounds=STEPS).at)
            settled = [self._settled(i, at) for i in range(len(self.sheets))]
        least = dimmed(START, DIM[-1])  # what the model itself is off by in gusts and quick turns
        noise = noise_fit.fit([least] * len(self.sheets), settled, None if like is None else like.sheets[0].noise)
        self._linearise(at, noise, rough=False)
        self.reached: Mapping[str, float] = at
        self.noise = self.sheets[0].noise

    def _settled(self, i: int, at: Mapping[str, float]) -> noise_fit.Settled:
        """A flight with all that is set free taken out, its wind there."""
        rows, sheet = self.rows(i, at), self.sheets[i]
        _, local, _ = ev.solve(rows, {})
        knobs = {key: value for key, value in at.items() if key in self.model.knobs}
        seen = self.errors(at)
        # where the residual was taken, which was seen to be better; the step from there was not
        sheet.wind = np.array([*(rows.at[:2] + self.vehicle.wind[:2] + [seen.get(key, 0.0) for key in ev.WINDY]), 0.0])
        return sheet.settled(knobs, seen, local)

    def _linearise(self, at: Mapping[str, float], noise: Sequence[Noise], rough: bool) -> None:
        knobs = {key: value for key, value in at.items() if key in self.model.knobs}
        levels = dict(zip(map(id, self.sheets), noise, strict=True))

        def anew(sheet: Sheet) -> None:
            sheet.linearise(knobs, rough)
            sheet.whiten(levels[id(sheet)])

        self._each(anew)

    def _each(self, do: Callable[[Sheet], None]) -> None:
        """Do something to every flight, side by side."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(do, self.sheets))

    def _judge(self) -> Baseline:
        names = [channel.name for number, channel in sorted(self.channels.items()) if number >= ev.DRIVEN]
        levels = {
            name: (level, MEASURED[i]) for i, (name, level) in enumerate(zip(names, self.noise.noise, strict=True))
        }
        winds = np.mean([sheet.wind for sheet in self.sheets], axis=0)
        gust = float(np.mean([(sheet.gust.std * sheet.noise.gust_share)[:, 0].mean() for sheet in self.sheets]))
        air = {"wind_e": float(winds[0]), "wind_n": float(winds[1]), "gust_std": gust}
        return Baseline(True, None, levels, air)


def caution(winds: Sequence[Floats], shares: Sequence[float]) -> float:
    """Times as much evidence as in usual weather, for what bends in a gust's reach; at most that of twice the wind.

    By flight, wind (3,) [m/s] at 10 m and gusts' strength in that which belongs to it.
    """
    blown = [min(float(np.linalg.norm(wind[:2])) / STRONG, 2.0) ** STEEP for wind in winds]
    return max(1.0, *blown, *(share / GUSTY for share in shares))


def dimmed(noise: Noise, times: tuple[float, float, float]) -> Noise:
    """Levels of force, of the rates and of the rotor's speed so many times as large."""
    by = np.repeat(times, (3, 3, 1))
    return replace(
        noise, noise=tuple((by * noise.noise).tolist()), process=tuple((by * noise.process).tolist())
    )  # fmt: skip


def open_bench(
    logs: Mapping[str, Mapping[str, Table]], vehicle: Vehicle, like: Bench | None = None
) -> HelicopterBench:
    """See `identification.bench.OpenBench`."""
    return HelicopterBench(logs, vehicle, like if isinstance(like, HelicopterBench) else None)

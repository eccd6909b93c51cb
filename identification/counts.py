"""Causes that are events: how often they happened against how often the vehicle file lets them.

Each has the exact evidence of its own counts, so it competes with none of the causes that change the innovations:
samples that jump are left out of those by the filter's gate.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaln

from flightlog.tables import Table
from identification.causes import CATALOGUE
from identification.flight import Flight
from identification.parity import events
from identification.parity.series import Series, collect
from identification.verdict import Asserted, Candidate, CauseGain, Fitted
from sim.vehicle import Vehicle

Floats = NDArray[np.float64]

PRIOR = 0.01  # that such events are at work
CLEAR = 0.5  # [m] beyond its reach, from which on a ranger can have no echo
QUIET = 3.0  # white noises of a barometer that count as everyday
LAG = 0.4  # [s] of the barometer behind the motion
ALIKE = 1.5  # times the size that the file tells of, up to which a jump is no other
FOLDS = 5  # parts of a single flight, each of which is held out in turn


@dataclass(frozen=True)
class Counted:
    """Evidence for one cause of this kind."""

    name: str
    log_bayes_factor: float
    parameters: Mapping[str, Fitted]
    gain: CauseGain | None = None

    @property
    def probability(self) -> float:
        """With the prior of such a cause."""
        odds = self.log_bayes_factor + np.log(PRIOR / (1.0 - PRIOR))
        return float(1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0))))

    def asserted(self) -> Asserted:
        """As the verdict says it."""
        return Asserted(self.name, CATALOGUE[self.name].where, self.probability, self.parameters, self.gain)

    def candidate(self) -> Candidate:
        """As everything that was scored."""
        return Candidate(self.name, round(self.log_bayes_factor, 3), self.probability, None)


def count(logs: Mapping[str, Mapping[str, Table]], flights: Sequence[Flight], vehicle: Vehicle) -> list[Counted]:
    """Every such cause that these flights can show; flights in the order of the logs."""
    tables = list(logs.values())
    found = []
    if "sonar" in vehicle.sensors and all("sonar" in t for t in tables):
        found.append(_echoes(tables, flights, vehicle))
    if "baro" in vehicle.sensors and all("baro" in t for t in tables):
        found.append(_jumps(tables, flights, vehicle))
    return found


def _echoes(tables: Sequence[Mapping[str, Table]], flights: Sequence[Flight], vehicle: Vehicle) -> Counted:
    """Binomial: the share has the vehicle file's prior, or any value."""
    numbers = vehicle.sensors["sonar"].numbers
    declared = numbers["false_echo_share"]
    tolerance = float(vehicle.document["sensors"]["sonar"]["false_echo_share"].get("tolerance", 0.02))
    heard: list[NDArray[np.bool_]] = []
    for table, flight in zip(tables, flights, strict=True):
        t = np.asarray(table["sonar"]["t"], float)
        height = np.interp(t, flight.motion.t, flight.motion.position[:, 2], left=0.0, right=0.0)
        beyond = height > numbers["greatest_range"] + CLEAR
        valid = np.asarray(table["sonar"]["valid"], float) if "valid" in table["sonar"] else np.ones(len(t))
        heard.append(valid[beyond] > 0)
    could, claimed = sum(len(one) for one in heard), sum(int(one.sum()) for one in heard)
    mean = min(max(declared, 1e-3), 0.5)
    weight = max(mean * (1.0 - mean) / max(tolerance, 1e-3) ** 2 - 1.0, 2.0)
    a, b = mean * weight, (1.0 - mean) * weight
    rest = could - claimed
    evidence = betaln(1.0 + claimed, 1.0 + rest) - (betaln(a + claimed, b + rest) - betaln(a, b))
    share = (1.0 + claimed) / (2.0 + could)
    std = float(np.sqrt(share * (1.0 - share) / (3.0 + could)))
    ends = max(0.0, share - 1.96 * std), min(1.0, share + 1.96 * std)
    # fewer than declared is no fault
    return Counted("sonar_false_echo", float(evidence) if share > declared else min(0.0, float(evidence)),
                   {"share": Fitted(share, declared, std, ends, "1")}, _foretold(heard, declared))  # fmt: skip


def _foretold(heard: Sequence[NDArray[np.bool_]], declared: float) -> CauseGain | None:
    """How much better the others' share foretells whether there is an echo: each flight, or part of one, held out."""
    parts = list(heard) if len(heard) > 1 else np.array_split(heard[0], FOLDS)
    whole = np.concatenate(parts)
    if len(whole) < FOLDS or whole.all() == whole.any():
        return None
    others = [(1.0 + whole.sum() - one.sum()) / (2.0 + len(whole) - len(one)) for one in parts]
    told = np.repeat(others, [len(one) for one in parts])
    before, after, floor = (float(np.mean((whole - share) ** 2)) for share in (declared, told, whole.mean()))
    explained = (before - after) / max(before - floor, 1e-12)
    return CauseGain("sonar.valid", 1.0 - float(np.sqrt(after / before)), float(np.clip(explained, -1.0, 1.0)))


def _jumps(tables: Sequence[Mapping[str, Table]], flights: Sequence[Flight], vehicle: Vehicle) -> Counted:
    noise = vehicle.sensors["baro"].numbers["noise"]
    total, best = 0.0, None
    number = 0
    for table, flight in zip(tables, flights, strict=True):
        baro = collect({"baro": table["baro"]}).baro.get("baro")
        if baro is None:
            continue
        inside = (baro.t < flight.motion.t[0]) | (baro.t > flight.motion.t[-1])
        height = Series("motion", flight.motion.t, flight.motion.position[:, 2])
        jumps = events.glitches(baro.without(inside), [height], everyday=QUIET * noise, late=LAG)
        total += jumps.log_bayes_factor
        number += jumps.count
        if best is None or abs(jumps.size) > abs(best.size):
            best = jumps
    known = vehicle.sensors["baro"].numbers
    usual = len(flights) * known["glitch_count"]
    if usual > 0.0 and best is not None and number <= usual + 3.0 * np.sqrt(usual) and (
        abs(best.size) <= ALIKE * abs(known["glitch_size"])
    ):
        total = 0.0  # the file tells of such jumps
    size, first = (0.0, float("nan")) if best is None else (best.size, best.first)
    spread = float(np.sqrt(max(number, 1)))
    return Counted("baro_glitch", total, {
        "count": Fitted(number, 0.0, spread, (max(0.0, number - 1.96 * spread), number + 1.96 * spread), "1"),
        "size": Fitted(size, 0.0, noise, (size - 1.96 * noise, size + 1.96 * noise), "m"),
        "first": Fitted(first, 0.0, 0.1, (first - 0.196, first + 0.196), "s"),
    })  # fmt: skip


def told(causes: Sequence[Asserted], flights: int) -> dict[str, tuple[float, str, str, float]]:
    """What counted causes change in the vehicle file: by key value, cause, unit and standard deviation.

    Jumps are counted over all the flights and told of one.
    """
    found = {}
    for cause in causes:
        own = CATALOGUE.get(cause.name)
        if own is None or not own.counted:
            continue
        for p in own.parameters:
            fitted = cause.parameters[p.name]
            share = 1.0 / flights if p.name == "count" else 1.0
            found[p.key] = (fitted.value * share, cause.name, p.unit, fitted.std * share)
    return found

"""Draws a blind set from a seed, flies it, writes what was measured, and seals the answer.

A set is three flights of one vehicle. The answer (what is wrong, by how much, what flew) goes to a place of its own;
beside the flights lies its hash alone, written before anybody judges.
"""

import copy
import hashlib
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from flightlog.flight_json import plain
from sim import vehicle as vehicles
from sim.sensors.faults import Dropout, Fault, Spike
from sim.vehicle import Vehicle
from sim.world import World
from tests.blind import draws
from tests.blind.effects import EFFECTS, UNKNOWN, Effect
from tests.blind.flights import Tampering, measured, write
from tests.blind.foreign import White
from tests.blind.plans import PLANS, FlightPlan, weather

Kind = Literal["null", "single", "pair", "unknown", "weak"]
WEAK = 0.04  # share of the usual size that nobody can see
# what the mark and the ranger say of near-by outliers, dropouts and attitude noise
OUTLIERS = {"gps": ("u", 5.0), "baro": ("altitude", 5.0), "sonar": ("range", 1.0), "pad": ("x", 1.0)}
LOST = 0.05
NOISY = 0.004 * 47.0  # [uT]: 4 mrad of the field


@dataclass(frozen=True)
class Told:
    """One effect as the answer tells it."""

    name: str
    where: str
    form: str
    values: Mapping[str, float]


@dataclass(frozen=True)
class Answer:
    """What is true of a set."""

    seed: int
    kind: Kind
    vehicle: str  # the nominal one
    effects: tuple[Told, ...]
    plans: tuple[str, ...]
    without: tuple[str, ...]  # topics that were left out
    stress: bool
    document: Mapping[str, Any] = field(repr=False)  # vehicle file of what flew, foreign terms left out
    shows: tuple[str, str] | None = None  # of an unknown effect: channel, what it depends on

    @property
    def names(self) -> tuple[str, ...]:
        """Of the effects."""
        return tuple(effect.name for effect in self.effects)


@dataclass(frozen=True, eq=False)
class Set:
    """A set as it is handed to whoever judges: flights, the nominal vehicle's name, the seal."""

    folder: Path
    flights: tuple[Path, ...]
    vehicle: str
    seal: str  # SHA-256 of the answer

    def open(self, answers: Path) -> Answer:
        """The answer; ValueError where it is not the one that was sealed."""
        text = (answers / f"{self.folder.name}.json").read_text()
        if hashlib.sha256(text.encode()).hexdigest() != (self.folder / "answer.sha256").read_text().strip():
            raise ValueError(f"{self.folder}: the answer is not the one that was sealed")
        told = json.loads(text)
        told["effects"] = tuple(Told(**effect) for effect in told["effects"])
        told |= {key: tuple(told[key]) for key in ("plans", "without")}
        told["shows"] = tuple(told["shows"]) if told["shows"] else None
        return Answer(**told)


def make(
    seed: int,
    kind: Kind,
    folder: Path,
    answers: Path,
    *,
    names: Sequence[str] | None = None,
    vehicle: str = "raptor90",
    plans: Sequence[str] | None = None,
    flights: int = 3,
    duration_s: float = 60.0,
    without: Collection[str] = (),
    stress: bool = False,
) -> Set:
    """Draw, fly and seal one set.

    Args:
        seed: everything follows from it.
        kind: nothing wrong, one or two effects, one that no catalogue holds, or one too small to be seen.
        folder: of the set, named as the set; made.
        answers: where the answer goes.
        names: of the effects, where they are not to be drawn.
        vehicle: the nominal vehicle.
        plans: of `plans.PLANS`, where they are not to be drawn.
        flights: how many.
        duration_s: of each.
        without: topics to leave out.
        stress: gusts doubled, outliers, dropouts and noise of the attitude.
    """
    rng = np.random.default_rng([seed, 20])
    nominal = vehicles.load(vehicle)
    true = draws.vehicle(nominal, rng)
    chosen, shows = _choose(kind, names, rng, without)
    share = WEAK if kind == "weak" else 1.0
    effects = [draw(true, rng, share) for draw in chosen]
    flying = inject(true, effects)
    tampering: list[Tampering] = [t for effect in effects for t in effect.tampering] + ([_stressed] if stress else [])
    todo = list(plans) if plans is not None else [str(name) for name in rng.permutation(list(PLANS))[:flights]]
    drawn: list[FlightPlan] = [PLANS[name](rng, duration_s) for name in todo]
    airs = [weather(rng, _wind_std(nominal)) for _ in drawn]
    answer = Answer(
        seed, kind, vehicle, tuple(Told(e.name, e.where, e.form, dict(e.values)) for e in effects), tuple(todo),
        tuple(without), stress, flying.document, shows,
    )  # fmt: skip

    folder.mkdir(parents=True)
    answers.mkdir(parents=True, exist_ok=True)
    text = json.dumps(plain(asdict(answer)), sort_keys=True)
    seal = hashlib.sha256(text.encode()).hexdigest()
    (folder / "answer.sha256").write_text(seal + "\n")
    (answers / f"{folder.name}.json").write_text(text)
    paths = []
    for i, (plan, air) in enumerate(zip(drawn, airs, strict=True)):
        rows = measured(plan, flying, nominal, seed=seed * 16 + i, weather=air, tampering=tampering)
        paths.append(folder / f"flight-{i + 1}")
        write(rows, paths[-1], vehicle, without)
    return Set(folder, tuple(paths), vehicle, seal)


def inject(true: Vehicle, effects: Sequence[Effect]) -> Vehicle:
    """The vehicle with these effects in it."""
    document = copy.deepcopy(dict(true.document))
    for effect in effects:
        for key, (value, unit) in effect.settings.items():
            _assign(document, key, value, unit)
    vehicle = vehicles.from_document(document, true.path)
    extra = [item for effect in effects for item in effect.terms]
    return replace(
        vehicle,
        terms=(*vehicle.terms, *(term for term, _ in extra)),
        parameters={**vehicle.parameters, **{term.name: dict(numbers) for term, numbers in extra}},
    )


def _choose(
    kind: Kind, names: Sequence[str] | None, rng: np.random.Generator, without: Collection[str]
) -> tuple[list[Any], tuple[str, str] | None]:
    """The effects' draws, and how an unknown one shows."""
    if kind == "null":
        return [], None
    if kind == "unknown":
        name = names[0] if names else str(rng.choice(list(UNKNOWN)))
        draw, channel, driver = UNKNOWN[name]
        return [draw], (channel, driver)
    many = 2 if kind == "pair" else 1
    while names is None:
        tried = [str(name) for name in rng.choice(list(EFFECTS), many, replace=False)]
        probe = [EFFECTS[name](vehicles.load("raptor90"), np.random.default_rng(0), 1.0) for name in tried]
        if not any(topic in without for effect in probe for topic in effect.needs):
            names = tried
    return [EFFECTS[name] for name in names], None


def _assign(document: dict[str, Any], dotted: str, value: float, unit: str) -> None:
    """Set a number of a vehicle file; `a.b.1` an element of a vector."""
    *way, last = dotted.split(".")
    if last.isdecimal():
        *way, last_name = way
        entry = _table(document, way)[last_name]
        entry["value"] = [value if i == int(last) else v for i, v in enumerate(entry["value"])]
        entry["unit"] = unit
        return
    table = _table(document, way)
    table[last] = {**table.get(last, {}), "value": value, "unit": unit}
    table[last].pop("tolerance", None)


def _table(document: dict[str, Any], way: Sequence[str]) -> dict[str, Any]:
    for part in way:
        document = document.setdefault(part, {})
    return document


def _wind_std(vehicle: Vehicle) -> float:
    return float(vehicle.document["environment"]["wind_std"]["value"])


def _stressed(world: World) -> list[Fault]:
    """What a bad day does to any vehicle; needs no cause to be named."""
    world.wind.scale *= 2.0
    faults: list[Fault] = [
        Spike(topic=topic, column=column, size=size, share=0.02) for topic, (column, size) in OUTLIERS.items()
    ]
    faults += [Dropout(topic=topic, share=LOST) for topic in OUTLIERS]
    return [*faults, White("mag", ("mx", "my", "mz"), NOISY)]

"""What the injector needs of each kind of vehicle: how it is drawn, what can be wrong with it, how it flies."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from flightlog.recorder import Recorder
from flightlog.topics import Column
from sim import vehicle as vehicles
from sim.kinds import load
from sim.multirotor import Multirotor
from sim.rig import Rig
from tests.blind import draws, flights, quad_effects, quad_flights, rig_effects, rig_flights
from tests.blind.effects import EFFECTS, UNKNOWN, Effect
from tests.blind.flights import write_flight_json
from tests.blind.plans import PLANS, weather

Rng = np.random.Generator
HELD_FOR = 30.0  # [s] that a pilot must hold a vehicle
SMALLER = 0.85  # of an effect, where the pilot could not hold it
HERE = Path(__file__).parent / "vehicles"


class Kit(Protocol):
    """One kind of vehicle; a `craft` is what `draw` and `inject` hand on."""

    @property
    def effects(self) -> Mapping[str, Any]:
        """What can be wrong: draws by name."""
        ...

    @property
    def unknown(self) -> Mapping[str, tuple[Any, str, str]]:
        """What no catalogue holds: draw, channel, driver."""
        ...

    @property
    def plans(self) -> Sequence[str]:
        """Names."""
        ...

    def draw(self, rng: Rng) -> Any:
        """The vehicle as it may really be."""
        ...

    def effect(self, draw: Any, craft: Any, rng: Rng, share: float) -> Effect:
        """One thing that is wrong with it."""
        ...

    def inject(self, craft: Any, wrong: Sequence[Effect]) -> Any:
        """The vehicle with these in it."""
        ...

    def document(self, craft: Any) -> Mapping[str, Any]:
        """What flew, as the answer keeps it."""
        ...

    def fly(
        self, craft: Any, plan: str, duration_s: float, seed: int, folder: Path, wrong: Sequence[Effect],
        without: Collection[str], stress: bool,
    ) -> None:  # fmt: skip
        """Fly a plan drawn from `seed` and write what was measured."""
        ...


def file_of(name: str) -> str:
    """The vehicle file of a name: of this folder, else of the project."""
    own = HERE / f"{name}.toml"
    return str(own) if own.is_file() else name


def kit_of(name: str) -> Kit:
    """The kit for a nominal vehicle."""
    nominal = load(file_of(name))
    if isinstance(nominal, Multirotor):
        return QuadrotorKit(nominal)
    return RigKit(nominal) if isinstance(nominal, Rig) else HelicopterKit(nominal)


@dataclass(frozen=True, eq=False)
class HelicopterKit:
    """Flown by the simulator, with the project's pilot and navigator."""

    nominal: vehicles.Vehicle
    effects = EFFECTS
    unknown = UNKNOWN
    plans = tuple(PLANS)

    def draw(self, rng: Rng) -> vehicles.Vehicle:
        """See `Kit.draw`."""
        return draws.vehicle(self.nominal, rng)

    def effect(self, draw: Any, craft: vehicles.Vehicle, rng: Rng, share: float) -> Effect:
        """See `Kit.effect`."""
        found: Effect = draw(craft, rng, share)
        return found

    def inject(self, craft: vehicles.Vehicle, wrong: Sequence[Effect]) -> vehicles.Vehicle:
        """See `Kit.inject`."""
        return draws.injected(craft, wrong)

    def document(self, craft: vehicles.Vehicle) -> Mapping[str, Any]:
        """See `Kit.document`."""
        return craft.document

    def fly(
        self, craft: vehicles.Vehicle, plan: str, duration_s: float, seed: int, folder: Path, wrong: Sequence[Effect],
        without: Collection[str], stress: bool,
    ) -> None:  # fmt: skip
        """See `Kit.fly`."""
        rng = np.random.default_rng([seed, 21])
        drawn = PLANS[plan](rng, duration_s)
        air = weather(rng, float(self.nominal.document["environment"]["wind_std"]["value"]))
        tampering = [t for effect in wrong for t in effect.tampering] + ([flights.stressed] if stress else [])
        rows = flights.measured(drawn, craft, self.nominal, seed=seed, weather=air, tampering=tampering)
        flights.write(rows, folder, self.nominal.name, without)


@dataclass(frozen=True, eq=False)
class Numbers:
    """A multirotor or rig as it is."""

    numbers: Mapping[str, float]  # of its file, SI
    otherwise: Mapping[str, float]


class _ByNumbers:
    """What multirotors and rigs have in common."""

    nominal: Multirotor | Rig

    def draw(self, rng: Rng) -> Numbers:
        """See `Kit.draw`."""
        return Numbers(draws.numbers(self.nominal, rng), {})

    def effect(self, draw: Any, craft: Numbers, rng: Rng, share: float) -> Effect:
        """See `Kit.effect`."""
        found: Effect = draw(self.nominal, craft.numbers, rng, share)
        return found

    def inject(self, craft: Numbers, wrong: Sequence[Effect]) -> Numbers:
        """See `Kit.inject`."""
        numbers, otherwise = dict(craft.numbers), dict(craft.otherwise)
        for effect in wrong:
            numbers |= effect.numbers
            otherwise |= effect.otherwise
        return Numbers(numbers, otherwise)

    def document(self, craft: Numbers) -> Mapping[str, Any]:
        """See `Kit.document`."""
        return {"numbers": dict(craft.numbers), "otherwise": dict(craft.otherwise)}


@dataclass(frozen=True, eq=False)
class QuadrotorKit(_ByNumbers):
    """Flown by `quad_flights`."""

    nominal: Multirotor
    effects = quad_effects.EFFECTS
    unknown = quad_effects.UNKNOWN
    plans = quad_flights.NAMES

    def draw(self, rng: Rng) -> Numbers:
        """See `Kit.draw`; drawn again where the pilot cannot hold it."""
        for _ in range(draws.TRIES):
            found = super().draw(rng)
            if self._held(found, "turn"):
                return found
        raise RuntimeError(f"{self.nominal.path}: nothing that flies in {draws.TRIES} draws")

    def effect(self, draw: Any, craft: Numbers, rng: Rng, share: float) -> Effect:
        """See `Kit.effect`; less of it where the pilot cannot hold what there is."""
        for _ in range(draws.TRIES):
            found = super().effect(draw, craft, rng, share)
            if all(self._held(self.inject(craft, [found]), plan) for plan in quad_flights.NAMES):
                return found
            share *= SMALLER
        raise RuntimeError(f"{self.nominal.path}: {found.name} topples it in {draws.TRIES} draws")

    def _held(self, craft: Numbers, plan: str) -> bool:
        """Whether the pilot holds it through a plan."""
        trial = quad_flights.plan_of(plan, self.nominal, np.random.default_rng(0), HELD_FOR)
        try:
            quad_flights.fly(trial, self.nominal, craft.numbers, craft.otherwise, np.random.default_rng(1))
        except quad_flights.Toppled:
            return False
        return True

    def fly(
        self, craft: Numbers, plan: str, duration_s: float, seed: int, folder: Path, wrong: Sequence[Effect],
        without: Collection[str], stress: bool,
    ) -> None:  # fmt: skip
        """See `Kit.fly`."""
        rng = np.random.default_rng([seed, 21])
        drawn = quad_flights.plan_of(plan, self.nominal, rng, duration_s)
        today = replace(craft, numbers=self._today(craft.numbers, rng))
        columns = quad_flights.fly(drawn, self.nominal, today.numbers, today.otherwise, rng, stress)
        write(columns, folder, self.nominal.name, without)

    def _today(self, numbers: Mapping[str, float], rng: Rng) -> dict[str, float]:
        """As far as one flight differs from the next."""
        found = dict(numbers)
        found["terms.thrust.scale"] *= 1.0 + numbers["terms.repeatability.thrust"] * rng.standard_normal()
        for key in ("terms.cg_offset.x", "terms.cg_offset.y"):
            found[key] += numbers["terms.repeatability.cg"] * rng.standard_normal()
        found["terms.yaw_trim.arm"] += numbers["terms.repeatability.yaw"] * rng.standard_normal()
        return found


@dataclass(frozen=True, eq=False)
class RigKit(_ByNumbers):
    """Moved by `rig_flights`."""

    nominal: Rig
    effects = rig_effects.EFFECTS
    unknown = rig_effects.UNKNOWN
    plans = rig_flights.NAMES

    def fly(
        self, craft: Numbers, plan: str, duration_s: float, seed: int, folder: Path, wrong: Sequence[Effect],
        without: Collection[str], stress: bool,
    ) -> None:  # fmt: skip
        """See `Kit.fly`."""
        rng = np.random.default_rng([seed, 21])
        course = rig_flights.plan_of(plan, rng, duration_s)
        columns = rig_flights.fly(course, self.nominal, craft.numbers, craft.otherwise, rng, stress)
        units = dict.fromkeys(self.nominal.joints, "rad") | dict(self.nominal.units)
        write(columns, folder, self.nominal.name, without, units)


def write(
    columns: Mapping[str, Mapping[str, Any]], folder: Path, vehicle: str, without: Collection[str] = (),
    units: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """A flight folder with measured/ alone; units: of columns that the log does not know by name."""
    with Recorder(folder) as recorder:
        for topic, of in columns.items():
            if topic not in without:
                writer = recorder.topic(
                    "measured", topic, [Column(n, units[n]) if units and n in units else n for n in of]
                )
                for row in zip(*(values.tolist() for values in of.values()), strict=True):
                    writer.append(row)
        write_flight_json(folder, vehicle)

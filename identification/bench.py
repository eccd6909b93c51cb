"""What every kind of vehicle offers to the diagnosis: flights whose innovations and signatures can be had."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from flightlog.tables import Table
from identification.causes.contract import Cause
from identification.stack import Rows
from sim.vehicle import Vehicle


@dataclass(frozen=True)
class Channel:
    """What some rows are about."""

    name: str  # force_z, rotor.speed, baro.altitude, joints.yaw, ...
    unit: str


@dataclass(frozen=True)
class Baseline:
    """How well the nominal model passes on these flights once everything nameable was taken out."""

    certified: bool
    reason: str | None
    noise: Mapping[str, tuple[float, str]] = field(default_factory=dict)  # by channel: value and unit
    environment: Mapping[str, float] = field(default_factory=dict)


class Bench(Protocol):
    """Flights of one vehicle, prepared: one class a kind of vehicle.

    A bench may also have: `threshold` [nats] of its own, and `beside`, of a further cause beside the first;
    `start(names)`, where the fit of a set begins; `renew(at)`, which takes slopes anew about `at`, or those of the
    beginning for None; `apart`, true where flights may be taken side by side; `cheap`, true where slopes cost nothing;
    `anew(causes, at, std)`, the same flights prepared about what these causes come to, and `settled(causes, at, std)`,
    whether they were; `widened`, by how much errors are larger than what is linear about the fit says.
    """

    vehicle: Vehicle
    names: Sequence[str]  # of the flights
    causes: Sequence[Cause]  # that these flights could show
    not_testable: Mapping[str, Sequence[str]]  # cause -> topics that it needs
    channels: Mapping[int, Channel]  # by the numbers in Rows.channel
    nominal: Mapping[str, float]  # by parameter key, SI
    units: Mapping[str, str]
    tolerances: Mapping[str, float]  # by parameter key: what may be without any cause
    spreads: Mapping[str, float]  # by parameter key: how large a cause may make it
    baseline: Baseline

    def rows(self, flight: int, changes: Mapping[str, float], fresh: Collection[str] = ()) -> Rows:
        """One flight with some numbers (absolute, SI) changed, and the signatures of all parameters.

        The residual is always that of the changed model. Signatures may be those of an earlier call; those of `fresh`
        are taken anew about the changes.
        """
        ...

    def bounded(self, key: str, value: float) -> float:
        """A value brought into the range that makes sense for a parameter."""
        ...


def widened(bench: Bench) -> float:
    """What standard deviations of causes' numbers are multiplied by."""
    return float(getattr(bench, "widened", 1.0))


class OpenBench(Protocol):
    """Prepares flights for one kind of vehicle."""

    def __call__(
        self, logs: Mapping[str, Mapping[str, Table]], vehicle: Vehicle, like: Bench | None = None
    ) -> Bench:
        """The flights by name; with the noise of another bench where they are to be judged `like` it.

        Raises:
            UserError: a log that cannot carry a diagnosis.
        """
        ...

"""What a diagnosis answers: plain frozen records, as `helideck diagnose --json` prints them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from identification.causes.contract import Where


@dataclass(frozen=True)
class Fitted:
    """A parameter of an asserted cause; `value` is what stands in the extended file."""

    value: float
    nominal: float
    std: float
    ci95: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class CauseGain:
    """What a cause is worth on data that it was not fitted to, in the channel where it is worth most."""

    channel: str
    rmse_reduction: float  # share of the root mean square
    share_of_explainable: float  # of the excess over the noise floor


@dataclass(frozen=True)
class Asserted:
    """A cause that is asserted, or a class that the data cannot split under its most probable member's name."""

    name: str
    where: Where
    probability: float  # of the class
    parameters: Mapping[str, Fitted]
    gain: CauseGain | None
    confusable_with: Sequence[str] = ()
    split_by: str | None = None
    topic: str | None = None  # the device, joint or input that it is about, where there is one cause for each


@dataclass(frozen=True)
class LostBecause:
    """Where the winner explains what this candidate does not."""

    channel: str
    region: str


@dataclass(frozen=True)
class Candidate:
    """Everything that was scored."""

    name: str
    log_bayes_factor: float
    probability: float
    lost_because: LostBecause | None


@dataclass(frozen=True)
class ChannelError:
    """One channel before and after the extension."""

    channel: str
    unit: str
    rmse_before: float
    rmse_after: float
    noise_floor: float
    heldout: bool


@dataclass(frozen=True)
class Curve:
    """What a channel is off by over what it depends on."""

    x: Sequence[float]
    x_unit: str
    value: Sequence[float]  # what it is off by everywhere can hardly be told from a bias
    std: Sequence[float]
    unit: str


@dataclass(frozen=True)
class Alternative:
    """Another place at which an effect would explain nearly as much."""

    channel: str
    driver: str
    nats: float


@dataclass(frozen=True)
class Unexplained:
    """Structure that no named cause takes out."""

    channel: str
    share_of_variance: float
    depends_on: Sequence[str]  # best first; the others cannot be told from it
    form: str | None
    nats: float = 0.0  # log evidence over no such effect
    alternatives: Sequence[Alternative] = ()
    curve: Curve | None = None


@dataclass(frozen=True)
class NotTestable:
    """A cause that these logs cannot show."""

    name: str
    needs: Sequence[str]


@dataclass(frozen=True)
class Number:
    """A value with its unit."""

    value: float
    unit: str


@dataclass(frozen=True)
class BaselineReport:
    """Whether the nominal model may judge at all."""

    certified: bool
    reason: str | None
    noise: Mapping[str, Number]
    environment: Mapping[str, float]


@dataclass(frozen=True)
class Prediction:
    """Free runs of one channel."""

    channel: str
    horizon_s: float
    every_s: float
    rmse_nominal: float
    rmse_refitted: float
    rmse_extended: float
    heldout: bool


@dataclass(frozen=True)
class Verdict:
    """The whole answer."""

    vehicle: str | None
    logs: Sequence[str]
    baseline: BaselineReport
    channels: Sequence[ChannelError]
    causes: Sequence[Asserted]
    candidates: Sequence[Candidate]
    unexplained: Sequence[Unexplained]
    not_testable: Sequence[NotTestable]
    predictions: Sequence[Prediction] = ()
    extended_vehicle: str | None = None
    notes: Sequence[str] = field(default=())  # what is odd about the logs, in sentences

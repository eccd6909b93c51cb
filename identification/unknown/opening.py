"""The bank of effects that a bench can show."""

from collections.abc import Mapping

from identification.bench import Bench
from identification.helicopter import HelicopterBench
from identification.unknown.bank import Bank
from identification.unknown.helicopter import HelicopterBank
from identification.unknown.null import HELICOPTER


def open_bank(bench: Bench) -> Bank | None:
    """Signatures of unknown effects on these flights; None for a bench that has none."""
    if isinstance(bench, HelicopterBench):
        return HelicopterBank(bench)
    made: Bank | None = getattr(bench, "bank", lambda: None)()
    return made


def limits(bench: Bench) -> Mapping[str, float]:
    """[nats] by group of channels."""
    return HELICOPTER if isinstance(bench, HelicopterBench) else {}

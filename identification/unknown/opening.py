"""The bank of effects that a bench can show."""

from collections.abc import Mapping

from identification.helicopter import HelicopterBench
from identification.multirotor.bench import MultirotorBench
from identification.rig import RigBench
from identification.unknown.bank import Bank
from identification.unknown.helicopter import HelicopterBank
from identification.unknown.multirotor import MultirotorBank
from identification.unknown.null import HELICOPTER, MULTIROTOR
from identification.unknown.rig import RigBank


def open_bank(bench: object) -> Bank | None:
    """Signatures of unknown effects on these flights; None for a bench that has none."""
    if isinstance(bench, HelicopterBench):
        return HelicopterBank(bench)
    if isinstance(bench, MultirotorBench):
        return MultirotorBank(bench)
    if isinstance(bench, RigBench):
        return RigBank(bench)
    made: Bank | None = getattr(bench, "bank", lambda: None)()
    return made


def limits(bench: object) -> Mapping[str, float]:
    """[nats] by group of channels."""
    if isinstance(bench, HelicopterBench):
        return {group: bench.caution * limit for group, limit in HELICOPTER.items()}
    return MULTIROTOR if isinstance(bench, MultirotorBench) else {}

"""The published experiments; one is one module here, see `contract`."""

from importlib import import_module
from typing import cast

from scenarios.experiments.contract import Experiment as Experiment

EXPERIMENTS: tuple[str, ...] = (  # modules of this package in the order of the report
    "lei2012_desk",
    "lei2012_stairs",
    "lei2012_hover",
    "lei2012_landing",
    "wu2019_calibration",
    "wu2019_readings",
    "wu2019_landing",
    "wu2019_refuelling",
    "zeng_hover",
    "huang_sequences",
    "huang_dive",
    "huang_hold",
    "consistency",
)


def experiments(system: str | None = None) -> list[Experiment]:
    """Those of one system (and those of all systems), or all."""
    found = [cast(Experiment, import_module(f"{__name__}.{name}")) for name in EXPERIMENTS]
    return [item for item in found if system in (None, item.SYSTEM)]

"""`helideck estimate`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from helideck.cli.document import emit


@dataclass(frozen=True)
class Estimate:
    """Run a navigator over a measured log, with what sensors there are.

    Reads flight folders, CSV (with a mapping), PX4 ULog and ArduPilot DataFlash. Writes estimate.parquet, in the log's
    own clock. Errors are given where the log has a reference, or is a simulated flight.

    Example: helideck estimate flights/landing-0 --json
    """

    log: tyro.conf.Positional[Path]
    """Flight folder, folder of CSV files, CSV, ULog (.ulg) or DataFlash (.BIN, .log)."""

    vehicle: Path | None = None
    """Vehicle file of what logged it: name or file; by default a flight's own, else sensors of usual kinds."""

    mapping: Path | None = None
    """What a CSV's columns are: file, or a name in assets/mappings; by default LOG.mapping.toml, if it is there."""

    navigator: str = "helideck"
    """By name (`helideck list navigators`)."""

    variant: Literal["helideck", "published"] = "helideck"
    """The best made of its idea, or the paper as published."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder for estimate.parquet; by default estimates/LOG, then -2, -3."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Estimate."""
        from helideck.estimation import estimate, new_folder, write
        from helideck.report import print_estimation
        from helideck.show import share_progress

        with share_progress(self.log.name) as show:
            found = estimate(
                self.log, vehicle=self.vehicle, mapping=self.mapping, navigator=self.navigator, variant=self.variant,
                progress=lambda done, whole: show(done, whole, f"{done:.0f} of {whole:.0f} s"),
            )  # fmt: skip
        file = write(found, self.output if self.output is not None else new_folder(self.log))
        if self.json:
            emit(found.document(file))
        else:
            print_estimation(found.document(file))
        return 0

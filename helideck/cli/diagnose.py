"""`helideck diagnose`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from flightlog.errors import UserError
from helideck.cli.document import emit

Logs = Annotated[tuple[Path, ...], tyro.conf.arg(metavar="LOG...")]


@dataclass(frozen=True)
class Diagnose:
    """Say what the simulation gets wrong on measured flights, why, and what a better model is worth.

    Reads flight folders, CSV (with a mapping), PX4 ULog and ArduPilot DataFlash. Writes report.html, report.md,
    replay.rrd, diagnosis.json and, where something is wrong, extended.toml, which `helideck land --vehicle` flies.
    Exit code 1 where the model cannot judge these flights.

    Example: helideck diagnose flights/landing-0 flights/landing-1 --vehicle raptor90
    """

    logs: tyro.conf.Positional[Logs]
    """Flight folders, folders of CSV files, CSV, ULog (.ulg) or DataFlash (.BIN, .log)."""

    vehicle: Path | None = None
    """Vehicle file of what flew: name or file; without one, sensors are judged against each other."""

    normal: Logs = ()
    """Flights known to be good: the vehicle's numbers are fitted to them first, and written as nominal.toml."""

    heldout: Logs = ()
    """Flights used for the gain alone; by default each flight in turn, or contiguous fifths of a single one."""

    mapping: Path | None = None
    """What a CSV's columns are: file, or a name in assets/mappings; by default LOG.mapping.toml, if it is there."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder of the report; by default diagnoses/LOG, then -2, -3."""

    fly: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Landings flown with the vehicle as it was and as extended, in the scenario of the logs; 0: none."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Diagnose."""
        from pydantic_core import to_json

        from helideck.cli.document import plain
        from helideck.diagnosing import diagnose, new_folder
        from helideck.show import share_progress
        from identification.report import sentence, write_report

        if not self.logs:
            raise UserError("no log is named; `helideck diagnose LOG --vehicle FILE`")
        if self.fly < 0:
            raise UserError(f"--fly {self.fly}: none below zero")
        folder = self.output if self.output is not None else new_folder(self.logs[0])
        with share_progress("diagnosis") as progress:
            answer = diagnose(
                self.logs, folder=folder, vehicle=self.vehicle, normal=self.normal, heldout=self.heldout,
                mapping=self.mapping, landings=self.fly, progress=progress,
            )  # fmt: skip
            progress(5, 6, "writing the report")
            write_report(answer.findings, folder)
        document = answer.document()
        (folder / "diagnosis.json").write_bytes(to_json(document, indent=1, inf_nan_mode="null", fallback=plain))
        if self.json:
            emit(document)
        else:
            print(sentence(answer.verdict))
            print(f"{folder / 'report.html'}", file=sys.stderr)
        return 0 if answer.verdict.baseline.certified else 1

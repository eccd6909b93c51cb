"""`helideck predict`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from helideck.cli.document import emit


@dataclass(frozen=True)
class Predict:
    """Run a vehicle's model along a log from its inputs alone, restarted from the measured state now and then.

    Tells by how much each channel went astray over the horizon, and by how much holding the last value did.

    Example: helideck predict lab.csv --mapping lab_helicopter --vehicle lab_helicopter --json
    """

    logs: tyro.conf.Positional[Annotated[tuple[Path, ...], tyro.conf.arg(name="log")]]
    """Flight folder, folder of CSV files, CSV, ULog (.ulg) or DataFlash (.BIN, .log); one or several."""

    vehicle: Path
    """Vehicle file: name or file."""

    mapping: Path | None = None
    """What a CSV's columns are: file, or a name in assets/mappings; by default LOG.mapping.toml, if it is there."""

    horizon: float = 10.0
    """Length of each run [s]."""

    every: float = 2.5
    """A run begins every so many seconds."""

    start: float | None = None
    """Leave out what was logged before this time [s, the log's clock]."""

    end: float | None = None
    """Leave out what was logged from this time on [s, the log's clock]."""

    json: bool = False
    """One JSON document on stdout: an object, or a list where there are several logs."""

    def run(self) -> int:
        """Predict."""
        from helideck.predicting import predict_log, print_predictions

        found = [
            predict_log(log, self.vehicle, self.mapping, self.horizon, self.every, (self.start, self.end))
            for log in self.logs
        ]
        if self.json:
            emit(found[0] if len(found) == 1 else found)
        else:
            print_predictions(found)
        return 0

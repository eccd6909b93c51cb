"""`helideck land`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from flightlog.errors import UserError
from helideck.cli.document import emit

Settings = Annotated[tuple[str, ...], tyro.conf.arg(metavar="A.B=VALUE")]


@dataclass(frozen=True)
class Land:
    """Fly a scenario, write the flight folder and print what it was like.

    Exit code 0 where the scenario's goal was met, 1 where it was not, 2 for unusable input.

    Example: helideck land landing --seed 3 --set weather.wind_m_s=4
    """

    scenario: tyro.conf.Positional[str] = "landing"
    """Name (`helideck list scenarios`) or TOML file."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder of the flight; by default flights/SCENARIO-SEED, then -2, -3."""

    seed: str = "0"
    """All randomness of the flight; a run of a campaign is CAMPAIGN:RUN."""

    vehicle: Path | None = None
    """Vehicle file of what flies."""

    aboard: Path | None = None
    """Vehicle file that pilot and navigator were designed for; by default the scenario's."""

    set: tyro.conf.UseAppendAction[Settings] = ()
    """Overrides a key of the scenario, or `vehicle.terms.X.y` of what flies; may be repeated."""

    no_cameras: bool = False
    """Fly on the pad camera's error model instead of rendered pictures."""

    frames: bool = False
    """Keep the pictures in the flight folder."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Fly."""
        from helideck.flying import flight_folder, parse_seed, parse_settings, prepare
        from helideck.report import as_document, print_summary
        from helideck.show import flight_progress
        from scenarios.flight import fly
        from sim.cameras import RenderError
        from sim.divergence import SimulationDiverged

        if self.output is not None and (self.output.exists() or self.output.is_symlink()):
            raise UserError(f"{self.output}: exists already; name a folder that is new")
        if self.frames and self.no_cameras:
            raise UserError("--frames keeps rendered pictures: it does not go with --no-cameras")
        seed = parse_seed(self.seed)
        prepared = prepare(self.scenario, parse_settings(self.set), vehicle=self.vehicle, aboard=self.aboard)
        folder = self.output if self.output is not None else flight_folder(prepared.name, seed)
        try:
            with flight_progress(prepared.name, prepared.scenario.duration_s) as progress:
                flight = fly(
                    prepared.scenario,
                    seed=seed,
                    folder=folder,
                    cameras=not self.no_cameras,
                    vehicle=prepared.vehicle,
                    aboard=prepared.aboard,
                    keep_frames=self.frames,
                    name=prepared.name,
                    progress=progress,
                )
        except (SimulationDiverged, RenderError) as failure:
            return self._broken_off(folder, str(failure), 1)
        except KeyboardInterrupt:
            if not (folder / "flight.json").is_file():
                raise  # before take-off
            return self._broken_off(folder, "interrupted", 130)
        if self.json:
            emit(as_document(flight))
        else:
            print_summary(flight, sys.stdout)
        return 0 if flight.summary.success else 1

    def _broken_off(self, folder: Path, reason: str, code: int) -> int:
        """Say what ended the flight and where its log is; the exit code."""
        from flightlog.flight_json import read_flight_json
        from helideck.report import as_document

        print(f"helideck: {reason}; the log up to there is in {folder}", file=sys.stderr)
        if self.json:
            figures = read_flight_json(folder).get("summary")
            emit(as_document(figures) if figures is not None else {"error": reason})
        return code

"""`helideck campaign`."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from helideck.cli.document import emit


@dataclass(frozen=True)
class Campaign:
    """Fly a scenario many times, each time with another seed, without cameras unless told otherwise.

    A campaign that was broken off goes on where it stopped. Writes runs.parquet, one row a run.

    Example: helideck campaign landing --runs 200
    """

    scenario: tyro.conf.Positional[str]
    """Name (`helideck list scenarios`) or TOML file."""

    runs: int
    """How many flights in all."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder of the campaign; by default campaigns/SCENARIO-SEED."""

    seed: int = 0
    """The campaign's; run k flies with the seed SEED:k."""

    workers: int = 0
    """Processes; 0: one a core."""

    vehicle: Path | None = None
    """Vehicle file of what flies."""

    aboard: Path | None = None
    """Vehicle file that pilot and navigator were designed for; by default the scenario's."""

    set: tyro.conf.UseAppendAction[Annotated[tuple[str, ...], tyro.conf.arg(metavar="A.B=VALUE")]] = ()
    """Overrides a key of the scenario, or `vehicle.terms.X.y` of what flies; may be repeated."""

    cameras: bool = False
    """Render the pictures: slower than real time when several fly at once."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Fly them all."""
        import joblib

        from flightlog.errors import UserError
        from helideck.flying import parse_settings
        from helideck.report import print_campaign
        from helideck.show import campaign_progress
        from scenarios import campaign
        from scenarios.load import find, load, split_overrides

        if self.runs < 1 or self.seed < 0 or self.workers < 0:
            raise UserError(
                f"--runs {self.runs} --seed {self.seed} --workers {self.workers}: at least one run, none below zero"
            )
        own, changed = split_overrides(parse_settings(self.set))
        scenario = load(self.scenario, own)
        name = find(self.scenario).stem
        plan = campaign.Campaign(
            name=name,
            scenario=scenario,
            seed=self.seed,
            vehicle=self.vehicle or scenario.vehicle,
            vehicle_settings=changed,
            aboard=self.aboard or scenario.vehicle,
            cameras=self.cameras,
        )
        folder = self.output or Path("campaigns") / f"{name}-{self.seed}"
        with campaign_progress(name) as progress:
            table = campaign.run_campaign(
                plan, self.runs, folder, workers=self.workers or joblib.cpu_count(), progress=progress
            )
        summary = campaign.summarise(table)
        if self.json:
            emit({"scenario": name, "seed": self.seed, **asdict(summary), "folder": str(folder)})
        else:
            print_campaign(name, summary, folder)
        return 0

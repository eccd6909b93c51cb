"""`helideck reproduce`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from flightlog.errors import UserError
from helideck.cli.document import emit


@dataclass(frozen=True)
class Reproduce:
    """Run the published experiments again: the paper's figure, a faithful build's and ours, side by side.

    Writes report.html, report.md and report.json. Exit code 1 where an experiment could not be run, or where a figure
    of ours misses its bar.

    Example: helideck reproduce lei2012 --quick
    """

    system: tyro.conf.Positional[Literal["all", "lei2012", "wu2019", "zeng", "huang"]] = "all"
    """Whose experiments."""

    quick: bool = False
    """Fewer flights and frames: under three minutes, and rough."""

    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Folder of the report; by default reports/SYSTEM."""

    workers: int = 0
    """Processes; 0: one a core."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Run, write the report, say what came out."""
        import time

        import joblib
        from pydantic_core import to_json

        from helideck.cli.document import plain
        from helideck.reproduction import Reproduction, as_document, write_html, write_markdown
        from helideck.show import share_progress
        from scenarios.experiments import experiments
        from scenarios.experiments.runner import run
        from scenarios.recording import versions

        if self.workers < 0:
            raise UserError(f"--workers {self.workers}: none below zero")
        folder = self.output or Path("reports") / self.system
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(f"{folder}: cannot be made: {error.strerror}; name a folder that can") from error
        effort: Literal["quick", "full"] = "quick" if self.quick else "full"
        chosen = experiments(None if self.system == "all" else self.system)
        started = time.perf_counter()
        with share_progress("experiments") as progress:
            results = run(chosen, effort, workers=self.workers or joblib.cpu_count(), progress=progress)
        done = Reproduction(results, effort, time.perf_counter() - started, versions())
        document = as_document(done)
        (folder / "report.json").write_bytes(to_json(document, indent=1, inf_nan_mode="null", fallback=plain))
        write_markdown(done, folder / "report.md")
        write_html(done, folder / "report.html")
        if self.json:
            emit(document)
        else:
            from helideck.report import print_reproduction

            print_reproduction(done, folder / "report.html", sys.stdout)
        return 1 if done.failed or done.short else 0

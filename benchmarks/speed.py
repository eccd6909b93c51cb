"""How fast a landing flies, where the time goes and what memory it takes, with cameras and without.

python benchmarks/speed.py [--runs 3] [--json]

Real-time factors are taken from the first physics step to the end of the flight; what comes before is startup_s.
Memory is the proportional set size of all processes, the largest seen.
"""

import json
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import psutil
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from estimators.eyes import FrontEnd
from estimators.navigator import Navigator
from estimators.navigators.helideck import look
from estimators.vision.sighting import PadPrediction, PadSighting
from flightlog.equipment import Equipment
from scenarios.flight import Flight, fly
from scenarios.load import load
from scenarios.schema import Scenario

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """How often to fly."""

    runs: int = 3
    json: bool = False


class Memory(threading.Thread):
    """Watches this process and its children."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.largest = 0
        self._done = threading.Event()

    def run(self) -> None:
        me = psutil.Process()
        while not self._done.wait(0.5):
            total = 0
            for process in (me, *me.children(recursive=True)):
                try:
                    total += process.memory_full_info().pss
                except psutil.Error:
                    continue
            self.largest = max(self.largest, total)

    def stop(self) -> int:
        self._done.set()
        self.join()
        return self.largest


class TimedFrontEnd:
    """The front end, and the time that it takes."""

    def __init__(self, front_end: FrontEnd) -> None:
        self.seconds = 0.0
        self._front_end = front_end

    def see(self, image: NDArray[np.uint8], attitude: Floats, prediction: PadPrediction | None) -> PadSighting | None:
        begin = time.perf_counter()
        seen = self._front_end.see(image, attitude, prediction)
        self.seconds += time.perf_counter() - begin
        return seen


def fly_once(cameras: bool, seed: int) -> tuple[Flight, int]:
    """One landing, and the largest memory [bytes] of this process and the renderer's."""
    fly(load("landing", {"duration_s": 1.0}), cameras=False)  # compiled code is loaded, as in any later flight
    memory = Memory()
    memory.start()
    timed: list[TimedFrontEnd] = []

    def navigator(equipment: Equipment, scenario: Scenario, sees: bool) -> Navigator:
        if not sees:
            return Navigator(equipment)
        eyes = look(equipment, scenario.variant)
        assert eyes.pad is not None
        timed.append(TimedFrontEnd(eyes.pad))
        return Navigator(equipment, replace(eyes, pad=timed[0]))

    with tempfile.TemporaryDirectory() as folder:
        # a landing without cameras is what campaigns fly: nothing is written
        place = Path(folder) / "flight" if cameras else None
        flight = fly(load("landing"), seed=seed, cameras=cameras, folder=place, navigator=navigator)
    vision = timed[0].seconds / flight.wall_s if timed else 0.0
    shares = flight.shares | {"vision of the pad": vision, "filters, horizon": flight.shares["navigator"] - vision}
    del shares["navigator"]
    return replace(flight, shares=shares), memory.stop()


def measure(cameras: bool, runs: int) -> dict[str, object]:
    # each in a process of its own, as `helideck land` flies: what one leaves behind is not the next one's
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context, max_tasks_per_child=1) as pool:
        flown = list(pool.map(fly_once, [cameras] * runs, range(runs)))
    flights = sorted((flight for flight, _ in flown), key=lambda flight: flight.real_time_factor)
    middle = flights[len(flights) // 2]
    return {
        "real_time_factor": {"least": flights[0].real_time_factor, "median": middle.real_time_factor},
        "startup_s": middle.startup_s,
        "shares": middle.shares,
        "memory_bytes": max(memory for _, memory in flown),
        "renderer": middle.renderer,
        "landed": sum(flight.summary.landed for flight in flights),
    }


def main() -> int:
    options = tyro.cli(Options, description=__doc__)
    report = {"cores": os.cpu_count(), "rendered": measure(True, options.runs), "blind": measure(False, options.runs)}
    if options.json:
        print(json.dumps(report, indent=2))
        return 0
    console = Console(highlight=False)
    table = Table(title=f"landing, {options.runs} flights each, {os.cpu_count()} cores", title_justify="left")
    for name in ("", "all three cameras", "without cameras"):
        table.add_column(name)
    both = (report["rendered"], report["blind"])
    table.add_row("times real time, median", *(f"{r['real_time_factor']['median']:.1f}" for r in both))
    table.add_row("times real time, least", *(f"{r['real_time_factor']['least']:.1f}" for r in both))
    table.add_row("to start [s]", *(f"{r['startup_s']:.1f}" for r in both))
    table.add_row("memory [MiB]", *(f"{r['memory_bytes'] / 2**20:.0f}" for r in both))
    for name in both[0]["shares"]:
        table.add_row(f"share of {name}", *(f"{100 * r['shares'].get(name, 0.0):.0f} %" for r in both))
    table.add_row("renderer", *(r["renderer"] or "none" for r in both))
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())

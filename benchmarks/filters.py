"""What the filters cost and how good they are: one flight's measurements, recorded and fed to fresh navigators.

python benchmarks/filters.py [--scenario landing] [--seed 0] [--json]

Times are processor time of this thread for one call of `Navigator.update` (250 Hz), the best of several passes; a
topic's share is what a call costs less without it. Errors are against the truth, from 3 s on.
"""

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from estimators.navigator import Navigator
from flightlog.equipment import Equipment
from flightlog.rotations import angles
from flightlog.signals import (
    BaroSample,
    GpsSample,
    MagSample,
    Measurement,
    PadSample,
    RotorSample,
    SonarSample,
    StateEstimate,
)
from scenarios import flight as flights
from scenarios.load import load
from scenarios.schema import Scenario

TOPICS = {
    "pad": PadSample,
    "gps": GpsSample,
    "baro": BaroSample,
    "sonar": SonarSample,
    "mag": MagSample,
    "rotor": RotorSample,
}
PASSES = 5
SETTLED = 3.0  # [s]


@dataclass(frozen=True)
class Options:
    """Which flight."""

    scenario: str = "landing"
    seed: int = 0
    json: bool = False


@dataclass
class Tape:
    """A navigator that keeps what it is given and what it says."""

    navigator: Navigator
    equipment: Equipment
    updates: list[list[Measurement]] = field(default_factory=list)
    states: list[StateEstimate] = field(default_factory=list)
    detections: Sequence[Measurement] = ()
    overlays: dict[str, Sequence[np.ndarray]] = field(default_factory=dict)

    def update(self, measurements: Sequence[Measurement]) -> StateEstimate:
        self.updates.append(list(measurements))
        self.states.append(self.navigator.update(measurements))
        return self.states[-1]


def cost(equipment: Equipment, updates: list[list[Measurement]]) -> float:
    """Microseconds a call."""
    best = np.inf
    for _ in range(PASSES):
        navigator = Navigator(equipment)
        begin = time.thread_time()
        for update in updates:
            navigator.update(update)
        best = min(best, (time.thread_time() - begin) / len(updates))
    return 1e6 * best


def errors(tape: Tape, truth: np.ndarray) -> dict[str, list[float]]:
    """RMS of position [m], velocity [m/s] and angles [deg]."""
    late = [i for i, s in enumerate(tape.states) if s.t >= SETTLED]
    found = np.array([[*s.position, *s.velocity, s.roll, s.pitch, s.heading] for s in tape.states])[late]
    off = found - truth[late]
    off[:, 8] = (off[:, 8] + np.pi) % (2 * np.pi) - np.pi
    rms = np.sqrt(np.mean(off**2, axis=0))
    return {
        "position_m": rms[:3].tolist(), "velocity_m_s": rms[3:6].tolist(),
        "roll_pitch_heading_deg": np.degrees(rms[6:]).tolist(),
    }  # fmt: skip


def main(options: Options) -> int:
    tapes: list[Tape] = []
    truth: list[list[float]] = []

    def record(equipment: Equipment, scenario: Scenario, sees: bool) -> Tape:
        tapes.append(Tape(Navigator(equipment), equipment))
        return tapes[-1]

    class Onlooker(flights.Observer):
        def watch(self, world, *rest) -> None:
            if tapes and len(truth) < len(tapes[-1].updates):
                t = world.truth
                truth.append([*t.position, *t.velocity, *angles(t.quaternion)])
            super().watch(world, *rest)

    flights.Observer = Onlooker
    flights.fly(load(options.scenario), seed=options.seed, cameras=False, navigator=record)
    tape = max(tapes, key=lambda one: len(one.updates))
    whole = cost(tape.equipment, tape.updates)
    shares = {
        topic: whole - cost(tape.equipment, [[s for s in update if type(s) is not kind] for update in tape.updates])
        for topic, kind in TOPICS.items()
    }
    found = errors(tape, np.array(truth)[-len(tape.states) :])
    result = {
        "scenario": options.scenario, "seed": options.seed, "calls": len(tape.updates), "us_per_call": whole,
        "us_by_topic": shares, "rms": found, "rejected": dict(tape.navigator.rejected),
    }  # fmt: skip
    if options.json:
        print(json.dumps(result))
        return 0
    table = Table("", "us a call", title=f"{options.scenario}, seed {options.seed}: {len(tape.updates)} calls")
    table.add_row("all", f"{whole:.1f}")
    for topic, value in shares.items():
        table.add_row(f"of it {topic}", f"{value:.1f}")
    console = Console()
    console.print(table)
    for name, values in found.items():
        console.print(f"rms {name}: " + ", ".join(f"{value:.3f}" for value in values))
    return 0


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))

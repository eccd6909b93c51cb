"""Gains and stability margins of the pilot on the linearised Raptor-90, written to docs/controllers.md.

python benchmarks/margins.py [--check] [--draws 6]
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

import controllers.altitude
import controllers.attitude
import controllers.governor
import controllers.heading
import controllers.position
from controllers.gains import Gains, design
from controllers.margins import REQUIRED_GAIN_DB, REQUIRED_PHASE_DEG, Margins, margins
from controllers.plant import LinearPlant
from flightlog.atmosphere import SURFACE_PRESSURE, SURFACE_TEMPERATURE
from flightlog.units import to_si
from scenarios.crew import plant_of
from sim import vehicle as vehicles

DOCUMENT = Path(__file__).parents[1] / "docs" / "controllers.md"
SEED = 20


def drawn_plants(count: int) -> list[LinearPlant]:
    """Plants of vehicles whose terms' numbers are drawn from what the vehicle file declares its maker not to know."""
    nominal = vehicles.load("raptor90")
    rng = np.random.default_rng(SEED)
    plants = []
    for _ in range(count):
        numbers = {term: dict(values) for term, values in nominal.parameters.items()}
        for term in nominal.terms:
            for parameter in term.parameters:
                written = nominal.document["terms"][term.name].get(parameter.name, {})
                if written.get("tolerance"):
                    spread = to_si(written["tolerance"], written["unit"], parameter.unit)
                    value = numbers[term.name][parameter.name] + spread * rng.standard_normal()
                    numbers[term.name][parameter.name] = min(max(value, parameter.low), parameter.high)
        drawn = replace(nominal, parameters=numbers)
        plants.append(plant_of(drawn, SURFACE_PRESSURE, SURFACE_TEMPERATURE))
    return plants


def worst(found: list[list[Margins]]) -> list[Margins]:
    """By actuator, the smallest of each margin."""
    return [
        Margins(
            same[0].actuator,
            *(min(getattr(m, name) for m in same) for name in ("gain_up_db", "gain_down_db", "phase_deg", "delay")),
            max(m.crossover for m in same),
            min(m.disk for m in same),
        )
        for same in zip(*found, strict=True)
    ]


def table(found: list[Margins]) -> str:
    """Margins as a table of Markdown."""
    lines = [
        "| broken at | gain may grow by | gain may fall by | phase | delay | highest crossover | disk margin |",
        "|---|---|---|---|---|---|---|",
    ]
    for m in found:
        up, down = (f"{db:.1f} dB" if np.isfinite(db) else "any" for db in (m.gain_up_db, m.gain_down_db))
        lines.append(
            f"| {m.actuator} | {up} | {down} | {m.phase_deg:.0f} deg | {1000 * m.delay:.0f} ms | "
            f"{m.crossover:.1f} rad/s | {m.disk:.2f} |"
        )
    return "\n".join(lines)


def weights() -> str:
    """Bryson's largest welcome values behind each regulator, as they stand in the code."""
    attitude, position, altitude = controllers.attitude, controllers.position, controllers.altitude
    heading, governor = controllers.heading, controllers.governor
    angle = attitude.WEIGHTS
    return "\n".join(
        [
            "| regulator | largest welcome values | of its control |",
            "|---|---|---|",
            f"| attitude | roll, pitch {angle['roll']:g} rad; rates {angle['wx']:g} rad/s; "
            f"flapping {angle['flapping.back']:g} rad | cyclic {attitude.CYCLIC:g} rad |",
            f"| position and velocity | integral {position.INTEGRAL:g} m s; position {position.POSITION:g} m; "
            f"velocity {position.VELOCITY:g} m/s; tilt {position.TILT:g} rad "
            f"| tilt demand {position.TILT_DEMAND:g} rad |",
            f"| height | integral {altitude.INTEGRAL:g} m s; height {altitude.HEIGHT:g} m; climb rate "
            f"{altitude.CLIMB:g} m/s | collective {altitude.COLLECTIVE:g} rad |",
            f"| heading | integral {heading.INTEGRAL:g} rad s; heading {heading.HEADING:g} rad; yaw rate "
            f"{heading.RATE:g} rad/s | tail {heading.TAIL:g} rad |",
            f"| governor | integral {governor.INTEGRAL:g} rad; rotor speed {governor.SPEED:g} rad/s "
            f"| throttle {governor.THROTTLE:g} |",
        ]
    )


def gain_table(gains: Gains) -> str:
    """The gains that fly."""
    p, v, a, h, g = gains.position, gains.velocity, gains.altitude, gains.heading, gains.governor
    rows = [
        ("position", f"{p.proportional:.3f} 1/s", "velocity wanted per position error"),
        ("velocity", f"{v.proportional:.3f} 1/s, {v.integral:.3f} 1/s^2", "acceleration per velocity error, integral"),
        ("height", f"{a.height:.3f} 1/s", "climb rate wanted per height error"),
        ("climb rate", f"{a.climb:.3f} 1/s, {a.integral:.3f} 1/s^2", "acceleration per climb-rate error, integral"),
        ("heading", f"{h.heading:.4f}, {h.rate:.4f} s, {h.integral:.4f} 1/s", "tail per heading, yaw rate, integral"),
        ("governor", f"{g.proportional:.4f} s, {g.integral:.4f}", "throttle per rotor speed error, integral"),
        ("collective to throttle", f"{g.collective:.3f} 1/rad", "reckoned in beforehand"),
    ]
    for row, name in enumerate(("lateral", "longitudinal")):
        on = ", ".join(f"{value:+.4f}" for value in gains.attitude.measured[row])
        rows.append((name, on, "minus cyclic per roll, pitch [rad], wx, wy [rad/s]"))
        on = ", ".join(f"{value:+.4f}" for value in gains.attitude.hidden[row])
        rows.append((name, on, "minus cyclic per flapping back, right, servo lateral, longitudinal [rad]"))
    return "\n".join(["| loop | gains | of what |", "|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in rows)])


def document(draws: int = 6) -> str:
    """The page."""
    plant = plant_of(vehicles.load("raptor90"), SURFACE_PRESSURE, SURFACE_TEMPERATURE)
    gains = design(plant)
    nominal, together = margins(gains, plant)
    spread = [margins(gains, drawn)[0] for drawn in drawn_plants(draws)]
    low = min(m.phase_deg for m in nominal)
    late_ms = 1000 * controllers.attitude.ESTIMATOR_DELAY
    return f"""# Controllers: gains and margins

Made by `python benchmarks/margins.py`; a test keeps it up to date. Change the weights in `controllers/`, run it again.

## How the pilot is built

Position -> velocity -> tilt -> attitude -> cyclic; height -> climb rate -> thrust -> collective; heading -> tail; rotor
speed -> throttle. Every loop is a linear-quadratic regulator of the helicopter linearised in hover
(`sim/linearisation.py`), with weights by Bryson's rule. The integrals make the regulators PI or PID; those of position
and height are split into cascades with the same zeros, so that tilt, speed and climb rate can be limited on the way.

- Attitude: sampled at 250 Hz with the servos' delay and the navigator's
  ({late_ms:.0f} ms are reckoned with), both axes at once. Flapping, servos and the cyclic still under way are fed back
  from a model that runs along: the weakly damped mode of fuselage and tip-path plane at 15 to 20 rad/s is why angles
  and rates alone do not do.
- Height: the loop asks for thrust; collective follows by blade element and momentum theory, with rotor speed, tilt and,
  below 2 m, ground effect in it. The same loop so holds the sink rate on the rotor that runs down.
- Heading: the tail rotor's pitch for the engine's torque is reckoned in beforehand, so the nose stays where it is when
  the throttle shuts.
- Anti-windup: each integral rests where its control or limit stands at an end that the error presses against. The tilt
  limit is on what comes on top of the integral, so a wind that needs more tilt than the limit is still met.

## Weights

{weights()}

## Gains

{gain_table(gains)}

## Margins

Every loop closed, one broken at its actuator at a time; servo lag, servo delay, navigator's delay and the sampling
included, limits left out. Required: {REQUIRED_GAIN_DB:.0f} dB and {REQUIRED_PHASE_DEG:.0f} deg;
the smallest phase margin is {low:.0f} deg. The disk margin with all five actuators varying at once, gain and phase
together, is at least {together:.2f}.

{table(nominal)}

The same gains on {draws} vehicles whose terms' numbers are drawn from the tolerances of the vehicle file, the worst
of each figure:

{table(worst(spread))}
"""


@dataclass(frozen=True)
class Arguments:
    """Write docs/controllers.md, or check that it is up to date."""

    check: bool = False
    draws: int = 6


def main() -> int:
    """Entry."""
    arguments = tyro.cli(Arguments)
    text = document(arguments.draws)
    if arguments.check:
        return 0 if DOCUMENT.read_text() == text else 1
    DOCUMENT.write_text(text)
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

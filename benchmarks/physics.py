"""The flight physics beside theory: hover trim, ground effect, Dryden turbulence, and what an instant costs.

python benchmarks/physics.py [seconds of turbulence, default 200000]
"""

import math
import sys
import time

import numba
import numpy as np
from scipy.optimize import brentq

from flightlog.constants import GRAVITY
from sim import vehicle
from sim.linearisation import Trim, linearise, trim
from sim.pipeline import Pipeline, settle
from sim.terms import CATALOGUE
from sim.vehicle import Vehicle
from sim.wind import dryden


def hover(raptor: Vehicle, pipeline: Pipeline) -> Trim:
    at = trim(pipeline, raptor.inertia, height=100.0)
    s, geometry, numbers = at.signals, raptor.geometry, raptor.parameters["main_rotor"]
    disc = math.pi * geometry["rotor_radius"] ** 2 * s["density"]
    tip = s["rotor_speed"] * geometry["rotor_radius"]
    thrust = float(s["thrust"])
    induced = math.sqrt(thrust / (2.0 * disc))
    coefficient = thrust / (disc * tip**2)
    pitch = 6.0 * coefficient / (geometry["rotor_solidity"] * numbers["lift_slope"]) + 1.5 * math.sqrt(coefficient / 2)
    profile = disc * tip**3 * geometry["rotor_solidity"] * numbers["profile_drag"] / 8.0
    power = s["rotor_torque"] * s["rotor_speed"]
    print(f"hover at 100 m: thrust {thrust:.2f} N for a weight of {s['mass'] * GRAVITY:.2f} N")
    for name, found, theory in (
        ("induced velocity [m/s]", s["inflow"], induced),
        ("induced power [W]", power - profile, numbers["induced_factor"] * thrust * induced),
        ("collective [deg]", math.degrees(s["collective"]), math.degrees(pitch)),
    ):
        print(f"  {name:24s} {found:8.3f}   theory {theory:8.3f}   {100 * (found / theory - 1):+.2f} %")
    print(f"  main rotor {power:.0f} W, tail rotor {s['tail_torque'] * s['rotor_speed']:.0f} W, ", end="")
    print(f"throttle {100 * s['throttle']:.1f} %, roll {math.degrees(at.roll):+.2f} deg")
    return at


def ground_effect(raptor: Vehicle) -> None:
    radius, hub = float(raptor.geometry["rotor_radius"]), float(raptor.geometry["hub"][2])
    pipeline = Pipeline(
        [CATALOGUE[name] for name in ("ground_effect", "main_rotor")], raptor.parameters, raptor.geometry
    )

    def rotor(collective: float, height: float) -> tuple[float, float]:
        s = pipeline.signals()
        s["collective"], s["density"], s["height"], s["up"] = collective, 1.225, height, (0.0, 0.0, 1.0)
        pipeline.settle(s, 0.002, 1000, -1.0)
        return float(s["thrust"]), float(s["rotor_torque"])

    free, torque = rotor(0.08, 1e6)
    print("ground effect: thrust at constant rotor power over thrust far up")
    for over_radius in (0.5, 0.62, 1.0, 1.5, 2.0):
        height = over_radius * radius - hub
        collective = brentq(lambda angle, height=height: rotor(angle, height)[1] - torque, 0.03, 0.15, xtol=1e-10)
        ratio, theory = rotor(collective, height)[0] / free, 1.0 / (1.0 - (1.0 / (4.0 * over_radius)) ** 2)
        print(f"  z/R {over_radius:4.2f}   {ratio:.4f}   1955 {theory:.4f}   {100 * (ratio / theory - 1):+.2f} %")


@numba.njit(cache=True)
def generate(seed, steps, height, speed, dt):  # type: ignore[no-untyped-def]
    """Turbulence (steps, 3) [m/s] in hover."""
    np.random.seed(seed)  # noqa: NPY002 (numba's own generator)
    x, normals, out = np.zeros(dryden.STATES), np.zeros(dryden.NORMALS), np.empty((steps, 3))
    for k in range(steps):
        for i in range(dryden.NORMALS):
            normals[i] = np.random.standard_normal()  # noqa: NPY002
        out[k] = dryden.step(x, normals, height, speed, speed, dt)
    return out


def turbulence(seconds: float) -> None:
    generate(0, 1, 10.0, 5.0, 0.1)
    print(f"Dryden turbulence in hover at 10 m: standard deviation over the specification, {seconds:g} s")
    for speed in (1.5, 5.0, 15.0):
        begin = time.perf_counter()
        air = generate(1, int(seconds / 0.1), 10.0, speed, 0.1)
        cost = (time.perf_counter() - begin) / len(air)
        along, up = dryden.intensities(10.0, speed)
        ratio = air.std(axis=0) / (along, along, up)
        short = air[:9000].std(axis=0) / (along, along, up)
        print(f"  {speed:4.1f} m/s   u {ratio[0]:.3f}   v {ratio[1]:.3f}   w {ratio[2]:.3f}   ", end="")
        print(f"one run of 900 s: {np.round(short, 2)}   {cost * 1e6:.2f} us a step")


def cost(pipeline: Pipeline, at: Trim) -> None:
    s = at.signals.copy()
    pipeline.state[:] = at.state
    pipeline.set_parameter("fuel", "rate", 0.0)  # or the tank runs empty

    def once(steps: int = 100_000) -> float:
        begin = time.perf_counter()
        settle(
            pipeline.kernels, pipeline.spans, s, pipeline.geometry, pipeline.state, pipeline.parameters, 0.002, steps,
            -1, 0.0,
        )  # fmt: skip
        return (time.perf_counter() - begin) / steps

    print(f"one instant of the whole model: {min(once() for _ in range(5)) * 1e6:.2f} us")
    for name, function in (
        ("trim", lambda: trim(pipeline, at.inertia)),
        ("linearisation", lambda: linearise(pipeline, at)),
    ):
        begin = time.perf_counter()
        function()
        print(f"{name}: {1e3 * (time.perf_counter() - begin):.0f} ms")


def main() -> None:
    raptor = vehicle.load("raptor90")
    pipeline = Pipeline(raptor.terms, raptor.parameters, raptor.geometry)
    at = hover(raptor, pipeline)
    ground_effect(raptor)
    turbulence(float(sys.argv[1]) if len(sys.argv) > 1 else 200_000.0)
    cost(pipeline, at)


if __name__ == "__main__":
    main()

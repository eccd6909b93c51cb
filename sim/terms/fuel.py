"""Fuel burnt while the engine runs; an empty tank stops it."""

from sim.parameters import Parameter
from sim.terms.contract import Stage, Term, kernel


@kernel
def _fuel(s, v, x, p, dt):  # type: ignore[no-untyped-def]
    rate, capacity = p[0], p[1]
    if s.throttle > 0.0 and x[0] < capacity:
        x[0] = min(x[0] + rate * dt, capacity)
    if x[0] >= capacity:
        s.throttle = 0.0
    s.mass -= x[0]


TERM = Term(
    name="fuel",
    stage=Stage.MASS,
    kernel=_fuel,
    parameters=(
        Parameter("rate", "kg/s", 0.0, 0.05, "fuel burnt while the throttle is open"),
        Parameter("capacity", "kg", 0.0, 50.0, "fuel aboard at t = 0, part of the vehicle's mass"),
    ),
    states=("burnt",),
    source="a steady burn",
)

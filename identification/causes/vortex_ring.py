"""Thrust is lost in descent."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="vortex_ring",
    where="plant",
    parameters=(Parameter("depth", "1", "terms.vortex_ring.depth", 0.2),),
    about="share of the thrust lost where the rotor sinks into its own wake",
)

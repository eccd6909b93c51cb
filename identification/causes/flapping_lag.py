"""The tip-path plane follows slower or faster than declared."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="flapping_lag",
    where="plant",
    parameters=(Parameter("tau", "s", "terms.flapping.tau", 0.06),),
    about="time constant of the rotor with its flybar",
)

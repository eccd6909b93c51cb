"""Fuel goes faster or slower than declared."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="fuel_burn",
    where="plant",
    parameters=(Parameter("rate", "kg/s", "terms.fuel.rate", 2e-3),),
    about="fuel burnt while the engine runs",
    split_by={"thrust_scale": "a hover of several minutes: fuel goes, the scale stays"},
)

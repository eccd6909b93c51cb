"""It weighs more or less than the file says."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="mass",
    where="plant",
    parameters=(Parameter("mass", "kg", "mass", 0.5),),
    about="mass at the start",
    split_by={"thrust_scale": "collective doublets: the damping of heave goes with thrust and mass differently"},
)

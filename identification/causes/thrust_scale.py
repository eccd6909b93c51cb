"""The rotor gives more or less thrust than blade element theory says, always by the same share."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="thrust_scale",
    where="plant",
    parameters=(Parameter("scale", "1", "terms.main_rotor.thrust_scale", 0.15),),
    about="blade lift over that of the model",
    split_by={
        "mass": "collective doublets: the damping of heave goes with thrust and mass differently",
        "fuel_burn": "a hover of several minutes: fuel goes, the scale stays",
    },
)

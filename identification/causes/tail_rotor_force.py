"""The tail rotor pushes harder or weaker than declared."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="tail_rotor_force",
    where="plant",
    parameters=(Parameter("scale", "1", "terms.tail_rotor.force_scale", 0.25),),
    about="force of the tail rotor over that of the model",
)

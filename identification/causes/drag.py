"""More drag than that of the fuselage in the file."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="drag",
    where="plant",
    parameters=(
        Parameter("area", "m^2", "terms.drag.area", 0.1),
        Parameter("linear", "N s/m", "terms.drag.linear", 0.5),
    ),
    about="drag beside the fuselage's: equivalent flat plate, and a share linear in speed",
    split_by={"wind": "a box flown at 5 m/s: drag changes sides with the direction of flight"},
)

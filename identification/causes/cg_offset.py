"""The centre of mass lies beside the body's origin."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="cg_offset",
    where="plant",
    parameters=(
        Parameter("x", "m", "terms.cg_offset.x", 0.015),
        Parameter("y", "m", "terms.cg_offset.y", 0.015),
        Parameter("z", "m", "terms.cg_offset.z", 0.03),
    ),
    about="place of the centre of mass, the total mass unchanged",
    split_by={"wind": "a full turn in hover: an offset turns with the body, the wind does not"},
)

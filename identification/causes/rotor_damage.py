"""One rotor gives less thrust, and less torque in proportion, than its command asks for."""

from identification.causes.contract import Cause, Parameter

EXCHANGED = (
    "the same hover with the two propellers of that diagonal exchanged: damage goes with the propeller, a weight or a "
    "shift stays"
)
SPREAD = 0.3  # of the share: chipped tips cost a few hundredths, a broken blade a half


def of(rotor: int, rotors: int = 4) -> Cause:
    """The cause for one rotor of so many, counted from 1 as in m1..mN."""
    return Cause(
        name=f"rotor_damage#{rotor}",
        where="plant",
        parameters=(Parameter("scale", "1", f"rotors.{rotor - 1}.thrust_scale", SPREAD),),
        about="thrust and torque of one rotor over those of a sound one",
        kinds=("multirotor",),
        fixed={"rotor": rotor},
        alike=rotors,
        split_by=dict.fromkeys(("mass", "cg_offset"), EXCHANGED),
    )


CAUSE = of(1)

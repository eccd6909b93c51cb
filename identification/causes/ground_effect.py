"""More or less lift near the ground than the model says."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="ground_effect",
    where="plant",
    parameters=(Parameter("gain", "1", "terms.ground_effect.gain", 0.8),),
    about="lift near the ground; 1 is Cheeseman and Bennett's, 0 none",
    split_by={"baro_downwash": "hover at 0.5, 1 and 2 m with the ranger in reach: the force changes or it does not"},
)

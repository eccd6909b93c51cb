"""The servos follow slower than declared."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="actuator_lag",
    where="plant",
    parameters=(Parameter("tau", "s", "terms.servo.tau", 0.06),),
    about="time constant of the servos",
    split_by={"actuator_delay": "doublets of half a second on every control: a lag rounds them, a delay shifts them"},
)

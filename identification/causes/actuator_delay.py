"""Commands reach the servos later than declared."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="actuator_delay",
    where="timing",
    parameters=(Parameter("delay", "s", "terms.servo.delay", 0.03),),
    about="pure delay from command to servo",
    split_by={
        "actuator_lag": "doublets of half a second on every control: a lag rounds them, a delay shifts them",
        "clock_offset": "a turn by hand with the rotor stopped: the clocks of the sensors alone",
    },
)

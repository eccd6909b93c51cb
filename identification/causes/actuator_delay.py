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


def of_input(name: str, number: int, inputs: int) -> Cause:
    """The same for one input of a rig, the `number`-th of so many."""
    return Cause(
        name=f"actuator_delay#{name}",
        where="timing",
        parameters=(Parameter("delay", "s", f"terms.actuator_lag.{name}.delay", 0.15),),
        about=f"pure delay of the input {name}",
        kinds=("rig",),
        fixed={"input": number},
        topic=name,
        alike=inputs,
        split_by={"actuator_lag": "steps of that input by itself: a lag rounds the answer, a delay shifts it"},
    )

"""The servos follow slower than declared, by a lag of first or second order."""

from identification.causes.contract import Cause, Parameter

CAUSE = Cause(
    name="actuator_lag",
    where="plant",
    parameters=(
        Parameter("tau", "s", "terms.servo.tau", 0.06),
        Parameter("second", "1", "terms.servo.second", 0.25),
    ),
    about="time constant of the servos, and the share that a second stage has of it",
    split_by={"actuator_delay": "doublets of half a second on every control: a lag rounds them, a delay shifts them"},
)


def of_input(name: str, number: int, inputs: int) -> Cause:
    """The same for one input of a rig, the `number`-th of so many."""
    return Cause(
        name=f"actuator_lag#{name}",
        where="plant",
        parameters=(Parameter("tau", "s", f"terms.actuator_lag.{name}.tau", 0.3),),
        about=f"time constant of the input {name}",
        kinds=("rig",),
        fixed={"input": number},
        topic=name,
        alike=inputs,
    )

"""An input of a rig acts by a power of what exceeds a deadband."""

from identification.causes.contract import Cause, Parameter


def of(name: str, number: int, inputs: int, size: float, unit: str) -> Cause:
    """The cause for one input, the `number`-th of so many; size: usual one, in its unit."""
    key = f"terms.input_nonlinearity.{name}"
    return Cause(
        name=f"input_nonlinearity#{name}",
        where="plant",
        parameters=(
            Parameter("deadband", unit, f"{key}.deadband", 0.2 * size),
            Parameter("exponent", "1", f"{key}.exponent", 0.5),
        ),
        about=f"deadband and power of the input {name}",
        kinds=("rig",),
        fixed={"input": number},
        topic=name,
        alike=inputs,
    )


CAUSE = of("1", 1, 1, 1.0, "1")

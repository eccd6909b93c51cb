"""A spring across a rig's joint, or a cable that is twisted by it."""

from identification.causes.contract import Cause, Parameter


def of(joint: str, number: int, joints: int, torque: float) -> Cause:
    """The cause for one joint, the `number`-th of so many; torque [N m]: of its inputs, usual size."""
    key = f"terms.joint_stiffness.{joint}"
    return Cause(
        name=f"joint_stiffness#{joint}",
        where="plant",
        parameters=(
            Parameter("stiffness", "N m/rad", f"{key}.stiffness", 0.3 * torque),
            Parameter("centre", "rad", f"{key}.centre", 1.0),
        ),
        about=f"a spring or a cable's twist across the joint {joint}",
        kinds=("rig",),
        fixed={"joint": number},
        topic=joint,
        alike=joints,
    )


CAUSE = of("1", 1, 1, 1.0)

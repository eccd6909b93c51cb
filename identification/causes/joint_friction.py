"""Friction of a rig's joint beyond what its file says: dry, and what more holds it at rest."""

from identification.causes.contract import Cause, Parameter


def of(joint: str, number: int, joints: int, torque: float) -> Cause:
    """The cause for one joint, the `number`-th of so many; torque [N m]: of its inputs, usual size."""
    key = f"terms.joint_friction.{joint}"
    return Cause(
        name=f"joint_friction#{joint}",
        where="plant",
        parameters=(
            Parameter("coulomb", "N m", f"{key}.coulomb", 0.3 * torque),
            Parameter("viscous", "N m s/rad", f"{key}.viscous", 0.3 * torque),
        ),
        about=f"dry and viscous friction of the joint {joint}",
        kinds=("rig",),
        fixed={"joint": number},
        topic=joint,
        alike=joints,
        split_by={"joint_stiffness": "let the joint stop at several angles with the inputs changed slowly both ways"},
    )


CAUSE = of("1", 1, 1, 1.0)

"""Scene and model of a flight, from files that may be a user's own."""

from collections.abc import Mapping

import mujoco

from flightlog.equipment import CameraSpec
from flightlog.errors import UserError
from flightlog.marks import Mark
from sim.light import Light
from sim.scene import MAIN_ROTOR, TAIL_ROTOR, VEHICLE, CompiledScene, compose
from sim.schedule import TICK
from sim.vehicle import Vehicle


def assemble(
    vehicle: Vehicle, scene: str, mark: Mark | None, cameras: Mapping[str, CameraSpec], light: Light, dip: bool
) -> tuple[CompiledScene, mujoco.MjModel]:
    """The composed scene and its compiled model; UserError where the vehicle's MJCF or cameras are not fit for it."""
    try:
        composed = compose(vehicle.model, scene, mark, cameras, light, timestep=TICK, dip=dip)
        model = composed.model()
        rotors = [model.joint(name) for name in (MAIN_ROTOR, TAIL_ROTOR)]
    except (ValueError, KeyError, OSError, SyntaxError, mujoco.FatalError) as error:
        text = " ".join(str(error.args[0] if error.args else error).split())
        raise UserError(f"{vehicle.path}: {text}") from error
    body = model.body(VEHICLE)
    hinged = all(rotor.type[0] == mujoco.mjtJoint.mjJNT_HINGE for rotor in rotors)
    if body.dofadr[0] != 0 or body.dofnum[0] != 6 or not hinged:
        raise UserError(
            f"{vehicle.model}: body {VEHICLE!r} needs a free joint, and hinges named {MAIN_ROTOR!r} and {TAIL_ROTOR!r}"
        )
    return composed, model

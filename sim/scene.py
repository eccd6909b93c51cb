"""Assembly of vehicle, pad, scene and cameras into one model.

The MJCF files stand alone, with flat placeholders for textures. `compose` joins them with dm_control.mjcf; the
textures are painted only into the models that are rendered, so that a world without cameras pays nothing for them.
"""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import assets
from flightlog.camera import CameraModel
from flightlog.equipment import CameraSpec
from flightlog.marks import HMark, Mark
from sim import courtyard, sky, textures
from sim.cameras.optics import pinhole_behind
from sim.light import Light

if TYPE_CHECKING:
    import mujoco

# names that every composed model has
VEHICLE = "vehicle"  # the body and its free joint
MAIN_ROTOR = "main_rotor"  # the hinges; the main rotor turns clockwise seen from above: negative about its axis
TAIL_ROTOR = "tail_rotor"
GROUND = "ground"  # the geom that collides, the plane z = 0
SHADOW = "shadow"  # a mocap body that the renderer places
SUN = "sun"
FAR_DISC = "far_disc"  # carries the horizon where it dips
FAR = "far"  # material: the colour into which the ground fades
MARK = "mark"  # texture and material of the pad

WORLD_GROUP, SHADOW_GROUP, VEHICLE_GROUP, HIDDEN_GROUP = 0, 1, 2, 3
PIXEL = 1e-5  # [m] what a pixel measures on MuJoCo's sensor; only ratios count


@dataclass(frozen=True)
class CompiledScene:
    """A composed model, ready to be sent to another process."""

    xml: str
    assets: Mapping[str, bytes]  # mesh files by the names in `xml`
    mark: Mark | None
    light: Light
    dip: bool  # whether the horizon sinks with height
    cameras: Mapping[str, CameraSpec] = field(default_factory=dict)

    def model(self) -> "mujoco.MjModel":
        """The model for physics: its textures are flat colours."""
        import mujoco

        return mujoco.MjModel.from_xml_string(self.xml, dict(self.assets))

    def painted_model(self) -> "mujoco.MjModel":
        """The model for rendering, its textures painted."""
        model = self.model()
        far = tuple(round(float(c), 4) for c in model.mat(FAR).rgba[:3])
        # the sky is not lit, the ground is: what the sun makes of the far colour, from whatever elevation
        lit = tuple(c * Light.HORIZONTAL for c in far)
        painters: dict[str, Callable[[int], textures.Picture]] = {
            "mark": lambda n: textures.paint_mark(self.mark or HMark(), n),
            "grass": textures.paint_grass,
            "waves": textures.paint_waves,
            "paving": courtyard.paint_paving,
            "plaster": courtyard.paint_plaster,
            "deck": textures.paint_deck,
            "meadow": lambda n: textures.paint_meadow(n, far),
            "swell": lambda n: textures.paint_swell(n, far),
            "field_sky": lambda n: sky.paint_field_sky(n, lit, self.dip),
            "sea_sky": lambda n: sky.paint_sea_sky(n, lit, self.dip),
        }
        for i in range(model.ntex):
            name = model.tex(i).name
            if name not in painters:
                continue  # a user's own texture, already read from its file
            picture = painters[name](int(model.tex_width[i]))
            start = model.tex_adr[i]
            model.tex_data[start : start + picture.size] = picture.ravel()
        return model

    def rendered(self, camera: str) -> CameraModel:
        """Intrinsics of the pinhole picture from which a camera's own picture is made."""
        return pinhole_behind(self.cameras[camera].model)


def scenes() -> list[str]:
    """Names of the scenes there are."""
    return sorted(file.stem for file in assets.path("scenes").glob("*.xml"))


def compose(
    vehicle_xml: Path,
    scene: str,
    mark: Mark | None,
    cameras: Mapping[str, CameraSpec],
    light: Light,
    *,
    timestep: float = 0.002,
    dip: bool = False,
) -> CompiledScene:
    """Join a vehicle's MJCF, a scene of assets/scenes by name, the pad with its mark, and the cameras aboard.

    `timestep` [s]; `dip`: the horizon sinks to sqrt(2 h / R) below elevation 0, as on the round earth.
    """
    mjcf = _mjcf()
    file = assets.path("scenes", f"{scene}.xml")
    if not file.exists():
        raise ValueError(f"scene '{scene}': unknown; there are: {', '.join(scenes())}")
    # geoms are drawn in this order: what lies nearer comes first, so that what it hides is not shaded at all
    root = mjcf.RootElement(model=scene)
    if mark is not None:
        pad = _read(mjcf, assets.path("pads", "h.xml" if isinstance(mark, HMark) else "ring.xml"))
        half = mark.square / 2
        pad.find("geom", "pad").size = [half, half, 1.0]
        root.include_copy(pad)
    root.include_copy(_read(mjcf, file))
    root.option.timestep = timestep
    root.include_copy(_read(mjcf, Path(vehicle_xml)))
    body = root.find("body", VEHICLE)
    if body is None:
        raise ValueError(f"{vehicle_xml}: has no body named '{VEHICLE}'")
    root.find("light", SUN).dir = light.direction()
    for name, spec in cameras.items():
        _add_camera(body, name, spec)
    sizes = [pinhole_behind(spec.model) for spec in cameras.values()]
    root.visual.__getattr__("global").offwidth = max([640, *(s.width for s in sizes)])
    root.visual.__getattr__("global").offheight = max([480, *(s.height for s in sizes)])
    if dip:
        far = root.find("geom", "far_ground")
        below = -0.05 if far is None else far.pos[2] - 0.02
        root.worldbody.add(
            "geom", name=FAR_DISC, type="cylinder", size=[5000.0, 0.01], pos=[0, 0, below], material="far",
            contype=0, conaffinity=0, group=WORLD_GROUP,
        )  # fmt: skip
    compiled = CompiledScene(root.to_xml_string(), root.get_assets(), mark, light, dip, dict(cameras))
    return compiled


def _mjcf() -> Any:
    """dm_control's composer, imported without the window library that it would start: none of it is needed here."""
    chosen = "MUJOCO_GL" in os.environ
    os.environ.setdefault("MUJOCO_GL", "disabled")
    try:
        from dm_control import mjcf
    finally:
        if not chosen:
            del os.environ["MUJOCO_GL"]  # the render process makes its own choice
    return mjcf


def _read(mjcf: Any, file: Path) -> Any:
    """One MJCF file; a missing mesh or a misspelt tag is reported with the file's name."""
    try:
        return mjcf.from_path(str(file))
    except FileNotFoundError as error:
        quoted = re.findall(r"'([^']+)'", str(error))  # the reader wraps the system's error; the path comes last
        raise FileNotFoundError(f"{file}: needs '{quoted[-1] if quoted else error}', which is not there") from error
    except (AttributeError, KeyError, ValueError) as error:
        raise ValueError(f"{file}: not usable as MJCF: {error}") from error


def _add_camera(body: Any, name: str, spec: CameraSpec) -> None:
    """MuJoCo's camera looks along its -z with y up; its principal point counts from the centre, with a minus."""
    seen = pinhole_behind(spec.model)
    axes = np.concatenate([spec.mount.axes[:, 0], -spec.mount.axes[:, 1]])
    body.add(
        "camera", name=name, pos=spec.mount.position, xyaxes=axes,
        resolution=[seen.width, seen.height], sensorsize=[seen.width * PIXEL, seen.height * PIXEL],
        focalpixel=[seen.fx, seen.fy],
        principalpixel=[(seen.width - 1) / 2 - seen.cx, (seen.height - 1) / 2 - seen.cy],
    )  # fmt: skip

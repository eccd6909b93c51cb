"""Rendering in this process: what the render process runs, and what tests and pictures use.

Needs a headless OpenGL: EGL, or OSMesa where MUJOCO_GL=osmesa is set.
"""

import math
import os
import zlib
from collections.abc import Mapping
from types import TracebackType
from typing import Any, Self

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from flightlog.camera import CameraModel
from flightlog.constants import EARTH_RADIUS
from sim import scene as names
from sim.cameras import RenderError, mipmaps
from sim.cameras.blur import image_motion
from sim.cameras.imaging import Imaging, develop
from sim.cameras.optics import Lens
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import CompiledScene

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]


LUMINANCE = (0.299, 0.587, 0.114)  # of red, green and blue, as cv2.COLOR_RGB2GRAY weighs them


def gl_context(width: int, height: int) -> Any:
    """A headless OpenGL context, made current."""
    try:
        if os.environ.get("MUJOCO_GL", "").lower() == "osmesa":
            from mujoco.osmesa import GLContext
        else:
            os.environ["PYOPENGL_PLATFORM"] = "egl"  # importing mujoco without MUJOCO_GL may have set another
            from mujoco.egl import GLContext
        context = GLContext(width, height)
        context.make_current()
    except Exception as error:  # PyOpenGL fails in many ways where libraries are missing
        raise RenderError(
            f"no headless OpenGL ({type(error).__name__}: {' '.join(str(error).split())}): install Mesa's EGL "
            "(Debian, Ubuntu: apt install libegl1 libgl1) and see what `helideck doctor` says"
        ) from error
    return context


class Renderer:
    """Renders a composed scene. Use it as a context manager, in one thread."""

    def __init__(
        self, scene: CompiledScene, imaging: Mapping[str, Imaging] | None = None, seed: int = 0, samples: int = 0
    ) -> None:
        """Arguments: imaging by camera name, default where missing; seed of the cameras' noise; samples of MSAA."""
        self.scene = scene
        self.imaging = {name: (imaging or {}).get(name, Imaging()) for name in scene.cameras}
        self.seed = seed
        self.model = scene.painted_model()
        self.model.vis.quality.offsamples = samples
        self.data = mujoco.MjData(self.model)
        self._lens = {name: Lens.of(spec.model) for name, spec in scene.cameras.items()}
        self._gain = {name: self.imaging[name].exposure.gain for name in scene.cameras}
        self._view = mujoco.MjvScene(self.model, maxgeom=1000)
        for flag in (mujoco.mjtRndFlag.mjRND_SHADOW, mujoco.mjtRndFlag.mjRND_REFLECTION, mujoco.mjtRndFlag.mjRND_HAZE):
            self._view.flags[flag] = 0
        self._aboard, self._outside = mujoco.MjvOption(), mujoco.MjvOption()
        self._aboard.geomgroup[:] = [1, 1, 0, 0, 0, 0]
        self._outside.geomgroup[:] = [1, 1, 1, 0, 0, 0]
        glob = self.model.vis.global_
        self._gl = gl_context(glob.offwidth, glob.offheight)
        self._context = mujoco.MjrContext(self.model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        from OpenGL import GL

        self.name: str = GL.glGetString(GL.GL_RENDERER).decode()
        # the sky is drawn at about one texel a pixel, where mip-mapping costs a millisecond and changes nothing
        for k in np.flatnonzero(self.model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX):
            GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, int(self._context.texture[k]))
            GL.glTexParameteri(GL.GL_TEXTURE_CUBE_MAP, GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR)
        for texture in map(self.model.tex, range(self.model.ntex)):
            if texture.name == names.MARK:
                size, start = int(texture.width[0]), int(texture.adr[0])
                painted = self.model.tex_data[start : start + 3 * size**2].reshape(size, size, 3)
                mipmaps.upload(int(self._context.texture[texture.id]), painted)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Free the OpenGL context."""
        if self._gl is not None:
            self._context.free()
            self._gl.free()
            self._gl = None

    def frame(self, request: FrameRequest) -> Picture:
        """What a camera aboard delivers: (H, W) uint8 where it is monochrome, else (H, W, 3) RGB."""
        imaging = self.imaging[request.camera]
        gain = self._gain[request.camera]
        picture = self.clean(request.camera, request.qpos, request.light)
        rng = np.random.default_rng([self.seed, zlib.crc32(request.camera.encode()), request.index])
        if imaging.exposure.target is not None:
            mean = float(np.dot(cv2.mean(picture)[:3], LUMINANCE))
            self._gain[request.camera] = imaging.exposure.next_gain(gain, mean, request.light.illuminance)
        speed = self._image_speed(request)
        return develop(
            picture, imaging, self._lens[request.camera], gain * request.light.illuminance, speed, rng
        )

    def clean(self, camera: str, qpos: Floats, light: Light) -> Picture:
        """The pinhole picture (H, W, 3) RGB behind a camera's lens, in a light of strength 1."""
        self._place(qpos, light)
        seen = self.scene.rendered(camera)
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FIXED
        view.fixedcamid = self.model.camera(camera).id
        height = float(self.data.cam_xpos[view.fixedcamid, 2])
        self._dip(height)
        horizon = self._sees_sky(seen, self.data.cam_xmat[view.fixedcamid].reshape(3, 3))
        return self._draw(view, self._aboard, seen.width, seen.height, horizon)

    def picture(
        self, qpos: Floats, light: Light, *, look_at: Floats, azimuth_deg: float, elevation_deg: float,
        distance: float, width: int = 1280, height: int = 720, fovy_deg: float = 40.0, supersample: int = 1,
    ) -> Picture:  # fmt: skip
        """A picture (height, width, 3) RGB from outside, vehicle and all, as MuJoCo's free camera takes it."""
        self._place(qpos, light)
        view = mujoco.MjvCamera()
        view.type = mujoco.mjtCamera.mjCAMERA_FREE
        view.lookat[:] = look_at
        view.distance, view.azimuth, view.elevation = distance, azimuth_deg, elevation_deg
        self.model.vis.global_.fovy = fovy_deg
        self._dip(max(look_at[2] - distance * math.sin(math.radians(elevation_deg)), 0.1))
        large = self._draw(view, self._outside, width * supersample, height * supersample, sky=True)
        if supersample > 1:
            large = np.asarray(cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        return large

    def _place(self, qpos: Floats, light: Light) -> None:
        """Bring bodies, cameras, sun and shadow to where they are: after a step they lag behind qpos."""
        model, data = self.model, self.data
        data.qpos[:] = qpos
        sun = model.light(names.SUN).id
        model.light_dir[sun] = light.direction()
        model.light_diffuse[sun], model.light_ambient[sun] = Light.BEAM, light.ambient
        mujoco.mj_kinematics(model, data)
        root = data.body(names.VEHICLE)
        shadow = model.body(names.SHADOW).mocapid[0]
        nose = root.xmat[[0, 3]]
        half = 0.5 * math.atan2(nose[1], nose[0])
        data.mocap_pos[shadow, :2] = light.shadow(root.xpos)
        data.mocap_quat[shadow] = [math.cos(half), 0.0, 0.0, math.sin(half)]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)

    def _image_speed(self, request: FrameRequest) -> tuple[float, float]:
        """Speed [px/s] of the scene over the middle of the picture, from the free joint's velocity."""
        spec, data = self.scene.cameras[request.camera], self.data
        root = data.body(names.VEHICLE)
        turn, camera = root.xmat.reshape(3, 3), self.model.camera(request.camera).id
        start = self.model.joint(names.VEHICLE).dofadr[0]
        rates = turn @ request.qvel[start + 3 : start + 6]  # MuJoCo has them in body axes
        position = data.cam_xpos[camera]
        velocity = request.qvel[start : start + 3] + np.cross(rates, position - root.xpos)
        return image_motion(spec.model, turn @ spec.mount.axes, position, velocity, rates)

    def _dip(self, height: float) -> None:
        """Where the scene's horizon dips: the disc's rim is seen sqrt(2 h / R) below elevation 0."""
        if self.scene.dip:
            disc = self.model.geom(names.FAR_DISC)
            above = max(height - disc.pos[2], 0.1)  # a deck lies higher than the sea whose horizon is seen
            self.model.geom_size[disc.id, 0] = math.sqrt(above * EARTH_RADIUS / 2)

    def _sees_sky(self, camera: CameraModel, axes: Floats) -> bool:
        """Whether any corner of the picture looks above 3 deg below the horizon, where ground may end and sky begin."""
        w, h = camera.width - 1.0, camera.height - 1.0
        rays = camera.rays(np.array([[0, 0], [w, 0], [0, h], [w, h]]))
        up = (rays * [1, -1, -1]) @ axes[2]
        return bool(np.any(up / np.linalg.norm(rays, axis=1) > -math.sin(math.radians(3.0))))

    def _draw(
        self, view: mujoco.MjvCamera, option: mujoco.MjvOption, width: int, height: int, sky: bool
    ) -> Picture:
        self._view.flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = sky
        mujoco.mjv_updateScene(
            self.model, self.data, option, None, view, mujoco.mjtCatBit.mjCAT_ALL, self._view
        )
        self._gl.make_current()  # another renderer may have been at work since
        if width > self._context.offWidth or height > self._context.offHeight:
            mujoco.mjr_resizeOffscreen(
                max(width, self._context.offWidth), max(height, self._context.offHeight), self._context
            )
        rect = mujoco.MjrRect(0, 0, width, height)
        upside_down = np.empty((height, width, 3), np.uint8)
        mujoco.mjr_render(rect, self._view, self._context)
        mujoco.mjr_readPixels(upside_down, None, rect, self._context)
        return np.asarray(cv2.flip(upside_down, 0), np.uint8)


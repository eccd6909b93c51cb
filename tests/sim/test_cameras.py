"""Rendered cameras: pixels where CameraModel.project says, horizons where they belong, optics, noise, the process."""

import math
import time
from collections.abc import Callable
from dataclasses import replace

import cv2
import mujoco
import numpy as np
import pytest

import assets
from flightlog.camera import DOWN, CameraModel, CameraMount
from flightlog.constants import EARTH_RADIUS
from flightlog.equipment import CameraSpec
from flightlog.marks import HMark
from flightlog.rotations import matrix, quaternion
from sim import textures
from sim.cameras import RenderError
from sim.cameras.blur import Blur
from sim.cameras.exposure import Exposure
from sim.cameras.imaging import CLEAN, Imaging
from sim.cameras.noise import Noise
from sim.cameras.renderer import Renderer
from sim.cameras.rendering import RenderProcess
from sim.cameras.request import FrameRequest
from sim.light import Light
from sim.scene import CompiledScene, compose

pytestmark = pytest.mark.render

RAPTOR = assets.path("vehicles", "raptor90.xml")
DOWN_MODEL = CameraModel.centred(768, 494, 952.4, 816.3)
FORWARD_MODEL = CameraModel.centred(640, 480, 560.0)
MOUNT = np.array([0.10, 0.0, -0.10])
NOON = Light(math.pi / 2)
ASIDE = Light(math.radians(12.0))  # throws the shadow out of the picture
SQUARE = 0.125  # [m] of the chessboard that stands in for the mark


def scene(
    model: CameraModel = DOWN_MODEL, where: str = "field", forward: bool = False, dip: bool = False
) -> CompiledScene:
    mount = CameraMount.forward(np.array([0.42, 0, 0])) if forward else CameraMount.downward(MOUNT)
    return compose(RAPTOR, where, HMark(), {"eye": CameraSpec(25.0, 0.04, model, mount)}, NOON, dip=dip)


def enlarged(model: CameraModel, times: int) -> CameraModel:
    """The same camera with `times` as many pixels either way."""
    return CameraModel(
        model.width * times, model.height * times, model.fx * times, model.fy * times,
        times * (model.cx + 0.5) - 0.5, times * (model.cy + 0.5) - 0.5, model.distortion,
    )  # fmt: skip


def request(qpos: np.ndarray, index: int = 0, light: Light = NOON, camera: str = "eye", qvel=None) -> FrameRequest:
    return FrameRequest(camera, 0.0, index, qpos, np.zeros(8) if qvel is None else qvel, light)


def above(height: float, seed: int, tilt: float = 0.12, stray: float = 0.06) -> np.ndarray:
    """qpos (9,) with the down camera looking somewhere near the mark's centre from `height` [m]."""
    rng = np.random.default_rng(seed)
    q = quaternion(*rng.uniform(-tilt, tilt, 2), rng.uniform(0, 2 * math.pi))
    turn = matrix(q)
    camera = turn[:, 2] * height / turn[2, 2] + np.append(rng.uniform(-stray, stray, 2) * height, 0.0)
    return np.concatenate([camera - turn @ MOUNT, q, [0.0, 0.0]])


def seen(model: CameraModel, qpos: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Pixels (N, 2) of points (N, 3) [m] in the world."""
    return model.project(((points - qpos[:3]) @ matrix(qpos[3:7]) - MOUNT) @ DOWN)


def pictures(compiled: CompiledScene, poses: list[np.ndarray], shrink: int = 1) -> list[np.ndarray]:
    """Clean grey pictures from these poses, `shrink`-fold supersampled."""
    grey = replace(CLEAN, colour=False, exposure=Exposure(gain=1.0 / ASIDE.illuminance))
    out = []
    with Renderer(compiled, {"eye": grey}) as renderer:
        for pose in poses:
            picture = renderer.frame(request(pose, light=ASIDE))
            size = (picture.shape[1] // shrink, picture.shape[0] // shrink)
            out.append(cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if shrink > 1 else picture)
    return out


@pytest.fixture
def chessboard(monkeypatch) -> np.ndarray:
    """Paints a chessboard in the mark's place; its inner corners (N, 3) [m]."""

    def paint(mark: HMark, texels: int) -> np.ndarray:
        c = np.floor(((np.arange(texels) + 0.5) / texels - 0.5) * mark.square / SQUARE).astype(int)
        dark = (c[:, None] + c[None, :]) % 2 == 0
        return np.repeat(np.where(dark, 40, 235).astype(np.uint8)[..., None], 3, axis=2)

    monkeypatch.setattr(textures, "paint_mark", paint)
    c = np.arange(-5, 6) * SQUARE
    x, y = np.meshgrid(c, c)
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def corner_errors(model: CameraModel, shrink: int, board: np.ndarray, heights=(1.6, 2.5, 4.0)) -> np.ndarray:
    """Detected minus projected corners (N, 2) [px]. The search starts up to a pixel off and has to move."""
    poses = [above(height, seed) for seed, height in enumerate(heights)]
    errors = []
    for k, picture in enumerate(pictures(scene(enlarged(model, shrink)), poses, shrink)):
        expected = seen(model, poses[k], board)
        expected = expected[model.contains(expected, 12)]
        start = (expected + np.random.default_rng(k).uniform(-1, 1, expected.shape)).astype(np.float32)
        window = min(9, max(3, int(0.35 * SQUARE * model.fy / heights[k])))
        found = cv2.cornerSubPix(picture, start.copy(), (window, window), (-1, -1), (3, 200, 1e-6)).reshape(-1, 2)
        assert np.all(np.linalg.norm(found - start, axis=1) > 1e-3)
        errors.append(found - expected)
    return np.vstack(errors)


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))


def test_supersampled_corners_lie_where_the_camera_model_projects_them(chessboard):
    errors = corner_errors(DOWN_MODEL, 4, chessboard)
    assert len(errors) > 200
    assert rms(errors) < 0.05
    assert np.abs(errors.mean(0)).max() < 0.02


@pytest.mark.parametrize(
    "model",
    [
        DOWN_MODEL,
        CameraModel(768, 494, 952.4, 816.3, 383.5 + 21.3, 246.5 - 13.7),
        CameraModel(768, 494, 952.4, 816.3, 383.5, 246.5, (-0.28, 0.09, 0.001, -0.0008, 0.0)),
    ],
    ids=["as fitted", "off-centre principal point", "bent lens"],
)
def test_corners_of_the_flight_renderer(chessboard, model):
    errors = corner_errors(model, 1, chessboard)
    assert rms(errors) < 0.10
    assert np.abs(errors.mean(0)).max() < 0.02


def edge_bias(picture: np.ndarray, pose: np.ndarray, height: float) -> np.ndarray:
    """How much too large [px] the white is, at samples along every edge of the H: by area across the edge."""
    outline = HMark().outline()
    out = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        length = np.linalg.norm(b - a)
        share = np.linspace(0.25, 0.75, 7)[:, None]
        points = np.column_stack([a + share * (b - a), np.zeros(7)])
        along = np.append((b - a) / length, 0.0) * 0.02
        pixels = seen(DOWN_MODEL, pose, points)
        tangent = seen(DOWN_MODEL, pose, points + along) - pixels
        outward = seen(DOWN_MODEL, pose, points + [along[1], -along[0], 0.0]) - pixels
        normal = np.column_stack([tangent[:, 1], -tangent[:, 0]])
        normal *= (np.sign(np.sum(normal * outward, axis=1)) / np.linalg.norm(normal, axis=1))[:, None]
        half = min(3.0, 0.42 * 0.2 * DOWN_MODEL.fy / height)
        t = np.linspace(-half, half, 121)
        at = (pixels[:, None] + t[None, :, None] * normal[:, None]).astype(np.float32)
        profile = cv2.remap(picture.astype(np.float32), at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        high, low = profile[:, :8].mean(1, keepdims=True), profile[:, -8:].mean(1, keepdims=True)
        out.append(((profile - low) / (high - low)).mean(1) * 2 * half - half)
    return np.concatenate(out)


def test_the_mip_mapped_mark_is_as_large_as_the_supersampled_one():
    heights = [3.0, 5.0, 7.0, 10.0, 14.0]
    poses = [above(height, k, stray=0.05) for k, height in enumerate(heights)]
    bias = {
        shrink: np.array(
            [edge_bias(p, q, h).mean() for p, q, h in zip(pictures(scene(enlarged(DOWN_MODEL, shrink)), poses, shrink),
                                                          poses, heights, strict=True)]
        )
        for shrink in (1, 4)
    }  # fmt: skip
    assert np.abs(bias[4]).max() < 0.01
    assert np.abs(bias[1] - bias[4]).max() < 0.01


def horizon_errors(where: str, height: float, dip: bool) -> np.ndarray:
    """Rows of the steepest step from sky to sea minus those expected (N,) [px], where no island stands."""
    compiled = scene(FORWARD_MODEL, where, forward=True, dip=dip)
    mount = compiled.cameras["eye"].mount
    errors = []
    with Renderer(compiled, {"eye": CLEAN}) as renderer:
        for azimuth in np.radians([95.0, 110.0, 205.0]):
            q = quaternion(0.06, -0.03, azimuth)
            picture = renderer.frame(request(np.array([0, 0, height, *q, 0, 0])))[..., 0].astype(float)
            axes = matrix(q) @ mount.axes
            sunk = math.sqrt(2 * (height + (matrix(q) @ mount.position)[2]) / EARTH_RADIUS) if dip else 0.0
            for column in range(10, 640, 21):
                rows = np.arange(480)
                rays = FORWARD_MODEL.rays(np.column_stack([np.full(480, column), rows])) @ axes.T
                expected = np.interp(sunk, -np.arcsin(rays[:, 2] / np.linalg.norm(rays, axis=1)), rows)
                k = round(float(expected))
                step = np.clip(picture[k - 4 : k + 4, column] - picture[k - 3 : k + 5, column], 0, None)
                step[step < 0.2 * step.max()] = 0.0
                errors.append(k - 3.5 + step @ np.arange(8) / step.sum() - expected)
    return np.array(errors)


@pytest.mark.parametrize("height", [10.0, 100.0])
def test_the_sea_s_horizon_is_a_straight_line_at_elevation_zero(height):
    errors = horizon_errors("sea", height, dip=False)
    assert abs(errors.mean()) < 0.03
    assert np.abs(errors).max() < 0.3


def test_the_horizon_dips_with_height_where_the_scenario_says_so():
    for height in (10.0, 100.0):
        errors = horizon_errors("sea", height, dip=True)
        assert abs(errors.mean()) < 0.1
        assert np.abs(errors).max() < 0.7  # the disc's rim is not antialiased


def test_nothing_of_the_vehicle_is_in_its_own_pictures():
    both = compose(RAPTOR, "field", HMark(), {
        "down": CameraSpec(25.0, 0.04, DOWN_MODEL, CameraMount.downward(MOUNT)),
        "ahead": CameraSpec(10.0, 0.04, FORWARD_MODEL, CameraMount.forward(np.array([0.42, 0, 0]), math.radians(10))),
    }, NOON)  # fmt: skip
    pose = np.array([0, 0, 0.23, *quaternion(0, 0, 0.7), 0.3, 0])
    with Renderer(both) as renderer:
        plain = [renderer.clean(name, pose, NOON) for name in both.cameras]
        model = renderer.model
        mine = model.body_rootid[model.geom_bodyid] == model.body("vehicle").id
        model.geom_matid[mine] = -1
        model.geom_rgba[mine] = [1, 0, 1, 1]
        painted = [renderer.clean(name, pose, NOON) for name in both.cameras]
        outside = renderer.picture(pose, NOON, look_at=pose[:3], azimuth_deg=90, elevation_deg=-20, distance=3)
    assert all(np.array_equal(a, b) for a, b in zip(plain, painted, strict=True))
    assert np.any((outside[..., 0] > 100) & (outside[..., 1] < 20))  # the paint does show from outside


@pytest.fixture(scope="module")
def field() -> CompiledScene:
    return compose(RAPTOR, "field", HMark(), {
        "down": CameraSpec(25.0, 0.04, DOWN_MODEL, CameraMount.downward(MOUNT)),
        "ahead": CameraSpec(10.0, 0.04, FORWARD_MODEL, CameraMount.forward(np.array([0.42, 0, 0]))),
    }, Light())  # fmt: skip


IMAGING = {"down": Imaging(colour=False)}


@pytest.fixture(scope="module")
def renderer(field):
    with Renderer(field, IMAGING, seed=3) as renderer:
        yield renderer


def test_a_monochrome_camera_gives_one_channel(renderer):
    assert renderer.frame(request(above(5, 0), camera="down")).shape == (494, 768)
    assert renderer.frame(request(above(5, 0), camera="ahead")).shape == (480, 640, 3)


def test_a_frame_s_noise_belongs_to_its_number(renderer):
    first, again, other = (renderer.frame(request(above(5, 0), k, camera="down")).astype(int) for k in (7, 7, 8))
    assert np.array_equal(first, again)
    spread = np.std(first - other)
    assert 1.5 < spread < 4.5  # sqrt(2) of a level's noise
    assert abs(np.corrcoef((first - other).ravel()[:-1], (first - other).ravel()[1:])[0, 1]) < 0.02


def test_the_shadow_lies_where_the_sun_throws_it(renderer):
    """A sun in the west darkens the ground east of the vehicle, by a third of its height where it stands at 70 deg."""
    high = Light(math.radians(70), math.radians(270))
    pose = np.array([20.0, 0, 3.0, *quaternion(0, 0, 0), 0, 0])  # over grass, heading north
    unlit = renderer.clean("down", pose, ASIDE).mean(2)
    ratio = renderer.clean("down", pose, high).mean(2) / np.maximum(unlit, 1)

    def patch(spot: np.ndarray) -> float:
        u, v = seen(DOWN_MODEL, pose, np.append(spot, 0.0)[None])[0].round().astype(int)
        return float(ratio[v - 8 : v + 9, u - 8 : u + 9].mean())

    assert patch(pose[:2] + [1.05, 0.1]) < 0.8
    assert patch(pose[:2] - [1.05, -0.1]) > 0.99
    assert high.shadow(pose[:3]) == pytest.approx([20 + 3 / math.tan(math.radians(70)), 0.0])


def test_brighter_light_and_longer_gain_brighten_the_picture_until_it_saturates(field):
    level = {}
    for strength, gain in ((0.5, 1.0), (1.0, 1.0), (1.0, 0.5), (40.0, 1.0)):
        quiet = Imaging(colour=False, exposure=Exposure(gain), noise=Noise(0, 0))
        with Renderer(field, {"down": quiet}) as renderer:
            level[strength, gain] = renderer.frame(request(above(5, 0), light=Light(strength=strength), camera="down"))
    assert level[0.5, 1.0].mean() == pytest.approx(level[1.0, 1.0].mean() / 2, rel=0.02)
    assert np.array_equal(level[0.5, 1.0], level[1.0, 0.5])
    assert np.all(level[40.0, 1.0] > 250)


def test_automatic_exposure_comes_to_its_target(field):
    steered = Imaging(colour=False, exposure=Exposure(target=90.0, speed=0.5))
    dusk = Light(strength=0.3)
    with Renderer(field, {"down": steered}) as renderer:
        levels = [renderer.frame(request(above(8, 0), k, dusk, "down")).mean() for k in range(15)]
    assert levels[0] < 40
    assert levels[-1] == pytest.approx(90.0, rel=0.1)


def test_the_process_gives_what_this_process_gives_in_order(field, renderer):
    poses = [above(h, k) for k, h in enumerate((3, 6, 9))]
    asked = [request(pose, k, Light(), camera) for k, pose in enumerate(poses) for camera in ("down", "ahead")]
    with RenderProcess(field, IMAGING, seed=3) as process:
        for one in asked:
            process.submit(one)
        answers = [process.collect() for _ in asked]
        assert process.pending == 0
        assert process.renderer == renderer.name
        assert process.busy_s > 0 < process.startup_s
    for (got, picture), sent in zip(answers, asked, strict=True):
        assert got is sent
        assert np.array_equal(picture, renderer.frame(sent))


def test_submitting_does_not_wait_for_the_picture(field):
    with RenderProcess(field, IMAGING) as process:
        process.wait()
        start = time.perf_counter()
        process.submit(request(above(5, 0), camera="down"))
        assert time.perf_counter() - start < 0.5 * process.startup_s
        process.collect()


def test_a_killed_render_process_is_reported_in_one_line(field):
    with RenderProcess(field, IMAGING) as process:
        process.wait()
        process._process.kill()
        with pytest.raises(RenderError, match="the render process ended with code -9"):
            process.submit(request(above(5, 0), camera="down"))
            process.collect()


def test_a_machine_without_egl_is_told_what_to_install(field):
    with (
        RenderProcess(field, environment={"__EGL_VENDOR_LIBRARY_FILENAMES": "none.json"}) as process,
        pytest.raises(RenderError, match="apt install libegl1 libgl1"),
    ):
        process.wait()


def test_a_failing_request_is_reported(field):
    with RenderProcess(field) as process:
        process.submit(request(np.zeros(3), camera="down"))
        with pytest.raises(RenderError, match="ValueError"):
            process.collect()


def test_a_camera_s_own_motion_blurs_its_picture(field):
    lazy = Imaging(colour=False, blur=Blur(0.3, 0.02), noise=Noise(0, 0))
    pose = np.array([0, 0, 3.0, *quaternion(0, 0, math.pi / 2), 0, 0])  # heading east: body x is world x
    ahead = np.zeros(8)
    ahead[0] = 2.0
    with Renderer(field, {"down": lazy}) as renderer:
        still = renderer.frame(request(pose, camera="down")).astype(float)
        moving = renderer.frame(request(pose, camera="down", qvel=ahead)).astype(float)
    rows, columns = (lambda p: np.abs(np.diff(p, axis=0)).mean()), (lambda p: np.abs(np.diff(p, axis=1)).mean())
    # flying forward draws the picture out along its columns
    assert rows(moving) / rows(still) < 0.8 * columns(moving) / columns(still)


def test_sky_faces_look_where_their_directions_say():
    """MuJoCo's cube map convention, found again by rendering the directions themselves as colours."""
    from sim import sky

    compiled = scene(FORWARD_MODEL, forward=True)
    mount = compiled.cameras["eye"].mount
    colours = np.rint((sky.directions(1024) + 1) * 127).astype(np.uint8).reshape(-1, 1024, 3)
    original: Callable = sky.paint_field_sky
    sky.paint_field_sky = lambda *_: colours
    try:
        with Renderer(compiled, {"eye": CLEAN}) as renderer:
            for azimuth, pitch in ((0, 0.5), (1.7, 0.6), (3.0, 1.2), (4.6, 0.5)):
                q = quaternion(0.0, pitch, azimuth)
                picture = renderer.clean("eye", np.array([0, 0, 9, *q, 0, 0]), NOON)
                pixels = np.array([[50, 40], [600, 30], [320, 100]])
                rays = FORWARD_MODEL.rays(pixels) @ (matrix(q) @ mount.axes).T
                expected = rays / np.linalg.norm(rays, axis=1, keepdims=True)
                got = picture[pixels[:, 1], pixels[:, 0]] / 127.0 - 1
                assert got == pytest.approx(expected, abs=0.02)
    finally:
        sky.paint_field_sky = original


def test_rendering_follows_qpos_not_the_state_before_the_step(field):
    """After mj_step the kinematics lag; the renderer brings them up to date from qpos alone."""
    model = field.model()
    data = mujoco.MjData(model)
    data.qpos[:7] = above(8, 1, tilt=0.02, stray=0)[:7]
    data.qvel[:2] = [9.0, -6.0]
    for _ in range(50):
        mujoco.mj_step(model, data)
    with Renderer(field, {"down": replace(CLEAN, colour=False)}) as renderer:
        once = renderer.frame(request(data.qpos.copy(), camera="down"))
        mujoco.mj_forward(model, data)
        assert np.array_equal(once, renderer.frame(request(data.qpos.copy(), camera="down")))
        expected = seen(DOWN_MODEL, data.qpos, np.zeros((1, 3)))[0]
        bright = np.argwhere(once > 150)
        assert np.abs(bright.mean(0)[::-1] - expected).max() < 3.0

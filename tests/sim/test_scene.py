"""The composed model: its parts and where they are, what collides, what is painted where."""

import pickle
import shutil

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import assets
from flightlog.camera import CameraModel, CameraMount
from flightlog.equipment import CameraSpec
from flightlog.marks import HMark, RingMark
from flightlog.rotations import quaternion
from sim import scene as names
from sim.light import Light
from sim.scene import CompiledScene, compose, scenes
from sim.textures import ASPHALT, GREY, PAINT, coverage, disc_coverage, paint_mark

RAPTOR = assets.path("vehicles", "raptor90.xml")
SKIDS = 0.23  # [m] body origin above the skids' plane
WEIGHT = 5.0 * 9.80665


@pytest.fixture(scope="module")
def composed() -> CompiledScene:
    eye = CameraModel.centred(768, 494, 952.4, 816.3)
    down = CameraSpec(25.0, 0.04, eye, CameraMount.downward(np.array([0, 0, -0.1])))
    return compose(RAPTOR, "field", HMark(), {"down": down}, Light())


@pytest.fixture(scope="module")
def model(composed) -> mujoco.MjModel:
    return composed.model()


def test_every_name_that_a_world_needs_is_there(model):
    for scene in scenes():
        model = compose(RAPTOR, scene, HMark(), {}, Light(), dip=True).model()
        for body in (names.VEHICLE, names.MAIN_ROTOR, names.TAIL_ROTOR, names.SHADOW):
            assert model.body(body).id > 0
        for joint in (names.VEHICLE, names.MAIN_ROTOR, names.TAIL_ROTOR):
            assert model.joint(joint).id >= 0
        assert model.light(names.SUN).id >= 0
        assert model.geom(names.FAR_DISC).id >= 0
    assert (model.nq, model.nv) == (9, 8)


def test_mass_inertia_and_hubs_are_the_raptor_s(model):
    body = model.body(names.VEHICLE)
    assert model.body_mass.sum() == pytest.approx(5.0, abs=1e-4)
    assert body.inertia == pytest.approx([0.097, 0.184, 0.151])
    assert body.ipos == pytest.approx(0.0)
    assert model.body(names.MAIN_ROTOR).pos == pytest.approx([0, 0, 0.22])
    assert model.body(names.TAIL_ROTOR).pos == pytest.approx([-0.90, -0.05, 0.08])


def test_only_skids_and_ground_collide(model):
    solid = {model.geom(i).name for i in range(model.ngeom) if model.geom_contype[i] or model.geom_conaffinity[i]}
    assert solid == {"ground", "skid_left", "skid_right", "tail_skid"}


def settle(model, sink: float, lift: float, roll: float = 0.0, pitch: float = 0.0) -> tuple[np.ndarray, mujoco.MjData]:
    """Heights (N,) [m] of the skids' plane while the vehicle touches down with `lift` of its weight for a second."""
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, SKIDS + 0.04, *quaternion(roll, pitch, 0.3)]
    data.qvel[2] = -sink
    heights = []
    for _ in range(1500):
        data.xfrc_applied[model.body(names.VEHICLE).id, 2] = lift * WEIGHT if data.time < 1.0 else 0.0
        mujoco.mj_step(model, data)
        heights.append(data.qpos[2] - SKIDS)
    return np.array(heights), data


@pytest.mark.parametrize(("sink", "lift"), [(0.5, 0.0), (0.5, 0.95), (0.3, 0.95)])
def test_a_touchdown_neither_bounces_nor_jitters(model, sink, lift):
    heights, data = settle(model, sink, lift)
    first = int(np.argmax(heights < 0.0))
    assert heights[first:].max() < 0.005
    assert heights.min() > -0.02
    assert heights[-1] == pytest.approx(0.0, abs=1e-3)
    assert np.abs(data.qvel[:6]).max() < 1e-5


def test_a_tilted_touchdown_ends_upright(model):
    heights, data = settle(model, 0.5, 0.95, roll=0.08, pitch=0.06)
    assert heights[-1] == pytest.approx(0.0, abs=1e-3)
    assert data.body(names.VEHICLE).xmat[8] > 0.9999


def test_turning_rotors_do_not_move_the_body(model):
    """Their gyroscopic reaction is the flapping model's."""
    ends = []
    for speed in (0.0, -157.0):
        data = mujoco.MjData(model)
        data.qpos[:7] = [0, 0, 20, *quaternion(0.1, 0.05, 1.0)]
        data.qvel[3:6] = [0.5, -0.4, 0.3]
        for _ in range(250):
            data.qvel[6:] = [speed, -5 * speed]
            mujoco.mj_step(model, data)
        ends.append(data.qpos[:7].copy())
    assert ends[1] == pytest.approx(ends[0], abs=1e-6)


def test_the_mark_lies_in_the_plane_that_skids_touch(model):
    assert model.geom("pad").pos[2] == 0.0
    assert model.geom(names.GROUND).pos[2] == 0.0
    assert model.geom("ground_seen").pos[2] == pytest.approx(-0.001)


def test_cameras_aboard_draw_no_part_of_the_vehicle(model):
    for i in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[i]] == model.body(names.VEHICLE).id:
            assert model.geom_group[i] == names.VEHICLE_GROUP, model.geom(i).name


def test_a_composed_scene_survives_the_way_to_another_process(composed):
    copy = pickle.loads(pickle.dumps(composed))
    assert copy.xml == composed.xml
    assert copy.model().ngeom == composed.model().ngeom


def test_an_unknown_scene_is_answered_with_those_there_are():
    with pytest.raises(ValueError, match=rf"scene 'moon': unknown; there are: {', '.join(scenes())}"):
        compose(RAPTOR, "moon", None, {}, Light())


def test_a_missing_mesh_is_named(tmp_path):
    shutil.copy(RAPTOR, tmp_path / "mine.xml")
    shutil.copytree(RAPTOR.with_suffix(""), tmp_path / "raptor90")
    (tmp_path / "raptor90" / "boom.obj").unlink()
    with pytest.raises(FileNotFoundError, match=r"mine\.xml: needs '.*boom\.obj', which is not there"):
        compose(tmp_path / "mine.xml", "field", None, {}, Light())


def test_a_misspelt_tag_is_named(tmp_path):
    (tmp_path / "mine.xml").write_text("<mujoco><worldbody><body nme='vehicle'/></worldbody></mujoco>")
    with pytest.raises(ValueError, match=r"mine\.xml: not usable as MJCF: .*nme"):
        compose(tmp_path / "mine.xml", "field", None, {}, Light())


def test_a_vehicle_without_the_body_vehicle_is_refused(tmp_path):
    (tmp_path / "mine.xml").write_text("<mujoco><worldbody><body name='car'/></worldbody></mujoco>")
    with pytest.raises(ValueError, match="has no body named 'vehicle'"):
        compose(tmp_path / "mine.xml", "field", None, {}, Light())


@settings(max_examples=40, deadline=None)
@given(
    leg=st.floats(0.2, 3.0),
    width=st.floats(0.2, 3.0),
    stroke=st.floats(0.05, 0.45),
    texels=st.integers(40, 120),
)
def test_the_painted_area_is_the_outline_s(leg, width, stroke, texels):
    mark = HMark(leg, width, stroke * min(leg, width))
    side = mark.square
    share = coverage(mark.outline(), side, texels)
    x, y = mark.outline().T
    shoelace = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert share.sum() * (side / texels) ** 2 == pytest.approx(shoelace, rel=1e-9)
    assert share.min() >= -1e-9
    assert share.max() <= 1 + 1e-9
    assert np.abs(share - share[::-1, ::-1]).max() < 1e-9


def test_texels_on_an_edge_are_mixed_by_area():
    """A unit square displaced by a third of a texel: the shares are known by hand."""
    texel = 0.1
    square = np.array([(-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)]) + np.array([texel / 3, -texel / 4])
    share = coverage(square, 1.0, 10)
    assert share[4, 2:8] == pytest.approx([0, 2 / 3, 1, 1, 1, 1 / 3])
    assert share[2:8, 4] == pytest.approx([0, 3 / 4, 1, 1, 1, 1 / 4])


def test_the_mark_s_picture_stands_upright():
    """The bar's ends are asphalt above and below, paint on the left and right; leg 1 m, width 0.6 m."""
    mark = HMark(leg=1.0, width=0.6, stroke=0.15)
    picture = paint_mark(mark)[..., 0] / 255.0
    texels = len(picture)

    def at(x: float, y: float) -> float:
        side = mark.square
        return picture[int((0.5 - y / side) * texels), int((0.5 + x / side) * texels)]

    assert at(-0.25, 0.45) == pytest.approx(PAINT, abs=0.01)
    assert at(0.0, 0.45) == pytest.approx(ASPHALT, abs=0.08)
    assert at(0.0, 0.0) == pytest.approx(PAINT, abs=0.01)
    assert at(0.45, 0.0) == pytest.approx(ASPHALT, abs=0.08)


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(-0.2, 0.2), y=st.floats(-0.2, 0.2), radius=st.floats(0.08, 0.25), texels=st.integers(100, 200),
)  # fmt: skip
def test_a_painted_disc_has_its_area_and_its_centre(x, y, radius, texels):
    share = disc_coverage(x, y, radius, 1.0, texels)
    assert share.min() >= 0 and share.max() <= 1
    # the edge is taken as straight within a texel: its sagitta is texel^2 / (8 radius), on average two thirds of it
    texel = 1.0 / texels
    assert share.sum() * texel**2 == pytest.approx(np.pi * radius**2, rel=texel**2 / (4 * radius**2) + 1e-9)
    centres = (np.arange(texels) + 0.5) * texel - 0.5
    assert (share.sum(axis=0) @ centres) / share.sum() == pytest.approx(x, abs=0.02 * texel)
    assert (share.sum(axis=1) @ centres[::-1]) / share.sum() == pytest.approx(y, abs=0.02 * texel)


def test_texels_on_a_disc_s_edge_are_mixed_by_area():
    """Against 64 x 64 points a texel."""
    texels, fine = 20, 64
    share = disc_coverage(0.013, -0.021, 0.31, 1.0, texels)
    c = (np.arange(texels * fine) + 0.5) / (texels * fine) - 0.5
    inside = np.hypot(c[None, :] - 0.013, c[::-1, None] + 0.021) < 0.31
    counted = inside.reshape(texels, fine, texels, fine).mean(axis=(1, 3))
    # the sagitta over the longest chord of a texel, and the counting's own grain
    assert np.abs(share - counted).max() < 2 * 0.05 / (8 * 0.31) + 2 / fine


def test_the_ring_mark_is_painted_where_its_shapes_are():
    mark = RingMark()
    picture = paint_mark(mark, 1024)[..., 0] / 255.0

    def at(x: float, y: float) -> float:
        return picture[int((0.5 - y / mark.square) * 1024), int((0.5 + x / mark.square) * 1024)]

    for inner, outer in mark.rings:
        assert at((inner + outer) / 2, 0.0) == pytest.approx(PAINT, abs=0.01)
        assert at(0.0, -(inner + outer) / 2) == pytest.approx(PAINT, abs=0.01)
    for x, y in ((0.0, 0.0), (0.335, 0.0), (0.18, 0.0), (0.045, 0.0), (0.52, 0.0), *mark.holes()):
        assert at(x, y) == pytest.approx(ASPHALT, abs=0.08)
    assert at(0.06, 0.06) == pytest.approx(GREY, abs=0.01)  # between the holes
    assert at(0.0, 0.64) == pytest.approx(PAINT, abs=0.01)  # guide line: above the rings only
    assert at(0.0, -0.64) == pytest.approx(ASPHALT, abs=0.08)
    assert at(-0.9, 0.17) == pytest.approx(PAINT, abs=0.01)  # the left T's beam
    assert at(0.75, -0.2) == pytest.approx(PAINT, abs=0.01)  # the right T's foot


def test_a_deck_s_horizon_dips_by_its_height_over_the_sea():
    compiled = compose(RAPTOR, "deck", RingMark(), {}, Light(), dip=True).model()
    assert compiled.geom(names.FAR_DISC).pos[2] < compiled.geom("sea_seen").pos[2] < -3.0
    assert compiled.geom("pad").pos[2] == 0.0
    assert compiled.geom("ground_seen").pos[2] == pytest.approx(-0.001)


def test_level_ground_is_lit_alike_from_every_elevation():
    for degrees in (5, 30, 90):
        light = Light(np.radians(degrees))
        assert light.ambient + Light.BEAM * np.sin(light.sun_elevation) == pytest.approx(Light.HORIZONTAL)
    assert Light().illuminance == pytest.approx(1.0, abs=0.01)
    assert Light(np.radians(10)).illuminance < 0.6 * Light(np.radians(80)).illuminance


@pytest.mark.parametrize("azimuth_deg", [0, 90, 225])
def test_a_shadow_falls_away_from_the_sun(azimuth_deg):
    azimuth = np.radians(azimuth_deg)
    spot = Light(np.radians(45), azimuth).shadow(np.array([3.0, 4.0, 10.0]))
    assert spot - [3, 4] == pytest.approx([-10 * np.sin(azimuth), -10 * np.cos(azimuth)], abs=1e-9)


def test_a_sun_below_the_horizon_is_refused():
    with pytest.raises(ValueError, match="sun elevation"):
        Light(-0.1)

import cv2
import numpy as np
import pytest

from flightlog.readers import read_flight

rerun = pytest.importorskip("rerun", reason="the replay needs rerun-sdk")

from rerun.chunk import RrdReader  # noqa: E402

from flightlog.errors import UserError  # noqa: E402
from flightlog.recorder import Recorder, write_flight  # noqa: E402
from flightlog.replay import TIMELINE, ReplayWriter  # noqa: E402
from flightlog.replay_scene import disc, shaded, visible  # noqa: E402

SQUARE = np.array([[20.0, 20.0], [60.0, 20.0], [60.0, 50.0], [20.0, 20.0]])
CUBE = (
    np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float),
    np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]
    ),
)  # fmt: skip


def picture(k):
    image = np.full((120, 160), 40 + k, np.uint8)
    cv2.rectangle(image, (20, 20), (60, 50), 220, -1)
    return image


@pytest.fixture(scope="module")
def recording(tmp_path_factory, logged, equipment):
    """Path of a recording of the known flight."""
    file = tmp_path_factory.mktemp("replay") / "replay.rrd"
    flight = read_flight(logged.folder)
    with ReplayWriter(
        file, meshes={"hull": (*CUBE, (0.8, 0.1, 0.1, 1.0))}, cameras=equipment.cameras, equipment=equipment,
        rotor=((0, 0, 0.2), 0.7), picture_rate=5.0,
    ) as replay:  # fmt: skip
        for k in range(120):
            replay.add_frame("down", k / 10, picture(k), [SQUARE] if k < 60 else [])
        replay.add_frame("forward_a", 0.0, np.zeros((90, 120, 3), np.uint8))
        replay.event(0.0, "to P1")
        replay.event(6.5, "GPS lost", "WARN")
        replay.finish(flight.measured, flight.truth)
    return file


@pytest.fixture(scope="module")
def read(recording):
    """(entity, component) -> times [s] and values, static ones at no time."""
    found = {}
    for chunk in RrdReader(str(recording)).stream().to_chunks():
        batch = chunk.to_record_batch()
        times = [] if chunk.is_static else batch.column(TIMELINE).cast("int64").to_pylist()
        for name in batch.schema.names:
            if ":" not in name:
                continue
            times_so_far, values = found.setdefault((chunk.entity_path, name), ([], []))
            times_so_far += [t / 1e9 for t in times]
            values += batch.column(name).to_pylist()
    return found


def scalars(read, entity):
    times, values = read[entity, "Scalars:scalars"]
    return np.array(times), np.array([v[0] for v in values])


def test_the_scene_has_ground_pad_mark_vehicle_disc_and_cameras(read):
    entities = {entity for entity, _ in read}
    for part in ("ground", "pad/ground", "pad/mark", "vehicle/hull", "vehicle/rotor_disc"):
        assert (f"/world/{part}", "Mesh3D:vertex_positions") in read
    assert "/world/vehicle/cameras/down" in entities
    assert ("/world/vehicle/cameras/down", "Pinhole:image_from_camera") in read


def test_the_mark_lies_where_the_outline_says(read, equipment):
    _, (vertices,) = read["/world/pad/mark", "Mesh3D:vertex_positions"]
    corners = {tuple(np.round(v[:2], 6)) for v in vertices}
    assert {tuple(c) for c in np.round(equipment.mark.outline(), 6)} <= corners


def test_the_vehicle_moves_as_it_truly_did(read, logged):
    times, values = read["/world/vehicle", "Transform3D:translation"]
    assert len(times) == 600
    np.testing.assert_allclose(np.array(values)[:, 0], logged.position(np.array(times)), atol=1e-5)
    _, turns = read["/world/vehicle", "Transform3D:quaternion"]
    assert np.shape(turns) == (600, 1, 4)


def test_both_paths_are_drawn_piece_by_piece(read, logged):
    for name, offset in (("true", (0, 0, 0)), ("fused", (0.1, 0, 0.05))):
        times, strips = read[f"/world/path/{name}", "LineStrips3D:strips"]
        pieces = np.array(strips)[:, 0]
        assert pieces.shape == (119, 2, 3)
        np.testing.assert_allclose(pieces[:, 1], logged.position(np.array(times)) + offset, atol=1e-5)
        np.testing.assert_allclose(pieces[1:, 0], pieces[:-1, 1], atol=1e-6)


def test_a_path_has_a_gap_where_the_estimate_jumps(tmp_path):
    with Recorder(tmp_path / "flight") as recorder:
        write_flight(tmp_path / "flight", {})
        for k in range(20):
            recorder.topic("measured", "estimate").append((k / 10, 0.1 * k, 0.0, 0.0 if k < 7 else 10.0, *[0.0] * 18))
    with ReplayWriter(tmp_path / "replay.rrd", meshes={}, cameras={}) as replay:
        replay.finish(read_flight(tmp_path / "flight").measured, {})
    chunks = RrdReader(str(tmp_path / "replay.rrd")).stream().to_chunks()
    batches = [c.to_record_batch() for c in chunks if c.entity_path == "/world/path/fused" and not c.is_static]
    strips = np.array([strip for batch in batches for strip in batch.column("LineStrips3D:strips").to_pylist()])[:, 0]
    assert len(strips) == 18
    assert np.abs(np.diff(strips[..., 2], axis=1)).max() == 0.0


def test_heights_of_all_sources_are_plotted(read, logged):
    for name, offset in (
        ("truth", 0.0),
        ("fusion", 0.05),
        ("baro", 0.5),
        ("gps", 0.0),
        ("sonar", 0.0),
        ("vision", 0.0),
    ):
        times, values = scalars(read, f"/height/{name}")
        assert len(times) > 5, name
        np.testing.assert_allclose(values, logged.position(times)[:, 2] + offset, atol=1e-6, err_msg=name)
    np.testing.assert_allclose(scalars(read, "/height_error/baro")[1], 0.5, atol=1e-6)


def test_controls_are_in_degrees_and_rotor_speed_in_rpm(read):
    np.testing.assert_allclose(scalars(read, "/controls/collective")[1], np.degrees(0.1))
    np.testing.assert_allclose(scalars(read, "/throttle/throttle")[1], 0.6)
    np.testing.assert_allclose(scalars(read, "/rotor/measured")[1], 157.0 * 30 / np.pi)


def test_events_are_text_with_their_times(read):
    times, texts = read["/events", "TextLog:text"]
    assert times == [0.0, 6.5]
    assert texts == [["to P1"], ["GPS lost"]]
    assert read["/events", "TextLog:level"][1] == [["INFO"], ["WARN"]]


def test_pictures_come_at_no_more_than_their_rate_and_as_they_were(read):
    times, blobs = read["/cameras/down", "EncodedImage:blob"]
    np.testing.assert_allclose(times, np.arange(60) / 5)
    jpeg = (
        np.array(blobs[10][0], np.uint8)
        if not isinstance(blobs[10][0], bytes)
        else np.frombuffer(blobs[10][0], np.uint8)
    )
    decoded = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE)
    assert np.abs(decoded.astype(int) - picture(20)).mean() < 2.0


def test_what_vision_found_lies_on_the_picture_and_goes_when_it_is_lost(read):
    times, strips = read["/cameras/down/seen", "LineStrips2D:strips"]
    shown = [s for s in strips if s is not None]
    assert len(times) == 60
    drawn = [bool(s) for s in shown]
    assert drawn == [True] * 30 + [False] * 30
    # rerun's pixels begin at the picture's corner
    np.testing.assert_allclose(shown[0][0], SQUARE[:2] + 0.5, atol=0.05)


def test_the_layout_comes_with_the_recording(recording):
    assert len(RrdReader(str(recording)).blueprints()) == 1


def test_lines_are_cut_at_the_picture():
    pieces = visible(np.array([[-100.0, 59.5], [300.0, 59.5], [300.0, 500.0]]), 160, 120)
    assert len(pieces) == 1
    np.testing.assert_allclose(pieces[0], [[0.0, 60.0], [160.0, 60.0]], atol=0.07)
    assert visible(np.array([[np.nan, 0.0], [1.0, 1.0]]), 160, 120) == []
    assert visible(np.zeros((0, 2)), 160, 120) == []


def test_a_cube_keeps_its_edges_and_a_disc_is_smooth():
    corners, normals = shaded(*CUBE)
    assert corners.shape == normals.shape == (36, 3)
    np.testing.assert_allclose(np.abs(normals).max(axis=1), 1.0)  # each along one axis: no edge is smoothed
    outward = np.einsum("ij,ij->i", normals, corners - 0.5)
    assert np.all(outward > 0)
    flat, up = shaded(*disc(np.zeros(3), 1.0))
    assert np.linalg.norm(flat, axis=1).max() == pytest.approx(1.0)
    assert set(np.unique(np.round(np.abs(up[:, 2]), 9))) == {1.0}


def test_a_shallow_crease_is_smoothed():
    bent = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0.2], [2, 1, 0.2]])
    corners, normals = shaded(bent, np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]))
    at_crease = normals[np.isclose(corners[:, 0], 1.0) & np.isclose(corners[:, 1], 0.0)]
    np.testing.assert_allclose(at_crease[:, 1], 0.0, atol=1e-9)
    # between the two faces' own normals
    assert np.all((at_crease[:, 0] < -0.05) & (at_crease[:, 0] > -0.19))


def test_a_place_that_cannot_be_written_is_one_line(tmp_path, equipment):
    with pytest.raises(UserError, match=r"replay\.rrd: cannot be written"):
        ReplayWriter(tmp_path / "nowhere" / "replay.rrd", meshes={}, cameras={})


def test_without_equipment_truth_or_meshes_there_still_is_a_replay(tmp_path, logged):
    file = tmp_path / "replay.rrd"
    with ReplayWriter(file, meshes={}, cameras={}) as replay:
        replay.finish(read_flight(logged.folder, truth=False).measured, {})
    entities = {chunk.entity_path for chunk in RrdReader(str(file)).stream().to_chunks()}
    assert {"/world/vehicle", "/world/vehicle/axes", "/height/fusion"} <= entities


def test_pictures_come_after_what_moves_so_that_a_viewer_shows_the_scene_at_once(recording):
    entities = [chunk.entity_path for chunk in RrdReader(str(recording)).stream().to_chunks()]
    pictures = [entity.startswith("/cameras") for entity in entities]
    assert any(pictures)
    assert pictures == sorted(pictures)
    assert [p.name for p in recording.parent.iterdir()] == ["replay.rrd"]


def test_a_recording_that_cannot_be_put_in_order_stays_as_it_was(tmp_path, equipment):
    file = tmp_path / "replay.rrd"
    (tmp_path / "replay.rrd.part").mkdir()
    with ReplayWriter(file, meshes={}, cameras=equipment.cameras) as replay:
        replay.add_frame("down", 0.0, picture(0))
    assert any(c.entity_path == "/cameras/down" for c in RrdReader(str(file)).stream().to_chunks())

"""`helideck see pad`: what it says about pictures, real ones among them, and about what is wrong."""

import json
import math
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from flightlog.camera import CameraModel
from helideck.cli import main

KEYS = {
    "image", "found", "height_m", "forward_m", "left_m", "heading_deg", "height_std_m", "forward_std_m", "left_std_m",
    "heading_std_deg", "quality", "attitude", "visible",
}  # fmt: skip
DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data"))


def drawn(roll_deg: float = 0.0, height: float = 6.0, size: float = 1.0, fx: float = 600.0) -> np.ndarray:
    """A level H, its axis forward, seen from `height` over (0.4 m ahead, 0.3 m left) of it by a rolled carrier."""
    sub, shape = 8, (480, 640)
    v, u = np.meshgrid(
        (np.arange(shape[0] * sub) + 0.5) / sub - 0.5, (np.arange(shape[1] * sub) + 0.5) / sub - 0.5, indexing="ij"
    )
    x, y = (u - (shape[1] - 1) / 2) / fx, (v - (shape[0] - 1) / 2) / fx
    roll = math.radians(roll_deg)
    # image right lies lower by the roll, which turns about forward
    right = x * math.cos(roll) - math.sin(roll)
    down = x * math.sin(roll) + math.cos(roll)
    across, along = np.abs(right / down * height + 0.3), np.abs(-y / down * height - 0.4)
    half = size / 2
    h = (along <= half) & (across <= half) & ((across >= half - 0.2 * size) | (along <= 0.1 * size))
    return np.asarray(cv2.resize(np.where(h, 200, 60).astype(np.uint8), shape[::-1], interpolation=cv2.INTER_AREA))


def seen(capsys: pytest.CaptureFixture[str], *words: str) -> list[dict]:
    assert main(["see", "pad", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("roll_deg", [0.0, 8.0])
def test_where_the_pad_is_and_which_way_it_points(tmp_path, capsys, roll_deg) -> None:
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), drawn(roll_deg))
    (answer,) = seen(capsys, str(path), "--size", "1", "--fx", "600", "--roll-deg", str(roll_deg), "--pitch-deg", "0")
    assert answer.keys() == KEYS and answer["found"] and answer["attitude"] == "given"
    # the H lies 0.4 m ahead and 0.3 m to the left
    assert answer["forward_m"] == pytest.approx(0.4, abs=0.01)
    assert answer["left_m"] == pytest.approx(0.3, abs=0.01)
    assert answer["height_m"] == pytest.approx(6.0, abs=0.02)
    assert answer["heading_deg"] == pytest.approx(0.0, abs=0.3)
    assert answer["visible"] == 1.0


def test_tilt_is_solved_where_the_mark_is_large(tmp_path, capsys) -> None:
    for name, height in (("near", 3.0), ("far", 14.0)):
        cv2.imwrite(str(tmp_path / f"{name}.png"), drawn(4.0, height))
    near, far = seen(capsys, str(tmp_path / "near.png"), str(tmp_path / "far.png"), "--size", "1", "--fx", "600")
    assert near["attitude"] == "solved" and far["attitude"] == "level"
    assert near["left_m"] == pytest.approx(0.3, abs=0.06)
    # taken to be level, the far one is off by the tilt, and says so
    assert abs(far["left_m"] - 0.3) > 0.5
    assert abs(far["left_m"] - 0.3) < 3.0 * far["left_std_m"]


def test_attitudes_come_from_a_table_by_name_or_by_time(tmp_path, capsys) -> None:
    path = tmp_path / "frame7_12.50.png"
    cv2.imwrite(str(path), drawn(8.0))
    by_name, by_time = tmp_path / "names.csv", tmp_path / "times.csv"
    by_name.write_text("image,roll_deg,pitch_deg\nframe7_12.50.png,8,0\n")
    by_time.write_text("t, roll_deg, pitch_deg\n12.45,7,0\n12.55,9,0\n")
    for table in (by_name, by_time):
        (answer,) = seen(capsys, str(path), "--size", "1", "--fx", "600", "--attitude", str(table))
        assert answer["left_m"] == pytest.approx(0.3, abs=0.01)
    by_time.write_text("t,roll_deg,pitch_deg\n99,7,0\n")
    assert main(["see", "pad", str(path), "--size", "1", "--fx", "600", "--attitude", str(by_time)]) == 2
    assert "no row within 0.1 s of 12.5" in capsys.readouterr().err


def test_the_lens_is_taken_out(tmp_path, capsys) -> None:
    flat = drawn()
    camera = CameraModel(640, 480, 600.0, 600.0, 319.5, 239.5, (-0.25, 0.08, 0.0, 0.0, 0.0))
    v, u = np.mgrid[:480, :640].astype(float)
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()]))
    at = rays[:, :2] * 600.0 + [319.5, 239.5]
    bent = cv2.remap(flat, *(at[:, i].reshape(480, 640).astype(np.float32) for i in (0, 1)), cv2.INTER_LINEAR)
    path = tmp_path / "bent.png"
    cv2.imwrite(str(path), bent)
    (answer,) = seen(capsys, str(path), "--size", "1", "--fx", "600", "--dist", "-0.25,0.08")
    assert answer["height_m"] == pytest.approx(6.0, abs=0.03)


def test_nothing_found_is_told_with_nulls_and_exit_0(tmp_path, capsys) -> None:
    path = tmp_path / "grey.png"
    cv2.imwrite(str(path), np.full((200, 300), 90, np.uint8))
    (answer,) = seen(capsys, str(path), "--size", "1", "--fx", "600")
    assert answer.keys() == KEYS and answer["found"] is False
    assert all(answer[key] is None for key in KEYS - {"image", "found"})
    assert main(["see", "pad", str(path), "--size", "1", "--fx", "600"]) == 0
    assert "not found" in capsys.readouterr().out


def test_one_bad_picture_does_not_stop_the_others(tmp_path, capsys) -> None:
    good, bad = tmp_path / "good.png", tmp_path / "bad.png"
    cv2.imwrite(str(good), drawn())
    bad.write_text("no picture")
    assert main(["see", "pad", str(bad), str(good), "--size", "1", "--fx", "600", "--json"]) == 2
    out = capsys.readouterr()
    answers = json.loads(out.out)
    assert [answer["found"] for answer in answers] == [None, True]
    assert out.err.count("\n") == 1 and "bad.png: not a picture" in out.err


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--size", "0", "--fx", "600"], "--size 0.0"),
        (["--size", "nan", "--fx", "600"], "--size nan"),
        (["--size", "1", "--fx", "-3"], "--fx -3.0"),
        (["--size", "1"], "--fx"),
        (["--fx", "600"], "--size"),
        (["--size", "1", "--fx", "600", "--fy", "0"], "--fy 0.0"),
        (["--size", "1", "--fx", "600", "--cx", "9000"], "--cx 9000.0"),
        (["--size", "1", "--fx", "600", "--dist", "a,b"], "--dist a,b"),
        (["--size", "1", "--fx", "600", "--dist", "-9,0"], "cannot be undone"),
        (["--size", "1", "--fx", "600", "--roll-deg", "3"], "go together"),
        (["--size", "1", "--fx", "600", "--roll-deg", "80", "--pitch-deg", "0"], "within 60"),
        (["--size", "1", "--fx", "600", "--attitude", "none.csv"], "none.csv: no such file"),
        (["--size", "1", "--fx", "600", "--mark", "x"], "mark"),
    ],
)
def test_wrong_words_are_answered_in_one_line(tmp_path, capsys, words, part) -> None:
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), drawn())
    assert main(["see", "pad", str(path), *words]) == 2
    out = capsys.readouterr()
    assert out.out == "" and out.err.count("\n") == 1 and part in out.err


def test_the_real_pad_is_found_and_its_height_goes_with_the_marker_beside_it(capsys) -> None:
    """A small white H on a dark octagon, many pictures smeared; every twentieth of the pictures."""
    folder = DATA / "helipad"
    if not folder.is_dir():
        pytest.skip(f"no pictures of a real pad: {folder} is missing (HELIDECK_DATA names the folder of measured data)")
    matrix, lens = np.load(folder / "cam_mat.pca.npy"), np.load(folder / "dist.pca.npy").ravel()
    paths = sorted((folder / "frames").glob("*.jpg"))[::20]
    words = ["--size", "0.0482", "--fx", str(matrix[0, 0]), "--fy", str(matrix[1, 1]), "--cx", str(matrix[0, 2]),
             "--cy", str(matrix[1, 2]), "--dist", ",".join(map(str, lens))]  # fmt: skip
    answers = seen(capsys, *map(str, paths), *words)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_6X6_250))
    corners = 0.09 * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]], np.float32)
    heights, both = [], 0
    for path, answer in zip(paths, answers, strict=True):
        found, ids, _ = detector.detectMarkers(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))
        if ids is None or 0 not in ids.ravel():
            continue
        both += 1
        if answer["found"]:
            at = found[list(ids.ravel()).index(0)].astype(np.float32)
            _, _, position = cv2.solvePnP(corners, at, matrix, lens, flags=cv2.SOLVEPNP_IPPE_SQUARE)
            heights.append(answer["height_m"] / float(position[2, 0]))
    assert len(heights) >= 0.6 * both
    assert np.std(heights) / np.mean(heights) < 0.07
    assert all(0.9 < height < 1.1 for height in heights)

"""`helideck see flow`."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from helideck.cli import main

WORDS = ["--fx", "400", "--height", "1.0", "--dt", "0.05", "--json"]


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    """The ground moves 4 px to the left and 2 px down in the picture: the camera went right and forward."""
    rng = np.random.default_rng(4)
    ground = cv2.GaussianBlur(rng.standard_normal((300, 400)), (0, 0), 2.0)
    ground = np.clip(120 + 25 * ground / ground.std(), 0, 255).astype(np.uint8)
    paths = tmp_path / "one.png", tmp_path / "two.png"
    cv2.imwrite(str(paths[0]), ground[20:260, 20:340])
    cv2.imwrite(str(paths[1]), ground[18:258, 24:344])
    return paths


def see(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, dict]:
    code = main(["see", "flow", *map(str, words)])
    return code, json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("variant", ["helideck", "published"])
def test_velocity_from_two_pictures(capsys, pair, variant) -> None:
    code, answer = see(capsys, *pair, *WORDS, "--variant", variant)
    assert code == 0
    assert answer["found"]
    assert answer["vx_m_s"] == pytest.approx(2 / 400 / 0.05, abs=0.002)
    assert answer["vy_m_s"] == pytest.approx(-4 / 400 / 0.05, abs=0.002)
    assert 0.5 < answer["quality"] <= 1.0


def test_turning_is_taken_out(capsys, pair) -> None:
    """Nose-up at 0.1 rad/s the ground moves down in the picture by 0.005 rad: all that it did was that."""
    _, plain = see(capsys, *pair, *WORDS)
    _, turned = see(capsys, *pair, *WORDS, "--gyro", "0,-0.1,0")
    assert turned["vx_m_s"] - plain["vx_m_s"] == pytest.approx(-0.1, rel=0.01)
    assert turned["vy_m_s"] == pytest.approx(plain["vy_m_s"], abs=1e-3)


def test_nothing_in_common_is_said_so(capsys, pair, tmp_path: Path) -> None:
    blank = tmp_path / "blank.png"
    cv2.imwrite(str(blank), np.full((240, 320), 128, np.uint8))
    code, answer = see(capsys, pair[0], blank, *WORDS)
    assert code == 0
    assert not answer["found"]
    assert answer["vx_m_s"] is None
    assert answer["quality"] == 0.0


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--height", "-1"], "--height -1.0"),
        (["--dt", "0"], "--dt 0.0"),
        (["--gyro", "1,2"], "--gyro 1,2"),
        (["--fx", "-3"], "--fx -3.0"),
        (["--roll-deg", "95"], "--roll-deg"),
    ],
)
def test_words_that_make_no_sense_are_refused(capsys, pair, words, complaint) -> None:
    given = dict(zip(WORDS[:-1:2], WORDS[1::2], strict=False)) | dict([words])
    code, answer = see(capsys, *pair, *(word for item in given.items() for word in item), "--json")
    assert code == 2
    assert complaint in answer["error"]


def test_a_picture_that_is_none_is_named(capsys, pair, tmp_path: Path) -> None:
    code, answer = see(capsys, pair[0], tmp_path / "missing.png", *WORDS)
    assert code == 2
    assert "missing.png" in answer["error"]
    small = tmp_path / "small.png"
    cv2.imwrite(str(small), np.zeros((100, 100), np.uint8))
    code, answer = see(capsys, pair[0], small, *WORDS)
    assert code == 2
    assert "100x100" in answer["error"]

"""`helideck see horizon`: what it answers, and what it says of real pictures."""

import csv
import json
import math
import os
from pathlib import Path

import cv2
import numpy as np
import pytest

from helideck.cli import main

DATA = Path(os.environ.get("HELIDECK_DATA", Path(__file__).parents[3] / "shared" / "data"))
KEYS = {"image", "found", "roll_deg", "pitch_deg", "roll_std_deg", "pitch_std_deg", "line"}


def paint(path: Path, roll_deg: float, row: float) -> Path:
    """A sky over ground, right side down positive."""
    y, x = np.mgrid[0:240, 0:320]
    above = y < row - (x - 159.5) * math.tan(math.radians(roll_deg))
    noise = np.random.default_rng(1).normal(0, 2, (240, 320, 1))
    cv2.imwrite(str(path), np.clip(np.where(above[:, :, None], (230, 190, 150), (60, 90, 70)) + noise, 0, 255))
    return path


def see(capsys, *words: str) -> tuple[int, list]:
    code = main(["see", "horizon", *words, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_one_entry_a_picture(tmp_path: Path, capsys) -> None:
    first = paint(tmp_path / "a.png", 10.0, 140.0)
    blank = tmp_path / "b.png"
    cv2.imwrite(str(blank), np.full((240, 320, 3), 128, np.uint8))
    code, answers = see(capsys, str(first), str(blank), "--fx", "300")
    assert code == 0
    assert [set(answer) for answer in answers] == [KEYS, KEYS]
    assert answers[0]["found"] is True
    assert answers[0]["roll_deg"] == pytest.approx(10.0, abs=0.2)
    away = (140.0 - 0.5 - 119.5) * math.cos(math.radians(10.0))
    assert answers[0]["pitch_deg"] == pytest.approx(math.degrees(math.atan(away / 300)), abs=0.1)
    assert 0.0 < answers[0]["roll_std_deg"] < 0.5
    assert answers[1]["found"] is False
    assert answers[1]["roll_deg"] is None


def test_the_height_takes_the_dip_off(tmp_path: Path, capsys) -> None:
    picture = str(paint(tmp_path / "a.png", 0.0, 120.0))
    _, low = see(capsys, picture, "--fx", "300")
    _, high = see(capsys, picture, "--fx", "300", "--height", "1000")
    dip = math.degrees(math.sqrt(2 * 1000 / 6_371_000))
    assert low[0]["pitch_deg"] - high[0]["pitch_deg"] == pytest.approx(dip, abs=1e-6)


def test_published_takes_pairs(tmp_path: Path, capsys) -> None:
    focal, pitch = 300.0, -5.0
    rows = [120 + focal * math.tan(math.radians(pitch)), 120 + focal * math.tan(math.radians(pitch - 10.0))]
    paths = [str(paint(tmp_path / f"{k}.png", 4.0, row)) for k, row in zip("ab", rows, strict=True)]
    code, answers = see(capsys, *paths, *paths, "--fx", "300", "--variant", "published")
    assert code == 0
    assert len(answers) == 2
    assert answers[0]["roll_deg"] == pytest.approx(4.0, abs=1.0)
    assert answers[0]["pitch_deg"] == pytest.approx(pitch, abs=1.0)
    assert main(["see", "horizon", paths[0], "--fx", "300", "--variant", "published"]) == 2
    assert "pairs, A then B" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["missing.png", "--fx", "300"], "no such file"),
        (["a.png", "--fx", "-3"], "--fx -3"),
        (["a.png", "--fx", "300", "--height", "-1"], "--height -1"),
    ],
)
def test_what_makes_no_sense_is_told(tmp_path: Path, monkeypatch, capsys, words: list[str], said: str) -> None:
    monkeypatch.chdir(tmp_path)
    paint(tmp_path / "a.png", 0.0, 120.0)
    assert main(["see", "horizon", *words]) == 2
    assert said in capsys.readouterr().err


def test_real_pictures(capsys) -> None:
    """82 frames of a fixed-wing aircraft, the line drawn by hand: slope and offset of the picture's height."""
    folder = DATA / "horizon_uav"
    if not folder.is_dir():
        pytest.skip(f"no pictures of real horizons: {folder} is missing (HELIDECK_DATA names its parent)")
    with (folder / "label.csv").open() as file:
        labels = {row["filename"]: float(row["slope"]) for row in csv.DictReader(file)}
    code, answers = see(capsys, *(str(folder / "images" / name) for name in labels), "--fx", "480")
    assert code == 0
    assert all(answer["found"] for answer in answers)
    errors = np.array([answer["roll_deg"] + math.degrees(math.atan(slope))
                       for answer, slope in zip(answers, labels.values(), strict=True)])  # fmt: skip
    assert np.mean(np.abs(errors) <= 2.0) >= 0.97
    assert np.abs(errors).max() <= 4.0
    assert np.median(np.abs(errors)) <= 0.4

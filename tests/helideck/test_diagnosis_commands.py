"""Every command of docs/diagnosis.md runs, in a quick form, in the order in which it stands there."""

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from helideck.cli import main

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("HELIDECK_DATA", ROOT.parent / "shared" / "data"))
LAB = DATA / "lab_helicopter" / "Lab-Helicopter_Experimental-data.csv"

QUICK = ["--set", "duration_s=12", "--set", "start.position_m=[1,-1,3]", "--set", "plan.point_m=[0,0,3]"]

Run = Callable[[list[str]], None]


def commands() -> list[str]:
    """Indented lines that begin with helideck or python, as they stand, without their remarks."""
    text = (ROOT / "docs/diagnosis.md").read_text(encoding="utf-8")
    return [c.strip() for c in re.findall(r"^    ((?:helideck|python) [^#\n]+)", text, re.MULTILINE)]


def short_landing(words: list[str]) -> None:
    """Without pictures; what is to be diagnosed flies the whole landing, other flights need not come to rest."""
    more = [*([] if "-o" in words else ["-o", "flights/better"]), *({"--no-cameras"} - set(words))]
    assert main([*words[1:], *([] if "flights/odd" in words else QUICK), *more]) in (0, 1)
    assert Path(words[words.index("-o") + 1] if "-o" in words else "flights/better", "measured").is_dir()


def diagnosis(words: list[str]) -> None:
    """The ground effect is three times the model's: said, and shown where it is."""
    assert main([*words[1:], "--json", *([] if "-o" in words else ["-o", "diagnoses/odd"])]) in (0, 1)
    found = json.loads(Path("diagnoses/odd/diagnosis.json").read_text(encoding="utf-8"))
    (cause,) = found["causes"]
    assert (cause["name"], cause["gain"]["channel"]) == ("ground_effect", "force_z")
    assert cause["gain"]["share_of_explainable"] > 0.5
    assert "force_z over height" in Path("diagnoses/odd/report.md").read_text(encoding="utf-8")
    runs = [p for p in found["predictions"] if (p["channel"], p["horizon_s"]) == ("velocity", 0.5)]
    assert [run["rmse_extended"] < 0.6 * run["rmse_nominal"] for run in runs] == [True]


def measured(words: list[str]) -> None:
    if not DATA.is_dir():
        pytest.skip("no measured data: set HELIDECK_DATA to its folder")
    # normal flights first: a name that stands for another flight too is that one's
    files = sorted(DATA.glob("**/*.csv*"), key=lambda path: ("normal" not in path.parent.name, path))
    found = {path.name: str(path) for path in files}
    found |= {f"n{i}.csv.gz": str(path) for i, path in enumerate(f for f in files if f.name.startswith("E8"))}
    given = [str(LAB) if word == "$LOG" else found.get(Path(word).name, word) for word in words]
    assert main([*given[1:], *([] if words[1] == "predict" or "-o" in words else ["-o", "diagnoses/measured"])]) == 0


def plain(words: list[str]) -> None:
    assert main(words[1:]) == 0


@cache
def help_of(script: str) -> str:
    """Of a module, or of a file."""
    words = [str(ROOT / script)] if script.endswith(".py") else ["-m", script]
    done = subprocess.run([sys.executable, *words, "--help"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def helped(words: list[str]) -> None:
    """Hours, in full: that it is there and takes what is told."""
    said = help_of(words[2] if words[1] == "-m" else words[1])
    for option in (word for word in words if word.startswith("--")):
        assert option in said


HOW: list[tuple[str, Run]] = [
    (r"helideck land .*extended\.toml", short_landing),
    (r"helideck land ", short_landing),
    (r"helideck diagnose flights/", diagnosis),
    (r"helideck (diagnose|predict) .*--mapping ", measured),
    (r"helideck list ", plain),
    (r"python ", helped),
]


def way(command: str) -> Run:
    found = [run for pattern, run in HOW if re.match(pattern, command)]
    assert found, f"docs/diagnosis.md has a command that no test runs: {command}"
    return found[0]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("commands")


@pytest.mark.parametrize("command", commands())
def test_a_command_of_the_document_runs(command: str, place: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(place)
    way(command)(shlex.split(command))
    capsys.readouterr()


def test_all_of_them_are_found() -> None:
    assert len(commands()) >= 8
    assert {way(command) for command in commands()} == {run for _, run in HOW}

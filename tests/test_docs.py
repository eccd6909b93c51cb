"""What the documents tell a user to type works."""

import re
import shlex
from pathlib import Path

import pytest

from flightlog.readers.folder import read_flight
from helideck.cli import VERBS, main

ROOT = Path(__file__).parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(document: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", document.read_text(encoding="utf-8"), re.DOTALL)


def commands(document: Path) -> list[str]:
    """Indented lines and inline code that begin with helideck or python."""
    text = document.read_text(encoding="utf-8")
    found = re.findall(r"^    ((?:helideck|python) [^#\n]+)", text, re.MULTILINE)
    found += re.findall(r"`((?:helideck|python) [^`\n]+)`", text)
    return sorted({command.strip() for command in found})


HELIDECK = sorted({c for d in DOCUMENTS for c in commands(d) if c.startswith("helideck ")})
PYTHON = sorted({c for d in DOCUMENTS for c in commands(d) if c.startswith("python ")})


def test_the_python_of_the_readme_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    (code,) = blocks(ROOT / "README.md", "python")
    exec(compile(code, "README.md", "exec"), {"__name__": "readme"})
    assert read_flight(tmp_path / "flights/mine").measured["imu"].unit("fz") == "m/s^2"
    assert "m/s^2" in capsys.readouterr().out


def test_the_scenario_of_the_readme_is_one(tmp_path: Path) -> None:
    from scenarios.load import load

    (text,) = blocks(ROOT / "README.md", "toml")
    path = tmp_path / "my_landing.toml"
    path.write_text(text, encoding="utf-8")
    assert load(path).events[0].at_s == 12


def test_the_term_of_the_model_page_flies() -> None:
    import numpy as np

    from sim import vehicle
    from sim.world import World

    (code,) = blocks(ROOT / "docs/model.md", "python")
    names: dict = {}
    exec(compile(code, "model.md", "exec"), names)
    raptor = vehicle.load("raptor90")
    seeds = np.random.SeedSequence(0)
    with World(raptor, seeds=seeds) as plain:
        free = plain.trim.controls.collective
    extra = {"extra_terms": [names["TOW_LINE"]], "extra_parameters": {"tow_line": {"weight": 5.0}}}
    with World(raptor, seeds=seeds, **extra) as towing:
        assert towing.trim.controls.collective > free + 0.001


@pytest.mark.parametrize("command", HELIDECK)
def test_commands_of_the_documents_are_understood(command: str, capsys) -> None:
    """Verb and options exist: the parser takes them and goes on to its help."""
    words = shlex.split(command)[1:]
    assert words[0] in VERBS
    assert main([*words, "--help"]) == 0
    assert "usage" in capsys.readouterr().out


@pytest.mark.parametrize("what", ["scenarios", "vehicles", "terms", "sensors"])
def test_lists_are_printed(what: str, capsys) -> None:
    assert main(["list", what]) == 0
    assert len(capsys.readouterr().out.splitlines()) >= 1


@pytest.mark.parametrize("command", PYTHON)
def test_scripts_of_the_documents_are_there(command: str) -> None:
    script = shlex.split(command)[1]
    assert script == "-m" or (ROOT / script).is_file()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_somewhere(document: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", document.read_text(encoding="utf-8")):
        if not target.startswith("http"):
            assert (document.parent / target).exists(), target

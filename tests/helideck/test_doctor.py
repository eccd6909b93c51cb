"""The doctor tells the truth about rendering, and the command line answers every ending as promised."""

import json
import os
import signal
import subprocess
import sys
import types
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import helideck.cli
import helideck.doctor
from flightlog.errors import UserError
from helideck.cli import main
from helideck.cli.document import emit
from helideck.cli.usage import one_line
from helideck.doctor import Drawing, Report, draw

HEALTHY = Report(
    drawing=Drawing("NVIDIA GeForce RTX 4090/PCIe/SSE2", "4.6.0", 0.1, None),
    versions={"python": "3.11.2", "mujoco": None},
    cores=8,
    memory=16 << 30,
    warnings=(),
    install=(),
)
BLIND = replace(HEALTHY, drawing=Drawing(None, None, None, "no display"))


@pytest.fixture
def report(monkeypatch):
    """Hand the verb a report instead of this machine's."""
    return lambda given: monkeypatch.setattr(helideck.doctor, "doctor", lambda: given)


@pytest.fixture
def verb(monkeypatch):
    """Register a verb `trial` whose run is handed in."""

    def register(action):
        @dataclass(frozen=True)
        class Trial:
            """Tries.

            Example: helideck trial
            """

            seed: int = 0
            json: bool = False

            def run(self) -> int:
                return action()

        module = types.ModuleType("helideck.cli.trial")
        module.Trial = Trial
        monkeypatch.setitem(sys.modules, "helideck.cli.trial", module)
        monkeypatch.setattr(helideck.cli, "VERBS", (*helideck.cli.VERBS, "trial"))

    return register


def raising(error):
    def action():
        raise error

    return action


@pytest.mark.render
def test_a_picture_is_drawn_and_its_painter_named():
    drawing = draw()
    assert drawing.error is None
    assert drawing.renderer and drawing.opengl
    assert 0 < drawing.seconds < 60


@pytest.mark.parametrize(
    ("script", "error"),
    [
        ("import os; os.abort()", "SIGABRT"),
        ("raise ImportError('Unable to load EGL library')", "Unable to load EGL library"),
        ("import sys; sys.exit(7)", "code 7"),
        ("import time; time.sleep(60)", "more than"),
    ],
)
def test_a_driver_that_fails_leaves_the_doctor_alive(tmp_path: Path, script: str, error: str):
    probe = tmp_path / "probe.py"
    probe.write_text(script)
    drawing = draw(probe, timeout=2.0)
    assert drawing.renderer is None and not drawing.software
    assert error in drawing.error


@pytest.mark.parametrize(
    ("renderer", "software"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("softpipe", True),
        ("Software Rasterizer", True),
        ("NVIDIA GeForce RTX 4090/PCIe/SSE2", False),
        ("Mesa Intel(R) UHD Graphics 620 (KBL GT2)", False),
        ("AMD Radeon RX 6600 (radeonsi, navi23, LLVM 15.0.6, DRM 3.49)", False),
        (None, False),
    ],
)
def test_software_renderers_are_told_from_cards(renderer, software):
    assert Drawing(renderer, None, None, None).software is software


def test_the_report_warns_of_a_software_renderer(monkeypatch):
    monkeypatch.setattr(helideck.doctor, "draw", lambda: Drawing("llvmpipe (LLVM 19)", "4.5", 0.1, None))
    found = helideck.doctor.doctor()
    assert any("software rendering" in warning for warning in found.warnings)
    assert found.versions["mujoco"] == "3.17.0"
    assert 1 <= found.cores <= os.cpu_count()
    assert found.memory > 1 << 28


def test_missing_opengl_libraries_are_named_with_the_command(monkeypatch):
    monkeypatch.setattr(helideck.doctor, "LIBRARIES", {"libc.so.6": "libc6", "libAbsent.so.1": "libabsent1"})
    monkeypatch.setattr(helideck.doctor, "draw", lambda: BLIND.drawing)
    assert [line for line in helideck.doctor.doctor().install if "apt-get install libabsent1" in line]
    assert not [line for line in helideck.doctor.doctor().install if "libc6" in line]


def test_unfit_packages_are_named(monkeypatch):
    declared = ["numpy>=99", "absent-thing>=1", "scipy>=1", "old; python_version < '3'", "extra-thing; extra == 'dev'"]
    monkeypatch.setattr(helideck.doctor, "requires", lambda _: declared)
    lines = helideck.doctor._missing_packages()
    assert [line.split()[0] for line in lines] == ["numpy>=99", "absent-thing>=1"]


def test_exit_code_is_1_only_without_rendering(report, capsys):
    report(HEALTHY)
    assert main(["doctor"]) == 0
    assert "NVIDIA" in capsys.readouterr().out
    report(replace(HEALTHY, warnings=("slow",), install=("something",)))
    assert main(["doctor"]) == 0
    report(BLIND)
    assert main(["doctor"]) == 1
    assert "no display" in capsys.readouterr().out


@pytest.mark.parametrize("given", [HEALTHY, BLIND])
def test_json_is_one_document(report, capsys, given):
    report(given)
    main(["doctor", "--json"])
    out = capsys.readouterr()
    document = json.loads(out.out)
    assert out.err == ""
    assert document["can_render"] is given.can_render
    assert document["renderer"] == given.drawing.renderer
    assert document["versions"] == given.versions


def test_documents_hold_arrays_and_null_for_nan(capsys):
    emit({"a": np.array([1.0, np.nan]), "b": np.int64(3), "c": float("inf"), "d": Path("x"), "e": HEALTHY})
    text = capsys.readouterr().out
    document = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert document["a"] == [1.0, None]
    assert (document["b"], document["c"], document["d"], document["e"]["cores"]) == (3, None, "x", 8)


def test_unusable_input_is_one_line_and_exit_2(verb, capsys):
    verb(raising(UserError("flight.toml:3: wind: unknown key")))
    assert main(["trial"]) == 2
    out = capsys.readouterr()
    assert out.out == ""
    assert out.err == "helideck: flight.toml:3: wind: unknown key\n"


@pytest.mark.parametrize(
    ("error", "code", "text"),
    [(UserError("no such file"), 2, "no such file"), (KeyboardInterrupt(), 130, "interrupted")],
)
def test_errors_are_a_json_document_when_asked_for(verb, capsys, error, code, text):
    verb(raising(error))
    assert main(["trial", "--json"]) == code
    assert json.loads(capsys.readouterr().out) == {"error": text}


def test_our_own_mistakes_keep_their_traceback_and_still_give_json(verb, capsys):
    verb(raising(ZeroDivisionError("by us")))
    with pytest.raises(ZeroDivisionError):
        main(["trial", "--json"])
    assert json.loads(capsys.readouterr().out) == {"error": "ZeroDivisionError: by us"}


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["trail"], ["'trail'", "did you mean 'trial'", "doctor"]),
        (["trial", "--sed", "3"], ["--sed", "--seed"]),
        (["trial", "--seed", "x"], ["--seed", "'x'"]),
        (["trial", "extra"], ["extra"]),
    ],
)
@pytest.mark.parametrize("as_json", [False, True])
def test_wrong_words_get_one_line_that_names_what_was_meant(verb, capsys, words, parts, as_json):
    verb(lambda: pytest.fail("ran"))
    assert main([*words, *(["--json"] if as_json else [])]) == 2
    out = capsys.readouterr()
    assert out.err.count("\n") == 1 and out.err.startswith("helideck: ")
    assert all(part in out.err for part in parts), out.err
    assert not set("│╭─╯") & set(out.err)
    if as_json:
        assert "helideck: " + json.loads(out.out)["error"] + "\n" == out.err
    else:
        assert out.out == ""


BOXED = """╭─ Unrecognized options ─────────────────╮
│ Unrecognized options: --sed, 3         │
│ ────────────────────────────────────── │
│ Perhaps you meant:                     │
│     --seed INT                         │
│         Seed. (default: 0)             │
│     --set A.B=VALUE                    │
│ ────────────────────────────────────── │
│ For full helptext, run helideck --help │
╰────────────────────────────────────────╯
"""
PLAIN = "\n".join(
    line[1:-1].replace("─", "-") for line in BOXED.replace("╭─ Unrecognized", "  Unrecognized").splitlines()
)


@pytest.mark.parametrize("box", [BOXED, PLAIN.replace("options -", "options \n-", 1)])
def test_the_parsers_box_becomes_one_line_in_any_terminal(box):
    assert one_line(box) == "unrecognized options: --sed, 3; did you mean --seed or --set?"


def test_an_empty_complaint_still_says_something():
    assert "could not be understood" in one_line("")


def test_help_lists_every_verb_in_one_line_each(verb, capsys):
    verb(lambda: 0)
    assert main([]) == main(["--help"]) == 0
    text = capsys.readouterr().out
    assert "trial" in text and "Tries." in text and "doctor" in text
    assert "Example" not in text


@pytest.mark.parametrize("name", helideck.cli.VERBS)
def test_every_verb_has_help_with_an_example_and_json(name, capsys):
    assert main([name, "--help"]) == 0
    text = capsys.readouterr().out
    assert f"Example: helideck {name}" in text or f"helideck {name} " in text.partition("Example")[2]
    assert "--json" in text


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from helideck.cli import main; main(['--help']);"
        "print(*sorted({'mujoco','cv2','numba','scipy','rerun','control','dm_control','pyarrow'} & set(sys.modules)),"
        "file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True,
                          cwd=Path(__file__).parents[2])
    assert done.stderr.split() == []


def test_a_reader_that_leaves_early_brings_no_traceback():
    code = "import sys; from helideck.cli import main; sys.exit(main(['--help']))"
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as end:
        done = subprocess.run([sys.executable, "-c", code], stdout=end, stderr=subprocess.PIPE, text=True, check=False,
                              cwd=Path(__file__).parents[2])
    assert done.stderr == ""
    assert done.returncode not in (0, -signal.SIGSEGV)

"""`helideck reproduce`: jobs spread and gathered, the report true to what the experiments answered."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from helideck.cli import main
from helideck.reproduction import Reproduction, as_document, write_html, write_markdown
from scenarios import experiments
from scenarios.experiments.contract import Figure, Job, Outcome, Picture, Plot, Series
from scenarios.experiments.runner import run


def square(k: int) -> int:
    return k * k


def broken(k: int) -> int:
    raise ArithmeticError(f"cannot do {k}")


def experiment(name="squares", work=square, bar=20.0):
    def conclude(effort, answers):
        x = np.arange(len(answers), dtype=float)
        return Outcome(
            figures=[Figure("largest | square", "m", 9.0, 9.5, float(max(answers)), bar=bar, note="with <note>")],
            plots=[Plot("squares", "they grow", "k [1]", "k^2 [m]", [Series("ours", x, np.array(answers, float))])],
            pictures=[Picture("a picture", "grey", np.full((20, 30), 90, np.uint8))],
            tables=[("all", [{"k": k, "square": value} for k, value in enumerate(answers)])],
            notes=["noise: none"],
        )

    return SimpleNamespace(
        NAME=name, SYSTEM="zeng", TITLE=f"Some {name}", ABOUT="About.", conclude=conclude,
        jobs=lambda effort: [Job(work, (k,), f"{k}", cost=1.0 + k) for k in range(3 if effort == "quick" else 5)],
    )


@pytest.fixture
def done() -> Reproduction:
    told = []
    results = run(
        [experiment(), experiment("failures", broken)], "full", workers=1,
        progress=lambda share, total, label: told.append((share, total)),
    )
    assert told[-1] == (30.0, 30.0) and [a for a, _ in told] == sorted(a for a, _ in told)
    return Reproduction(results, "full", 1.0, {"numpy": "2"})


def test_answers_come_back_in_the_order_of_the_jobs_and_failures_stop_nobody(done):
    squares, failures = done.results
    assert [row["square"] for row in squares.outcome.tables[0][1]] == [0, 1, 4, 9, 16]
    assert failures.outcome is None and "cannot do" in failures.error
    assert "could not be run: zeng failures" in done.sentence


def test_a_figure_beyond_its_bar_is_called_short():
    (result,) = run([experiment(bar=15.0)], "full", workers=1)
    assert Reproduction([result], "full", 1.0, {}).short[0][1].ours == 16.0
    (result,) = run([experiment(bar=15.0)], "quick", workers=1)
    assert not Reproduction([result], "quick", 1.0, {}).short


@pytest.mark.parametrize(
    ("figure", "reached", "reproduced"),
    [
        (Figure("a", "m", 1.0, 1.19, 0.5, bar=0.5), True, True),
        (Figure("a", "m", 1.0, 1.21, 0.51, bar=0.5), False, False),
        (Figure("a", "m", None, 1.0, None, bar=0.5), None, None),
        (Figure("share", "1", 0.9, None, 0.94, bar=0.95, at_most=False), False, None),
        (Figure("a", "m", 1.0, 3.0, 0.1, expected=(2.0, 4.0)), None, True),
    ],
)
def test_verdicts(figure, reached, reproduced):
    assert figure.reached is reached and figure.reproduced is reproduced


def test_the_page_needs_no_other_file_and_says_what_the_markdown_says(done, tmp_path):
    write_html(done, tmp_path / "report.html")
    write_markdown(done, tmp_path / "report.md")
    html, text = (tmp_path / "report.html").read_text(), (tmp_path / "report.md").read_text()
    assert html.count("data:image/png;base64,") == 2 and "<note>" not in html
    assert not re.search(r'(?:src|href)="(?!data:)', html)
    for page in (html, text):
        assert "with" in page and "noise: none" in page and "9.5" in page and "cannot do" in page
    assert "largest \\| square" in text
    for name in re.findall(r"\]\((figures/[^)]+)\)", text):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    document = json.loads(json.dumps(as_document(done), default=lambda v: v.tolist()))
    assert document["experiments"][0]["figures"][0]["reached"] is True
    assert document["experiments"][0]["plots"][0]["series"][0]["y"] == [0, 1, 4, 9, 16]


def test_the_verb_writes_the_report_and_exits_by_the_bars(tmp_path, monkeypatch, capsys):
    for bar, code in ((20.0, 0), (3.0, 1)):
        monkeypatch.setattr(experiments, "experiments", lambda system=None, bar=bar: [experiment(bar=bar)])
        assert main(["reproduce", "zeng", "--quick", "--workers", "1", "-o", str(tmp_path), "--json"]) == code
        document = json.loads(capsys.readouterr().out)
        assert document == json.loads((tmp_path / "report.json").read_text())
        assert (tmp_path / "report.html").is_file() and (tmp_path / "report.md").is_file()


def test_a_folder_that_cannot_be_is_one_line(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["reproduce", "-o", str(tmp_path / "file" / "x")]) == 2
    assert capsys.readouterr().err.count("\n") == 1

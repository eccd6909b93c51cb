"""The report says what the verdict says, in both forms, and needs no other file."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from identification.gain import measure
from identification.report import Findings, sentence, write_report
from identification.report.drivers import visited
from identification.report.panels import panels
from identification.report.power import power
from identification.verdict import BaselineReport


class Images(HTMLParser):
    """Sources of a page's pictures and addresses of its links."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.found += [value for name, value in attrs if name in ("src", "href")]


def test_a_cause_is_told_in_a_sentence_a_picture_and_a_table(diagnosed: Any, tmp_path: Path) -> None:
    diagnosis = diagnosed({"terms.ground_effect.gain": 2.5})
    findings = Findings(diagnosis.verdict, diagnosis, measure(diagnosis))
    write_report(findings, tmp_path)
    html, markdown = (tmp_path / name for name in ("report.html", "report.md"))
    page, text = html.read_text(encoding="utf-8"), markdown.read_text(encoding="utf-8")
    said = sentence(diagnosis.verdict)
    assert "one thing is wrong" in said
    assert re.search(r"ground_effect \(plant\), gain 2\.[45]\d* ± 0\.\d+ \(model: 1\)", said)
    assert text.index(said) < text.index("![") < text.index("What is wrong") < text.index("Evidence of every candidate")
    images = Images()
    images.feed(page)
    assert len(images.found) >= 5
    assert text.index("figures/headline.png") == text.index("figures/")
    assert all(source.startswith("data:image/png;base64,") for source in images.found)
    assert "&lt;note&gt;" in page
    for link in re.findall(r"\]\((figures/[^)]+)\)", text):
        assert (tmp_path / link).read_bytes().startswith(b"\x89PNG")


def test_nothing_wrong_and_no_verdict_are_said_so(diagnosed: Any, tmp_path: Path) -> None:
    diagnosis = diagnosed({})
    assert "nothing was found wrong" in sentence(diagnosis.verdict)
    write_report(Findings(diagnosis.verdict, diagnosis, measure(diagnosis)), tmp_path)
    assert "What is wrong" not in (tmp_path / "report.md").read_text(encoding="utf-8")
    refused = replace(diagnosis.verdict, baseline=BaselineReport(False, "force_z is not white", {}, {}))
    assert "No verdict" in sentence(refused)
    assert "force_z is not white" in sentence(refused)
    assert panels(Findings(replace(refused, candidates=[]), None, None)) == []
    shown = panels(Findings(refused, diagnosis, None))
    assert shown[0].name == "contradiction" and shown[0].png.startswith(b"\x89PNG")
    assert "contradiction" not in [panel.name for panel in panels(Findings(diagnosis.verdict, diagnosis, None))]


def test_power_is_that_of_the_information(diagnosed: Any) -> None:
    """A drift has no rival: its d' is its size over its standard deviation, known in closed form."""
    diagnosis = diagnosed({})
    bench = diagnosis.bench
    found = next(item for item in power(diagnosis) if item.cause == "baro_drift")
    columns = [bench.rows(i, {}).signatures["sensors.baro.drift_rate"] for i in range(3)]
    exact = sum(float(column @ column) for column in columns)
    assert abs(found.strength - found.usual * exact**0.5) < 1e-6 * found.strength
    assert found.smallest < found.usual
    weak = next(item for item in power(diagnosis) if item.cause == "mass")
    assert weak.strength < found.strength


def test_visited_is_the_box_of_all_flights(diagnosed: Any) -> None:
    bench = diagnosed({}).bench
    low, high = visited(bench)["height_m"]
    heights = [bench.drivers(i)["height"][2] for i in range(3)]
    assert low == min(h.min() for h in heights)
    assert high == max(h.max() for h in heights)

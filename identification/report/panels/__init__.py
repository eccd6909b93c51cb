"""The pictures of a report, one a file: each has TITLE, CAPTION and `draw(findings)`, None where it says nothing.

One whose title depends on what was found has `title(findings)` besides.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module

from identification.report.findings import Findings

NAMES: tuple[str, ...] = (
    "contradiction", "headline", "heights", "unexplained", "structure", "channels", "evidence", "course", "detection",
)  # fmt: skip - in their order


@dataclass(frozen=True)
class Panel:
    """One picture."""

    name: str
    title: str
    caption: str
    png: bytes


def panels(findings: Findings) -> Sequence[Panel]:
    """All pictures that say something, the most telling first."""
    found = []
    for name in NAMES:
        module = import_module(f"{__name__}.{name}")
        drawn: bytes | None = module.draw(findings)
        if drawn is not None:
            title = module.title(findings) if hasattr(module, "title") else module.TITLE
            found.append(Panel(name, title, module.CAPTION, drawn))
    return found

"""What was reproduced, and how it went."""

from collections.abc import Sequence
from dataclasses import dataclass

from scenarios.experiments.contract import Effort, Figure
from scenarios.experiments.runner import Result

SYSTEMS = {
    "lei2012": "Lei, Li, Guo, Du 2012: altitude from an H and fused sensors",
    "wu2019": "Wu et al. 2019: ring and T pad, Kalman filter of vision and inertial sensors",
    "zeng": "Zeng and Jiang: SAD optical flow and inertial sensors",
    "huang": "Huang, Li, Fan: attitude from the horizon",
    "all": "What concerns every system",
}


@dataclass(frozen=True)
class Reproduction:
    """All results of one call."""

    results: Sequence[Result]
    effort: Effort
    seconds: float  # wall time
    versions: dict[str, str]

    @property
    def failed(self) -> list[Result]:
        """Experiments that could not be run to their end."""
        return [result for result in self.results if result.outcome is None]

    @property
    def short(self) -> list[tuple[Result, Figure]]:
        """Figures of ours that miss their bar."""
        return [
            (result, figure)
            for result in self.results
            if result.outcome is not None
            for figure in result.outcome.figures
            if figure.reached is False
        ]

    @property
    def barred(self) -> int:
        """How many figures of ours have a bar."""
        return sum(f.reached is not None for r in self.results if r.outcome is not None for f in r.outcome.figures)

    @property
    def sentence(self) -> str:
        """The whole in one sentence."""
        text = f"{self.barred - len(self.short)} of {self.barred} figures reach their bar"
        if self.failed:
            names = ", ".join(f"{r.experiment.SYSTEM} {r.experiment.NAME}" for r in self.failed)
            text += f"; could not be run: {names}"
        if self.effort == "quick":
            text += " (quick: few flights and frames, so the figures are rough)"
        return text


def number(value: float | None) -> str:
    """A figure as a table shows it."""
    return "" if value is None else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def bar_text(figure: Figure) -> str:
    """The bar with its sign."""
    return "" if figure.bar is None else f"{'≤' if figure.at_most else '≥'} {number(figure.bar)}"


def verdict(figure: Figure) -> str:
    """Whether the figure is where it should be, in words."""
    words = []
    if figure.reached is not None:
        words.append("reached" if figure.reached else "SHORT")
    if figure.reproduced is False:
        words.append("faithful build elsewhere")
    return ", ".join(words)

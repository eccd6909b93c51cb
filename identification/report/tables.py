"""The report's tables, as rows of text."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from identification.report.findings import Findings, value
from identification.report.power import power

CANDIDATES = 12  # shown
PROBABLE = 0.001
MODELS = {"measured": "measured", "before": "model as it was", "after": "extended"}


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head; `note` says what they are."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def tables(findings: Findings) -> list[Table]:
    """All that have rows, the most telling first."""
    made = (
        _causes(findings), _gain(findings), _candidates(findings), _landings(findings), _predictions(findings),
        _unexplained(findings), _noise(findings), _power(findings), _untestable(findings),
    )  # fmt: skip
    return [table for table in made if table.rows]


def number(x: float | None) -> str:
    """A figure as a table shows it."""
    if x is None or math.isnan(x):
        return ""
    return f"{x:.3g}" if abs(x) < 1000 else f"{x:.0f}"


def _span(ends: Sequence[float]) -> str:
    return f"{number(ends[0])} … {number(ends[1])}"


def _causes(findings: Findings) -> Table:
    rows = []
    for cause in findings.verdict.causes:
        first = True
        for name, p in cause.parameters.items():
            rows.append(
                (
                    cause.name if first else "", cause.where if first else "",
                    f"{100 * cause.probability:.1f} %" if first else "", f"{name} [{p.unit}]", number(p.nominal),
                    value(p.value, p.std), _span(p.ci95),
                    ", ".join(cause.confusable_with) if first else "", (cause.split_by or "") if first else "",
                )
            )  # fmt: skip
            first = False
    head = ("cause", "where", "probability", "parameter", "in the model", "found", "95 %", "or", "what would tell them")
    return Table("What is wrong", head, rows, "Found values stand in extended.toml.")


def _gain(findings: Findings) -> Table:
    gain = findings.gain
    if gain is None:
        return Table("", (), ())
    both = bool(findings.verdict.causes)
    rows = [
        (
            f"{c.channel} [{c.unit}]", number(c.before), number(c.after) if both else "", number(c.everything),
            number(c.floor), _span(c.ratio_ci95) if both else "", number(c.log_likelihood) if both else "",
            f"{100 * c.share_of_explainable:.0f} %" if both else "",
        )
        for c in sorted(gain.channels, key=lambda c: -c.log_likelihood)
    ]  # fmt: skip
    head = ("channel", "rms before", "after", "all parameters", "floor", "after/before, 95 %", "nats", "explained")
    low, high = gain.log_likelihood_ci95
    said = f"Held out: {gain.how}."
    if both:
        said += (
            f" Log likelihood gained {gain.log_likelihood:+.1f} ({low:+.1f} … {high:+.1f}), over a fit of all "
            f"parameters {gain.over_everything:+.1f}."
        )
    said += " 'std': in standard deviations of the innovation."
    return Table("The gain on data that was not fitted", head, rows, said)


def _candidates(findings: Findings) -> Table:
    rows = []
    for c in findings.verdict.candidates[:CANDIDATES]:
        because = "" if c.lost_because is None else f"{c.lost_because.channel}, {c.lost_because.region}"
        share = f"{100 * c.probability:.1f} %" if c.probability >= PROBABLE else "< 0.1 %"
        rows.append((c.name, f"{c.log_bayes_factor:+.1f}", share, because))
    left = len(findings.verdict.candidates) - len(rows)
    note = f"{left} more explain less; all of them in diagnosis.json." if left > 0 else ""
    head = ("candidate", "log Bayes factor", "probability", "lost because of")
    return Table("Candidates, each alone", head, rows, note)


def _landings(findings: Findings) -> Table:
    rows = [
        (item.name, MODELS[item.of], number(item.offset_m), number(item.sink_m_s), number(item.drift_m_s))
        for item in findings.landings
    ]
    head = ("flight", "model", "touchdown off the centre [m]", "sinking [m/s]", "drifting [m/s]")
    return Table("In closed loop", head, rows, "The same landing flown with the model as it was and as extended.")


def _predictions(findings: Findings) -> Table:
    rows = [
        (p.channel, number(p.horizon_s), number(p.rmse_nominal), number(p.rmse_refitted), number(p.rmse_extended))
        for p in findings.verdict.predictions
    ]
    return Table("Free runs", ("channel", "horizon [s]", "rms as it was", "refitted", "extended"), rows)


def _unexplained(findings: Findings) -> Table:
    rows = [
        (
            u.channel, f"{100 * u.share_of_variance:.0f} %", " or ".join(u.depends_on), u.form or "", number(u.nats),
            ", ".join(f"{a.channel} over {a.driver}" for a in u.alternatives if a.channel != u.channel),
        )
        for u in findings.verdict.unexplained
    ]  # fmt: skip
    head = ("channel", "of its variance", "depends on", "form", "evidence [nats]", "not to be told from")
    return Table("What no named cause explains", head, rows)


def _noise(findings: Findings) -> Table:
    baseline = findings.verdict.baseline
    rows = [(name, f"{number(item.value)} {item.unit}") for name, item in baseline.noise.items()]
    rows += [(name, number(item)) for name, item in baseline.environment.items()]
    return Table("Noise and weather of these flights", ("quantity", "found"), rows)


def _power(findings: Findings) -> Table:
    if findings.diagnosis is None:
        return Table("", (), ())
    rows = [
        (
            p.cause, f"{p.parameter} [{p.unit}]", number(p.usual), number(p.strength),
            "none" if math.isinf(p.smallest) else number(p.smallest), "" if p.seen else "not on these flights",
        )
        for p in power(findings.diagnosis)
    ]  # fmt: skip
    head = ("cause", "parameter", "usual size", "d'", "smallest detectable change", "")
    note = "Smallest: detected as often as not, everything else that may be off taken out."
    return Table("What these flights can show", head, rows, note)


def _untestable(findings: Findings) -> Table:
    rows = [(item.name, ", ".join(item.needs)) for item in findings.verdict.not_testable]
    return Table("Not testable with these logs", ("cause", "needs"), rows)


def as_text(cells: Sequence[str]) -> Iterator[str]:
    """Cells of a Markdown table."""
    return (cell.replace("|", "\\|") for cell in cells)

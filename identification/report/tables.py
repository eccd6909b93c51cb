"""The report's tables, as rows of text."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from identification.report.drawing import said
from identification.report.findings import Findings, candidates, fixed, label, value
from identification.report.power import power

CANDIDATES = 12  # shown
CHANNELS = 6  # shown where nothing is wrong
WORTH = 1.0  # [nats] by which a channel must change to be shown
PROBABLE = 0.001
MOVED = {"position": "m", "velocity": "m/s", "rates": "rad/s"}  # units of free runs; a joint's is rad
WEATHER = "m/s"  # unit of the wind
MODELS = {"measured": "measured", "before": "model as it was", "after": "extended"}


@dataclass(frozen=True)
class Table:
    """Rows of cells under a head; `note` says what they are."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    folded: bool = False  # to be looked up rather than read


def tables(findings: Findings) -> list[Table]:
    """All that have rows, the most telling first."""
    made = (
        _causes(findings), _gain(findings), _candidates(findings), _landings(findings), _predictions(findings),
        _unexplained(findings), _noise(findings), _power(findings), _untestable(findings),
    )  # fmt: skip
    return [_filled(table) for table in made if table.rows]


def _filled(table: Table) -> Table:
    """Without columns that are empty."""
    kept = [i for i in range(len(table.head)) if any(row[i] for row in table.rows)]
    return replace(
        table, head=[table.head[i] for i in kept], rows=[[row[i] for i in kept] for row in table.rows]
    )  # fmt: skip


def number(x: float | None) -> str:
    """A figure as a table shows it."""
    if x is None or math.isnan(x):
        return ""
    return f"{x:.3g}" if abs(x) < 1000 else f"{x:.0f}"


def _nats(x: float) -> str:
    """Evidence as a table shows it."""
    return f"{x:+.1f}" if abs(x) >= 0.05 else "0.0"


def _span(ends: Sequence[float]) -> str:
    return f"{number(ends[0])} … {number(ends[1])}"


def _causes(findings: Findings) -> Table:
    rows = []
    for cause in findings.verdict.causes:
        which = [f"{name} {p.value:g}" for name, p in cause.parameters.items() if fixed(p)]
        of = " of " + ", ".join(which) if which else "" if cause.topic is None else f" of {cause.topic}"
        first = True
        for name, p in cause.parameters.items():
            if fixed(p):
                continue
            rows.append(
                (
                    cause.name + of if first else "", cause.where if first else "",
                    f"{100 * cause.probability:.1f} %" if first else "", name, number(p.nominal),
                    value(p.value, p.std), _span(p.ci95), "" if p.unit == "1" else said(p.unit),
                    ", ".join(cause.confusable_with) if first else "", (cause.split_by or "") if first else "",
                )
            )  # fmt: skip
            first = False
    head = (
        "cause", "where", "probability", "parameter", "in the model", "found", "95 %", "unit", "or",
        "what would tell them",
    )  # fmt: skip
    note = "Found values stand in extended.toml." if findings.verdict.extended_vehicle else ""
    return Table("What is wrong", head, rows, note)


def _gain(findings: Findings) -> Table:
    gain = findings.gain
    if gain is None:
        return Table("", (), ())
    both = bool(findings.verdict.causes)
    if both:
        ordered = sorted(gain.channels, key=lambda c: -c.log_likelihood)
        shown = [c for c in ordered if abs(c.log_likelihood) >= WORTH] or ordered[:1]
        left = f"{len(ordered) - len(shown)} more channels change by less than a nat"
    else:
        shown = sorted(gain.channels, key=lambda c: -c.before / max(c.floor, 1e-300))[:CHANNELS]
        left = f"The {len(gain.channels) - len(shown)} other channels are nearer to their floors"
    rows = [
        (
            f"{c.channel} [{said(c.unit)}]", number(c.before), number(c.after) if both else "", number(c.everything),
            number(c.floor), f"{c.ratio_ci95[0]:.2f} … {c.ratio_ci95[1]:.2f}" if both else "",
            _nats(c.log_likelihood) if both else "",
            f"{100 * c.share_of_explainable:.0f} %" if both and c.share_of_explainable != 0.0 else "",
        )
        for c in shown
    ]  # fmt: skip
    head = ("channel", "rms before", "after", "all parameters", "floor", "after/before, 95 %", "nats", "explained")
    low, high = gain.log_likelihood_ci95
    told = f"Held out: {gain.how}."
    if both:
        told += (
            f" Log likelihood gained {gain.log_likelihood:+.1f} ({low:+.1f} … {high:+.1f}), over a fit of all "
            f"parameters {gain.over_everything:+.1f}."
        )
    told += " Floor: all that has a name fitted to these very rows."
    if any(c.unit == "std" for c in shown):
        told += " 'std': in standard deviations of the innovation."
    if len(shown) < len(gain.channels):
        told += f" {left}; diagnosis.json has all."
    return Table("The gain on data that was not fitted", head, rows, told)


def _candidates(findings: Findings) -> Table:
    rows, every = [], candidates(findings)
    for name, c in every[:CANDIDATES]:
        because = "" if c.lost_because is None else f"{c.lost_because.channel}, {c.lost_because.region}"
        share = f"{100 * c.probability:.1f} %" if c.probability >= PROBABLE else "< 0.1 %"
        rows.append((name, _nats(c.log_bayes_factor), share, because))
    left = len(every) - len(rows)
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
        (
            f"{p.channel} [{MOVED.get(p.channel, 'rad')}]", number(p.horizon_s), number(p.rmse_nominal),
            number(p.rmse_refitted), number(p.rmse_extended),
        )
        for p in sorted(findings.verdict.predictions, key=lambda p: p.channel)
    ]  # fmt: skip
    note = "Errors at the end of runs that are set upon the measured motion every now and then."
    return Table("Free runs", ("channel", "horizon [s]", "rms as it was", "refitted", "extended"), rows, note)


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
    rows = [(name, f"{number(item.value)} {said(item.unit)}") for name, item in baseline.noise.items()]
    rows += [(name, f"{number(item)} {WEATHER}") for name, item in baseline.environment.items()]
    return Table("Noise and weather of these flights", ("quantity", "found"), rows, folded=True)


def _power(findings: Findings) -> Table:
    if findings.diagnosis is None:
        return Table("", (), ())
    rows = [
        (
            label(p.cause), p.parameter if p.unit == "1" else f"{p.parameter} [{said(p.unit)}]", number(p.usual),
            number(p.strength),
            "none" if math.isinf(p.smallest) else number(p.smallest), "" if p.seen else "not on these flights",
        )
        for p in power(findings.diagnosis)
    ]  # fmt: skip
    head = ("cause", "parameter", "usual size", "d'", "smallest detectable change", "")
    note = "Smallest: detected as often as not, everything else that may be off taken out."
    return Table("What these flights can show, by parameter", head, rows, note, folded=True)


def _untestable(findings: Findings) -> Table:
    rows = [(label(item.name), ", ".join(item.needs)) for item in findings.verdict.not_testable]
    return Table("Not testable with these logs", ("cause", "needs"), rows, folded=len(rows) > CANDIDATES)


def as_text(cells: Sequence[str]) -> Iterator[str]:
    """Cells of a Markdown table."""
    return (cell.replace("|", "\\|") for cell in cells)

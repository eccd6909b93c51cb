"""What a report is made of."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from flightlog.tables import Table
from identification.closed_loop import Landing
from identification.diagnosis import Diagnosis
from identification.gain import Gain
from identification.verdict import Asserted, Candidate, Fitted, Unexplained, Verdict


@dataclass(frozen=True, eq=False)
class Findings:
    """A verdict with what it was taken from."""

    verdict: Verdict
    diagnosis: Diagnosis | None  # None without a vehicle
    gain: Gain | None
    landings: Sequence[Landing] = ()
    tables: Mapping[str, Mapping[str, Table]] = field(default_factory=dict)  # measured, by flight and topic


def sentence(verdict: Verdict) -> str:
    """The whole in a sentence or two."""
    flights = f"{len(verdict.logs)} flight{'s' if len(verdict.logs) > 1 else ''}"
    who = "the sensors" if verdict.vehicle is None else f"the model of {verdict.vehicle}"
    if not verdict.baseline.certified:
        return f"No verdict: {who} cannot be judged on {flights}: {verdict.baseline.reason or 'the baseline fails'}."
    beside = "; ".join(_unexplained(item) for item in verdict.unexplained)
    if not verdict.causes:
        if beside:
            return f"On {flights} something is wrong with {who} that no known cause explains: {beside}."
        return f"On {flights} nothing was found wrong with {who}."
    found = "; ".join(_told(cause) for cause in verdict.causes)
    count = "one thing is" if len(verdict.causes) == 1 else f"{len(verdict.causes)} things are"
    more = f" No known cause explains: {beside}." if beside else ""
    return f"On {flights} {count} wrong with {who}: {found}.{more}"


def _unexplained(item: Unexplained) -> str:
    """Channel, what it depends on and its form."""
    text = f"{item.channel} over {' or '.join(item.depends_on).replace('_', ' ')}"
    if item.form is not None and item.curve is not None:
        text += f", about {item.form} {item.curve.unit}"
    return text


def candidates(findings: Findings) -> Sequence[tuple[str, Candidate]]:
    """All that were scored, best first, each with a name that tells it from its like."""
    told = findings.verdict.candidates
    own = told if findings.diagnosis is None else findings.diagnosis.verdict.candidates
    names = own if len(own) == len(told) else told
    found = [(label(by.name), item) for by, item in zip(names, told, strict=True) if np.isfinite(item.log_bayes_factor)]
    return sorted(found, key=lambda pair: -pair[1].log_bayes_factor)


def label(name: str) -> str:
    """A name of the search as it is printed."""
    return name.replace("#", " of ")


def _told(cause: Asserted) -> str:
    which = [f"{name} {p.value:g}" for name, p in cause.parameters.items() if fixed(p)]
    of = which if cause.topic is None else [cause.topic]
    text = f"{cause.name}{' of ' + ', '.join(of) if of else ''} ({cause.where})"
    for name, p in cause.parameters.items():
        if not fixed(p):
            unit = "" if p.unit == "1" else f"{p.unit.replace('^2', '²')} "
            text += f", {name} {value(p.value, p.std)} {unit}(model: {p.nominal:.4g})"
    if cause.confusable_with:
        text += f", not to be told from {', '.join(cause.confusable_with)} on these flights"
    if cause.gain is not None and cause.gain.share_of_explainable > 0.0:
        share = 100 * cause.gain.share_of_explainable
        text += f"; it explains {share:.0f} % of what can be explained in {cause.gain.channel}"
    return text


def fixed(parameter: Fitted) -> bool:
    """Whether it only says which of several it is."""
    return parameter.std == 0.0 and parameter.value == parameter.nominal


def value(number: float, std: float) -> str:
    """A number with its standard deviation, to the digits that count."""
    if not std > 0.0:
        return f"{number:.4g}"
    digits = max(0, min(8, 1 - int(f"{std:e}".partition("e")[2])))
    return f"{number:.{digits}f} ± {std:.{digits}f}"

"""What a report is made of."""

from collections.abc import Sequence
from dataclasses import dataclass

from identification.closed_loop import Landing
from identification.diagnosis import Diagnosis
from identification.gain import Gain
from identification.verdict import Asserted, Unexplained, Verdict


@dataclass(frozen=True, eq=False)
class Findings:
    """A verdict with what it was taken from."""

    verdict: Verdict
    diagnosis: Diagnosis | None  # None without a vehicle
    gain: Gain | None
    landings: Sequence[Landing] = ()


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


def _told(cause: Asserted) -> str:
    values = ", ".join(
        f"{name} {value(p.value, p.std)} {'' if p.unit == '1' else p.unit + ' '}(model: {p.nominal:.4g})"
        for name, p in cause.parameters.items()
    )
    text = f"{cause.name}{'' if cause.topic is None else ' of ' + cause.topic} ({cause.where}), {values}"
    if cause.confusable_with:
        text += f", not to be told from {', '.join(cause.confusable_with)} on these flights"
    if cause.gain is not None:
        share = 100 * cause.gain.share_of_explainable
        text += f"; it takes {share:.0f} % of what can be explained in {cause.gain.channel}"
    return text


def value(number: float, std: float) -> str:
    """A number with its standard deviation, to the digits that count."""
    if not std > 0.0:
        return f"{number:.4g}"
    digits = max(0, min(8, 1 - int(f"{std:e}".partition("e")[2])))
    return f"{number:.{digits}f} ± {std:.{digits}f}"

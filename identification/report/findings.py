"""What a report is made of."""

from collections.abc import Sequence
from dataclasses import dataclass

from identification.closed_loop import Landing
from identification.diagnosis import Diagnosis
from identification.gain import Gain
from identification.verdict import Asserted, Verdict


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
    if not verdict.causes:
        more = ""
        if verdict.unexplained:
            more = f" What stays unexplained: {', '.join(u.channel for u in verdict.unexplained)}."
        return f"On {flights} nothing was found wrong with {who}.{more}"
    found = "; ".join(_told(cause) for cause in verdict.causes)
    count = "one thing is" if len(verdict.causes) == 1 else f"{len(verdict.causes)} things are"
    return f"On {flights} {count} wrong with {who}: {found}."


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

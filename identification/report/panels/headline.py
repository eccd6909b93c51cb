"""The one picture: where the model was wrong, and what is left of it."""

from typing import Any

from identification.report.bands import Course, courses
from identification.report.drawing import AFTER, BAND, BEFORE, canvas, png
from identification.report.findings import Findings

TITLE = "Where it shows"
CAPTION = (
    "Mean of the held-out innovations (what the model did not foresee, in standard deviations) where it departs most. "
    "Grey-blue: where the mean lies when nothing is wrong (3 sigma)."
)
SHOWN = 3


def draw(findings: Findings) -> bytes | None:
    """The courses that stand out most: each channel once."""
    chosen = telling(findings)
    if not chosen:
        return None
    figure, axes = canvas(4.2 * len(chosen), 3.6, 1, len(chosen))
    for place, course in zip(axes[0], chosen, strict=True):
        curve(place, course, bool(findings.verdict.causes))
        place.set_title(course.channel, loc="left", fontsize=10)
    axes[0, 0].legend(fontsize=8, frameon=False)
    return png(figure)


def telling(findings: Findings) -> list[Course]:
    """Of each channel the driver that shows most; the SHOWN channels that show most."""
    if findings.gain is None:
        return []
    found = courses(findings.gain, [c.channel for c in findings.gain.channels])
    weight = (lambda c: c.taken) if findings.verdict.causes else (lambda c: c.excess)
    best: dict[str, Course] = {}
    for course in found:
        if course.channel not in best or weight(course) > weight(best[course.channel]):
            best[course.channel] = course
    return sorted(best.values(), key=weight, reverse=True)[:SHOWN]


def curve(place: Any, course: Course, both: bool) -> None:
    """Band and means of one course."""
    place.fill_between(course.middles, -course.band, course.band, color=BAND, label="nothing wrong", zorder=0)
    place.plot(course.middles, course.before, "o-", ms=3, lw=1.2, color=BEFORE, label="model as it was")
    if both:
        place.plot(course.middles, course.after, "o-", ms=3, lw=1.2, color=AFTER, label="extended")
    place.set_xlabel(course.label)
    place.set_ylabel("mean innovation [std]")

"""The one picture: where the model was wrong, and what is left of it."""

from typing import Any

from identification.report.drawing import AFTER, BAND, BEFORE, canvas, png, said
from identification.report.findings import Findings
from identification.report.means import Course
from identification.report.telling import telling

TITLE = "Measured against the model"
CAPTION = (
    "Measured less what the model says, along the measured motion; 'std': what the filter did not foresee of a sensor, "
    "in its standard deviations. Dots are means over all flights; grey-blue: where a mean lies when nothing is wrong "
    "(3 sigma, gusts remembered). All that may be off anyway is fitted, with the cause as in the file and as found."
)


def title(findings: Findings) -> str:
    """With what is shown."""
    return f"{TITLE}: {', '.join(_about(item.course) for item in telling(findings))}"


def _about(course: Course) -> str:
    return f"{course.channel} over {course.driver.replace('_', ' ')}"


def draw(findings: Findings) -> bytes | None:
    """The channel and the driver of each cause."""
    chosen = telling(findings)
    if not chosen:
        return None
    several = len({item.cause for item in chosen}) > 1
    figure, axes = canvas(max(4.2 * len(chosen), 6.4), 3.8, 1, len(chosen))
    for place, item in zip(axes[0], chosen, strict=True):
        alone = several and item.course.unit != "std"  # innovations are those with all causes at rest
        before = f"without {item.cause}" if alone else "model as it was"
        curve(place, item.course, before, "extended" if item.cause else None)
        place.set_title(_about(item.course), loc="left", fontsize=10)
        if several or item is chosen[0]:
            place.legend(fontsize=8, frameon=False)
    return png(figure)


def curve(place: Any, course: Course, before: str, after: str | None) -> None:
    """Band and means of one course."""
    place.fill_between(course.middles, -course.band, course.band, color=BAND, label="nothing wrong", zorder=0)
    place.axhline(0.0, lw=0.8, color="#9db4c8", zorder=1)
    colour = BEFORE if after else AFTER
    place.plot(course.middles, course.before, "o-", ms=3.5, lw=1.3, color=colour, label=before)
    if after:
        place.plot(course.middles, course.after, "o-", ms=3.5, lw=1.3, color=AFTER, label=after)
    place.margins(y=0.15)
    place.set_xlabel(course.label)
    if course.unit == "std":
        place.set_ylabel("mean innovation [std]")
    else:
        place.set_ylabel(f"measured less model [{said(course.unit)}]")

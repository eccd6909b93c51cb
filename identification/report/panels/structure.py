"""Every channel that departs, over everything that it may depend on."""

from identification.report.bands import Course, courses
from identification.report.drawing import canvas, png
from identification.report.findings import Findings
from identification.report.panels.headline import curve, telling

TITLE = "Innovations over height, speed, climb, time and attitude"
CAPTION = "Rows: the channels that depart most. Inside the band nothing shows."
COLUMNS = ("height", "speed", "climb", "time", "roll", "pitch")


def draw(findings: Findings) -> bytes | None:
    """A grid of channels and drivers."""
    chosen = [course.channel for course in telling(findings)]
    if not chosen or findings.gain is None:
        return None
    by_place: dict[tuple[str, str], Course] = {
        (c.channel, c.driver): c for c in courses(findings.gain, chosen)
    }
    columns = [name for name in COLUMNS if any(driver == name for _, driver in by_place)]
    if not columns:
        return None
    figure, axes = canvas(2.5 * len(columns), 2.3 * len(chosen), len(chosen), len(columns), sharey="row")
    for row, channel in zip(axes, chosen, strict=True):
        for place, driver in zip(row, columns, strict=True):
            if (channel, driver) in by_place:
                curve(place, by_place[channel, driver], bool(findings.verdict.causes))
            place.set_ylabel("")
            place.tick_params(labelsize=7)
        row[0].set_ylabel(channel)
    return png(figure)

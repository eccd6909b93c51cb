"""The channels of the first picture, over everything that they may depend on."""

from identification.report.bands import courses
from identification.report.drawing import canvas, png, said
from identification.report.findings import Findings
from identification.report.means import Course
from identification.report.panels.headline import curve
from identification.report.telling import telling

TITLE = "The same over everything else"
CAPTION = (
    "The channels of the first picture. A departure over one thing shows over all that went along with it."
)
MOST = 6  # columns


def draw(findings: Findings) -> bytes | None:
    """A grid of channels and drivers."""
    shown = {item.course.channel: item for item in telling(findings)}
    if not shown or findings.gain is None:
        return None
    grid = [item.others or courses(findings.gain, [channel]) for channel, item in shown.items()]
    names = list(dict.fromkeys(course.driver for row in grid for course in row))
    names = [name for name in (*names[: MOST - 1], "time") if name in names][:MOST]
    figure, axes = canvas(2.3 * len(names) + 0.6, 2.3 * len(grid), len(grid), len(names), sharey="row")
    for places, row, item in zip(axes, grid, shown.values(), strict=True):
        by_driver: dict[str, Course] = {course.driver: course for course in row}
        for place, name in zip(places, names, strict=True):
            if name in by_driver:
                curve(place, by_driver[name], "before", "after" if item.cause else None)
            place.set_ylabel("")
            place.tick_params(labelsize=7)
            place.xaxis.label.set_size(8)
            place.locator_params(axis="x", nbins=4)
        places[0].set_ylabel(f"{item.course.channel} [{said(item.course.unit)}]", fontsize=8)
    return png(figure)

"""`helideck see pad`."""

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from flightlog.errors import UserError
from helideck.cli.document import emit


@dataclass(frozen=True)
class SeePad:
    """Find the landing mark in pictures and say where it lies.

    An H may have any plain proportions; they are measured in the picture. Without roll and pitch the tilt is solved
    where the mark is large enough to carry it, else level is assumed. Exit code 0 when every picture could be read.

    Example: helideck see pad photo.png --size 1.0 --fx 950 --roll-deg 2 --pitch-deg -1
    """

    images: tyro.conf.Positional[tuple[Path, ...]]
    """Pictures of one camera that looks down, image up being forward."""

    size: float
    """Length [m] of the H's legs; outer diameter of the outermost ring."""

    fx: float
    """Focal length [px] along image rows."""

    fy: float | None = None
    """Focal length [px] along image columns; by default fx."""

    cx: float | None = None
    """Principal point [px], pixel centres at integers; by default the centre."""

    cy: float | None = None
    """The same, downward."""

    dist: Annotated[str | None, tyro.conf.arg(metavar="K1,K2,P1,P2,K3")] = None
    """Lens distortion of OpenCV's model, the last ones may be left out."""

    roll_deg: float | None = None
    """The carrier's roll, right side down positive."""

    pitch_deg: float | None = None
    """The carrier's pitch, nose up positive."""

    attitude: Path | None = None
    """CSV with a header: roll_deg, pitch_deg and image (file name), or t [s] (last number in a picture's name)."""

    mark: Literal["h", "ring"] = "h"
    """What is painted on the pad."""

    variant: Literal["helideck", "published"] = "helideck"
    """Ours, or the paper's."""

    json: bool = False
    """One JSON document on stdout: a list, one entry a picture."""

    def run(self) -> int:
        """Look at all of them."""
        from helideck.pictures import PictureError
        from helideck.seeing_pad import PadViewer, as_line
        from helideck.show import campaign_progress

        if not self.images:
            raise UserError("see pad: name at least one picture")
        viewer = PadViewer.of(self)
        answers, faults = [], 0
        with campaign_progress("looking") as progress:
            for number, path in enumerate(self.images):
                try:
                    answers.append(asdict(viewer.look(path)))
                except PictureError as error:
                    faults += 1
                    print(f"helideck: {error}", file=sys.stderr)
                    answers.append({"image": str(path), "found": None, "error": str(error)})
                progress(number + 1, len(self.images))
        if self.json:
            emit(answers)
        else:
            for answer in answers:
                print(as_line(answer))
        return 2 if faults else 0

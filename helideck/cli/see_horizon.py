"""`helideck see horizon`."""

import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from flightlog.errors import UserError
from helideck.cli.document import emit


@dataclass(frozen=True)
class SeeHorizon:
    """Roll and pitch from the horizon in pictures of a camera that looks along the nose.

    Exit code 0 when every picture could be read. As published, pictures come in pairs: camera A on the nose axis, then
    camera B 10 degrees lower, with one answer a pair.

    Example: helideck see horizon nose_*.jpg --fx 560 --height 120 --json
    """

    images: tyro.conf.Positional[tuple[Path, ...]]
    """Pictures of one camera, image up being the carrier's up."""

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

    height: float | None = None
    """Camera's height [m] above land or sea: pitch is then to the true horizontal, else to the visible horizon."""

    variant: Literal["helideck", "published"] = "helideck"
    """Ours, or the paper's."""

    json: bool = False
    """One JSON document on stdout: a list, one entry a picture or pair."""

    def run(self) -> int:
        """Look at all of them."""
        from helideck.pictures import PictureError
        from helideck.seeing_horizon import HorizonViewer, as_line
        from helideck.show import campaign_progress

        if not self.images:
            raise UserError("see horizon: name at least one picture")
        step = 2 if self.variant == "published" else 1
        if len(self.images) % step:
            raise UserError(
                f"see horizon: {len(self.images)} pictures, an odd number; --variant published takes pairs, A then B"
            )
        viewer = HorizonViewer.of(self)
        answers, faults = [], 0
        with campaign_progress("looking") as progress:
            for first in range(0, len(self.images), step):
                paths = self.images[first : first + step]
                try:
                    answers.append(asdict(viewer.look(paths)))
                except PictureError as error:
                    faults += 1
                    print(f"helideck: {error}", file=sys.stderr)
                    answers.append({"image": str(paths[0]), "found": None, "error": str(error)})
                progress(first + step, len(self.images))
        if self.json:
            emit(answers)
        else:
            for answer in answers:
                print(as_line(answer))
        return 2 if faults else 0

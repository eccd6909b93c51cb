"""`helideck see flow`."""

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from helideck.cli.document import emit


@dataclass(frozen=True)
class SeeFlow:
    """Velocity over the ground from two pictures, one shortly after the other.

    Exit code 0 when both pictures could be read; where nothing in them matches, the velocity is null.

    Example: helideck see flow one.png two.png --fx 950 --height 1.2 --dt 0.04 --gyro 0.02,-0.01,0
    """

    first: tyro.conf.Positional[Path]
    """Picture of a camera that looks down, image up being forward."""

    second: tyro.conf.Positional[Path]
    """Picture of the same camera, taken later."""

    fx: float
    """Focal length [px] along image rows."""

    height: float
    """Camera's height [m] above the ground."""

    dt: float
    """Time [s] between the pictures."""

    fy: float | None = None
    """Focal length [px] along image columns; by default fx."""

    cx: float | None = None
    """Principal point [px], pixel centres at integers; by default the centre."""

    cy: float | None = None
    """The same, downward."""

    dist: Annotated[str | None, tyro.conf.arg(metavar="K1,K2,P1,P2,K3")] = None
    """Lens distortion of OpenCV's model, the last ones may be left out."""

    gyro: Annotated[str | None, tyro.conf.arg(metavar="WX,WY,WZ")] = None
    """Carrier's mean angular rate [rad/s] about x forward, y left, z up; by default none."""

    roll_deg: float = 0.0
    """Carrier's roll at the second picture, right side down positive."""

    pitch_deg: float = 0.0
    """Carrier's pitch at the second picture, nose up positive."""

    variant: Literal["helideck", "published"] = "helideck"
    """Ours, or the paper's: whole pixels, small angles."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Compare them."""
        from helideck.pictures import PictureError, camera_of, read_grey
        from helideck.seeing_flow import Flight, look, parse_rates

        flight = Flight(
            self.height, self.dt, parse_rates(self.gyro), math.radians(self.roll_deg), math.radians(self.pitch_deg)
        )
        try:
            pictures = read_grey(self.first), read_grey(self.second)
            camera = camera_of(pictures[0], self.fx, self.fy, self.cx, self.cy, self.dist)
            answer = look((self.first, self.second), pictures, camera, flight, self.variant)
        except PictureError as error:
            if self.json:
                emit({"error": str(error)})
            print(f"helideck: {error}", file=sys.stderr)
            return 2
        if self.json:
            emit(answer)
        elif answer.found:
            print(
                f"forward {answer.vx_m_s:+.4f} m/s, left {answer.vy_m_s:+.4f} m/s, quality {answer.quality:.2f} "
                f"(picture moved {answer.u_px:+.2f} px right, {answer.v_px:+.2f} px down)"
            )
        else:
            print("nothing in the pictures matches")
        return 0

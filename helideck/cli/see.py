"""`helideck see <what>`: one file for what is looked for, `see_<what>.py`, as a verb is one file."""

from dataclasses import dataclass
from typing import Literal

import tyro

from flightlog.errors import UserError

SIGHTS: tuple[str, ...] = (  # see_<sight>.py with the dataclass See<Sight>
    "pad",
    "horizon",
    "flow",
)


@dataclass(frozen=True)
class See:
    """Vision on pictures of your own: the pad, the horizon, the ground's motion.

    `helideck see pad --help` and so on tell more.

    Example: helideck see pad photo.png --size 1.0 --fx 950
    """

    what: tyro.conf.Positional[Literal["pad", "horizon", "flow"]]
    """What to look for."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Unreachable by the command line, which goes to the sight's own words."""
        raise UserError(f"see {self.what}: there is no such sight yet; there are {', '.join(SIGHTS)}")

"""`helideck vehicle`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from flightlog.errors import UserError
from helideck.cli.document import emit

Kind = Literal["helicopter", "multirotor", "rig"]
MODELS: dict[str, str] = {"helicopter": "raptor90", "multirotor": "crazyflie", "rig": "lab_helicopter"}


@dataclass(frozen=True)
class Vehicle:
    """Write a vehicle file to start from: one of the project's own of that kind, every number with unit and source.

    Example: helideck vehicle my_quad --kind multirotor
    """

    name: tyro.conf.Positional[str]
    """Of the vehicle: NAME.toml is written here."""

    kind: Kind = "helicopter"
    """What it is; a rig is any hinged MJCF driven by inputs."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Write the template."""
        from sim.kinds import load
        from sim.vehicle import find

        path = Path(self.name if self.name.endswith(".toml") else f"{self.name}.toml")
        if path.exists():
            raise UserError(f"{path}: is there already; a name that is not taken would be right")
        pattern = MODELS[self.kind]
        head = (
            f"# A {self.kind}, begun from {pattern}: put your own value, unit, tolerance and source to each number.\n"
            "# tolerance: one standard deviation of what you do not know. Paths are sought beside this file, then in\n"
            "# the project.\n#\n"
        )
        try:
            path.write_text(head + find(pattern).read_text(encoding="utf-8"), encoding="utf-8")
        except OSError as error:
            raise UserError(f"{path}: cannot be written: {error.strerror}") from None
        load(path)
        if self.json:
            emit({"vehicle": str(path), "kind": self.kind})
        else:
            print(path)
        return 0

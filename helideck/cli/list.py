"""`helideck list`."""

from dataclasses import dataclass
from typing import Literal

import tyro

from helideck.cli.document import emit


@dataclass(frozen=True)
class List:
    """Say what there is: scenarios, vehicles, terms of the model, sensors, causes that a diagnosis knows.

    Example: helideck list scenarios
    """

    what: tyro.conf.Positional[Literal["scenarios", "vehicles", "terms", "sensors", "navigators", "causes"]]
    """Which list."""

    json: bool = False
    """One JSON document on stdout."""

    def run(self) -> int:
        """Print the list."""
        from helideck.listing import LISTS

        rows = LISTS[self.what]()
        if self.json:
            emit([{"name": name, "description": text} for name, text in rows.items()])
        else:
            width = max(map(len, rows), default=0)
            for name, text in rows.items():
                print(f"{name:<{width}}  {text}")
        return 0

"""DataFlash messages with a clock for those that carry none."""

from collections.abc import Mapping
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError
from flightlog.readers.dataflash import Messages
from flightlog.readers.log import Draft
from flightlog.readers.row_clock import RowClock

Floats = NDArray[np.float64]

HELICOPTER = ("HS1_", "H_COL_", "H_SW", "H_RSC", "H_SV")  # parameters that only a helicopter has
CLOCKS = (("TimeUS", 1e-6), ("T", 1e-3), ("TimeMS", 1e-3))


class Source:
    """The messages with a clock for those that carry none."""

    def __init__(self, messages: Mapping[str, Messages], draft: Draft) -> None:
        self.messages, self.draft = messages, draft
        self.parameters = _parameters(messages.get("PARM"))
        self.copter = not any(name.startswith(HELICOPTER) for name in self.parameters)
        self.copter &= self.parameters.get("FRAME_CLASS") not in (6.0, 11.0, 13.0)
        self._untimed: set[str] = set()
        self._clock = self._row_clock()

    def get(self, name: str, *columns: str) -> Messages | None:
        """Messages of that name, if they have all these columns and a number in one."""
        found = self.messages.get(name)
        if found is None or not len(found) or not all(column in found for column in columns):
            return None
        return found

    def instances(self, name: str, *columns: str) -> list[Messages]:
        """Messages of one kind by device: told apart by a column, or by a number in their name."""
        found = []
        for number in count(1):
            message = self.get(name if number == 1 else f"{name}{number}", *columns)
            if message is None and number > 2:
                break
            if message is None:
                continue
            which = message.first("I", "Instance", "Inst")
            if which is None:
                found.append(message)
            else:
                found += [message.only(message[which] == i) for i in np.unique(message[which])]
        return found

    def time(self, message: Messages) -> tuple[Floats, bool]:
        """(time (N,) [s], whether the messages carry it)."""
        own = _own_time(message)
        if own is not None:
            return own, True
        if message.name == "GPS" and (column := message.first("Time", "TimeMS")):
            return message[column] * 1e-3, True
        if self._clock is None:
            path = self.draft.path
            raise UserError(f"{path}: its {message.name} rows have no time, and there are no GPS rows to place them by")
        t, paused = self._clock.at(message.place)
        if message.name not in self._untimed:
            self._untimed.add(message.name)
            self.draft.note(
                f"{message.name}: rows carry no time; placed by their order between GPS rows"
                + (f", {paused} of them in a pause of the log, right behind its beginning" if paused else "")
            )
        return t, False

    def add(self, topic: str, message: Messages, columns: Mapping[str, Any], **further: dict[str, str]) -> None:
        """Put a message's columns into the draft as a topic."""
        t, timed = self.time(message)
        self.draft.add(topic, {"t": t, **columns}, timed=timed, units=further.get("units"))

    @staticmethod
    def _stamps(message: Messages) -> Floats:
        own = _own_time(message)
        return message[message.first("Time", "TimeMS") or "Time"] * 1e-3 if own is None else own

    def _row_clock(self) -> RowClock | None:
        """By all rows on the firmware's own clock, or where there are none by the GPS rows."""
        timed = [m for m in self.messages.values() if m.name not in ("GPS", "PARM", "FMTU") and len(m) > 1
                 and _own_time(m) is not None]  # fmt: skip
        gps = self.messages.get("GPS")
        if gps is not None and (_own_time(gps) is not None or (not timed and gps.first("Time", "TimeMS"))):
            timed.append(gps)
        if not timed:
            return None
        place = np.concatenate([m.place for m in timed])
        t = np.concatenate([self._stamps(m) for m in timed])
        order = np.argsort(place, kind="stable")
        return RowClock(place[order], t[order]) if len(place) > 1 else None


def _own_time(message: Messages) -> Floats | None:
    """The firmware's clock of each row [s]; None where there is none. A GPS row's TimeMS is the satellites'."""
    for name, factor in CLOCKS:
        if name in message and not (message.name == "GPS" and name == "TimeMS"):
            return message[name] * factor
    return None


def _parameters(message: Messages | None) -> dict[str, float]:
    if message is None or "Name" not in message or "Value" not in message:
        return {}
    return {str(name): float(value) for name, value in zip(message["Name"], message["Value"], strict=True)}


def is_whole(message: Messages, column: str) -> bool:
    """Whether the firmware wrote a column as whole numbers without a factor."""
    return message.formats.get(column, "") in tuple("bBhHiIqQ")

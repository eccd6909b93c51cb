"""Roll and pitch of what carried the camera, for pictures of the user's own."""

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flightlog.errors import UserError

Floats = NDArray[np.float64]

FARTHEST = 0.1  # [s] between a picture and the nearest row


@dataclass(frozen=True, eq=False)
class AttitudeTable:
    """Roll and pitch [rad] by picture, or by time.

    The file is CSV with a header: `roll_deg`, `pitch_deg` and either `image` (the picture's file name) or `t` [s], to
    which the last number in a picture's file name is then its time.
    """

    path: Path
    by_name: dict[str, tuple[float, float]]
    times: Floats  # (N,) [s] rising
    angles: Floats  # (N, 2) [rad]

    @classmethod
    def read(cls, path: Path) -> "AttitudeTable":
        """The table of a file. Raises UserError where it is none."""
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                rows = list(csv.DictReader(file, skipinitialspace=True))
        except FileNotFoundError:
            raise UserError(f"{path}: no such file") from None
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise UserError(f"{path}: cannot be read as CSV: {error}") from None
        columns = {str(name).strip() for name in (rows[0] if rows else {})}
        if not {"roll_deg", "pitch_deg"} <= columns or not columns & {"image", "t"}:
            raise UserError(f"{path}: must have a header with roll_deg, pitch_deg and image or t")
        key = "image" if "image" in columns else "t"
        by_name, times, angles = {}, [], []
        for number, row in enumerate(rows, 2):
            angle = (_number(path, number, row, "roll_deg"), _number(path, number, row, "pitch_deg"))
            if max(map(abs, angle)) >= 90.0:
                raise UserError(f"{path}:{number}: roll_deg and pitch_deg must lie within 90")
            radians = (math.radians(angle[0]), math.radians(angle[1]))
            if key == "image":
                by_name[Path((row["image"] or "").strip()).name] = radians
            else:
                times.append(_number(path, number, row, "t"))
                angles.append(radians)
        order = np.argsort(times, kind="stable")
        return cls(path, by_name, np.array(times, float)[order], np.array(angles, float).reshape(-1, 2)[order])

    def of(self, picture: Path) -> tuple[float, float]:
        """Roll and pitch [rad] of a picture, between rows by line. Raises UserError where the table has none."""
        if self.by_name:
            if picture.name not in self.by_name:
                raise UserError(f"{self.path}: has no row for the picture {picture.name}")
            return self.by_name[picture.name]
        numbers = re.findall(r"\d+(?:\.\d+)?", picture.stem)
        if not numbers:
            raise UserError(f"{picture}: no number in its name that could be its time in {self.path}")
        t = float(numbers[-1])
        if not np.min(np.abs(self.times - t)) <= FARTHEST:
            raise UserError(f"{self.path}: has no row within {FARTHEST} s of {t}, the time of {picture.name}")
        roll, pitch = (float(np.interp(t, self.times, self.angles[:, i])) for i in (0, 1))
        return roll, pitch


def _number(path: Path, line: int, row: dict[str, str], column: str) -> float:
    try:
        value = float(row[column])
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise UserError(f"{path}:{line}: {column}: {row[column]!r} is no number")
    return value

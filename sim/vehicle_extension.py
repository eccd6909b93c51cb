"""What `helideck diagnose` writes into an extended vehicle file about where its changes come from."""

from typing import Annotated

from pydantic import Field

from sim.vehicle_numbers import Strict


class Source(Strict):
    """A log that the changes were fitted to."""

    log: str
    sha256: str  # of its files


class Covariance(Strict):
    """What is known of the changed numbers together, SI."""

    keys: list[str]
    matrix: list[list[float]]


class Extension(Strict):
    """Which file was extended, by what, from which logs, and where the result holds."""

    of: str  # name of the vehicle file
    of_sha256: str
    causes: list[str]
    by: str  # version of what wrote it
    logs: list[Source]
    covariance: Covariance
    visited: dict[str, Annotated[list[float], Field(min_length=2, max_length=2)]] = Field(default={})  # least, greatest

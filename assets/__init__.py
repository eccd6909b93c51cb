"""Data alone: MJCF of vehicles, pads and scenes, and vehicle files."""

from pathlib import Path


def path(*parts: str) -> Path:
    """Where the data file of these path parts lies, for example `path("scenes", "field.xml")`."""
    return Path(__file__).parent.joinpath(*parts)

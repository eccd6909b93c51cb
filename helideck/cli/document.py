"""What `--json` prints."""

import sys
from typing import Any


def emit(document: object) -> None:
    """Print one RFC 8259 document on stdout: dataclasses, arrays and paths are understood, NaN becomes null."""
    from pydantic_core import to_json

    sys.stdout.write(to_json(document, indent=2, inf_nan_mode="null", fallback=plain).decode() + "\n")


def plain(value: Any) -> Any:
    """Numpy's arrays and scalars as Python's."""
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no place in a JSON document")

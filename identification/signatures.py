"""What every parameter does to a flight's whitened innovations: columns by name, side by side in one matrix."""

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Signatures(Mapping[str, Floats]):
    """Columns (R,) by parameter, which stand side by side in one matrix."""

    def __init__(self, keys: tuple[str, ...], matrix: Floats) -> None:
        """Columns of `matrix` (R, K), one a key."""
        self.names, self.matrix = keys, matrix
        self._place = {key: i for i, key in enumerate(keys)}

    def __getitem__(self, key: str) -> Floats:
        """(R,) of one parameter."""
        return np.asarray(self.matrix[:, self._place[key]])

    def __iter__(self) -> Iterator[str]:
        """Names, in order."""
        return iter(self.names)

    def __len__(self) -> int:
        """How many."""
        return len(self.names)

"""How far numbers of causes may be off, beyond what is linear about the fit says.

That takes the model's form for right. What known numbers came to beyond it is a factor for all of a kind of vehicle
(`widened` of its bench), and for some a share of what was found (`Parameter.open_share`).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from identification.causes.contract import Cause
from identification.refit import Refit

Floats = NDArray[np.float64]


def covariance(causes: Sequence[Cause], fit: Refit, nominal: Mapping[str, float], by: float) -> Floats:
    """(P, P) of the fit's numbers in the order of its `values`; by: what linear deviations are multiplied by."""
    shares = {p.key: p.open_share for cause in causes for p in cause.parameters}
    beside = [shares.get(key, 0.0) * (value - nominal[key]) for key, value in fit.values.items()]
    return np.asarray(by**2 * fit.covariance + np.diag(np.square(beside)))

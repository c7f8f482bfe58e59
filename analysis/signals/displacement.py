"""What every tool for a whole record asks of the displacement towards the two probes."""

import math

import numpy as np
from numpy.typing import NDArray


def require_displacement(displacement: NDArray[np.float64], rate: float) -> None:
    """Raise ValueError where displacement is not of two probes, shape (2, n), finite, m, or its rate not above 0 Hz."""
    if displacement.ndim != 2 or displacement.shape[0] != 2:
        raise ValueError(f"displacement: shape {displacement.shape}, expected (2, n), m at the probes x and y")
    if not np.isfinite(displacement).all():
        raise ValueError("displacement: holds values that are not finite, expected metres")
    if not 0.0 < rate < math.inf:
        raise ValueError(f"rate: {rate} Hz, expected above 0")

"""State levels of a two-level signal such as a tacho's, and suitable switching levels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

EXTREME_PERCENTILES = (0.2, 99.8)  # samples outside are ignored
MIN_SEPARATION = 0.1  # V
MAX_BETWEEN = 0.2  # fraction of the samples in the middle half of the range; a sine has a third there
MIN_SEPARATION_SIGMAS = 6.0  # times the scatter, of levels that are not noise
MAD_TO_RMS = 1.4826  # of normal noise
HYSTERESIS_FRACTION = 0.25  # of the separation: rejects noise, and switches in the steep middle of the edges
HYSTERESIS_SIGMAS = 8.0  # times the scatter
MAX_HYSTERESIS_FRACTION = 0.6  # of the separation


@dataclass(frozen=True, slots=True)
class SignalLevels:
    """The two levels between which a voltage switches.

    Parameters
    ----------
    low, high : float
        Medians of the lower and the upper level, V.
    scatter : float
        Robust standard deviation about the levels, the larger of both, V.
    high_fraction : float
        Fraction of the samples above the middle, 0 to 1.
    """

    low: float
    high: float
    scatter: float
    high_fraction: float

    @property
    def separation(self) -> float:
        """Distance of the levels, V."""
        return self.high - self.low

    @property
    def middle(self) -> float:
        """Halfway between the levels, V."""
        return 0.5 * (self.low + self.high)

    @property
    def hysteresis(self) -> float:
        """Suitable hysteresis, V: a quarter of the separation, more with noise."""
        wanted = max(HYSTERESIS_FRACTION * self.separation, HYSTERESIS_SIGMAS * self.scatter)
        return min(wanted, MAX_HYSTERESIS_FRACTION * self.separation)


def find_state_levels(volts: FloatArray) -> SignalLevels | None:
    """Return the two levels of a voltage; None where it does not switch between two levels.

    Parameters
    ----------
    volts : ndarray of float64, shape (n,)
        Consecutive samples, V.

    Raises
    ------
    ValueError
        There are no samples, or not one dimension.

    Notes
    -----
    State levels of a pulse signal as in IEEE Std 181, but from quantiles and medians instead of a histogram.
    """
    if volts.ndim != 1 or volts.size == 0:
        raise ValueError(f"volts: shape {volts.shape}, expected (n,) with n > 0")
    bottom, top = np.percentile(volts, EXTREME_PERCENTILES)
    span = top - bottom
    if span < MIN_SEPARATION:
        return None
    between = np.mean((volts > bottom + 0.25 * span) & (volts < top - 0.25 * span))
    if between > MAX_BETWEEN:
        return None
    is_high = volts > 0.5 * (bottom + top)
    levels = [float(np.median(volts[part])) for part in (~is_high, is_high)]
    scatters = [
        MAD_TO_RMS * float(np.median(np.abs(volts[part] - level)))
        for part, level in zip((~is_high, is_high), levels, strict=True)
    ]
    found = SignalLevels(levels[0], levels[1], max(scatters), float(np.mean(is_high)))
    return found if found.separation >= max(MIN_SEPARATION, MIN_SEPARATION_SIGMAS * found.scatter) else None

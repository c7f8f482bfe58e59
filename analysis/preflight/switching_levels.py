"""The two levels of a switching sensor's voltage, and the switching levels that suit them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

EXTREME_PERCENTILES = (0.2, 99.8)  # percent of the samples: what lies outside is not asked
MIN_SEPARATION = 0.1  # V
MAX_BETWEEN = 0.2  # part of the samples in the middle half of the span: a sine has a third there
MIN_SEPARATION_SIGMAS = 6.0  # of the scatter: how far apart two levels are that are no noise
MAD_TO_RMS = 1.4826  # of normal noise
HYSTERESIS_FRACTION = 0.25  # of the separation: keeps noise from counting and leaves the edges their steep middle
HYSTERESIS_SIGMAS = 8.0  # of the scatter
MAX_HYSTERESIS_FRACTION = 0.6  # of the separation


@dataclass(frozen=True, slots=True)
class SignalLevels:
    """The levels between which a voltage switches.

    Parameters
    ----------
    low, high : float
        Medians of the lower and the upper level, V.
    scatter : float
        Robust standard deviation about its level, the larger of both, V.
    high_fraction : float
        Part of the samples above the middle, 0 to 1.
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
        """Distance of the two switching levels that suits them, V: a quarter of the swing, more where it is noisy."""
        wanted = max(HYSTERESIS_FRACTION * self.separation, HYSTERESIS_SIGMAS * self.scatter)
        return min(wanted, MAX_HYSTERESIS_FRACTION * self.separation)


def find_state_levels(volts: FloatArray) -> SignalLevels | None:
    """Return the two levels of a voltage; None where it does not switch between two.

    Parameters
    ----------
    volts : ndarray of float64, shape (n,)
        Consecutive samples, V.

    Raises
    ------
    ValueError
        There are no samples, or they are no single row.

    Notes
    -----
    State levels as IEEE Std 181 has them for pulses, by quantiles and medians in place of a histogram.
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

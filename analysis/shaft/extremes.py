"""The extremes of many samples but for a few at either end, sooner than by ranking all of them."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SKETCH = 16  # of so many samples one is looked at first
MARGIN = 8  # samples of that sketch, beyond those that belong to the few
GLITCH_TIME = 2e-4  # s at either extreme of an interval that does not count as the shaft's: a sensor's glitches,
GLITCH_PART = 50  # and at most one sample in so many


def glitch_samples(size: int, rate: float) -> int:
    """Return how many of so many samples at a rate, Hz, do not count at either extreme, as glitches lie there."""
    return min(round(GLITCH_TIME * rate), size // GLITCH_PART)


def trimmed_extremes(samples: FloatArray, spare: int) -> tuple[FloatArray, FloatArray]:
    """Return the smallest and the largest sample of each row that are left without the few at either end.

    Parameters
    ----------
    samples : ndarray of float64, shape (n_rows, n)
        Any unit, without NaN; n more than ``2 * spare``.
    spare : int
        So many at either end do not count.

    Returns
    -------
    low, high : ndarray of float64, shape (n_rows,)
        The samples of rank ``spare`` from below and from above, counted from 0, exactly.

    Notes
    -----
    A sample of the values bounds the few that are ranked: R. Floyd and R. Rivest, Expected time bounds for selection,
    CACM 18, 1975.
    """
    if samples.ndim != 2 or not 0 <= 2 * spare < samples.shape[1]:
        raise ValueError(f"samples, spare: shape {samples.shape} and {spare}, expected (n_rows, n) and less than n / 2")
    low, high = np.empty(len(samples)), np.empty(len(samples))
    for row, values in enumerate(samples):
        sketch = np.sort(values[::SKETCH])
        place = min(2 * spare // SKETCH + MARGIN, sketch.size - 1)
        few = values[values <= sketch[place]]
        low[row] = np.partition(few if few.size > spare else values, spare)[spare]
        few = values[values >= sketch[-1 - place]]
        from_above = few if few.size > spare else values
        high[row] = np.partition(from_above, from_above.size - 1 - spare)[from_above.size - 1 - spare]
    return low, high

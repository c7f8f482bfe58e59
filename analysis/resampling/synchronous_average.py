"""What repeats with every turn of the shaft, and what is left of the record without it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousAverage:
    """The mean revolution.

    Parameters
    ----------
    waveform : ndarray of float64, shape (2, points)
        Towards the probes x and y, from the mark on, m, the mean displacement included.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of its points, m: the rms of the rest over the root of the revolutions, for a rest that
        does not repeat.
    revolutions : int
        Averaged.
    """

    waveform: FloatArray
    sigma: FloatArray
    revolutions: int


def synchronous_average(record: AngularRecord) -> SynchronousAverage:
    """Return the mean revolution of a record at about one speed (S. Braun, Acustica 32, 1975)."""
    mean = record.waveform.mean(axis=1)
    rest = np.sqrt(np.mean((record.waveform - mean[:, None]) ** 2, axis=(1, 2)))
    return SynchronousAverage(mean, rest / np.sqrt(record.revolutions), record.revolutions)


def synchronous_residual(record: AngularRecord, revolutions: int = 16) -> AngularRecord:
    """Return the record without what repeats: each revolution less the mean of those about it.

    What is left is whirl, rub and noise. A component of order q is kept but for the part 1 / revolutions that its own
    mean has at most; 1X, 2X and all whole orders go as far as they are steady over the revolutions averaged.

    Parameters
    ----------
    record : AngularRecord
        At any speed, running up too.
    revolutions : int
        Averaged about each revolution; at least 2.

    Raises
    ------
    RecordTooShortError
        Where the record holds fewer.

    Notes
    -----
    P. McFadden, A revised model for the extraction of periodic waveforms by time domain averaging, MSSP 1, 1987.
    """
    if revolutions < 2:
        raise ValueError(f"revolutions: {revolutions}, expected at least 2")
    if record.revolutions < revolutions:
        raise RecordTooShortError(f"{record.revolutions} revolutions in the record, expected at least {revolutions}")
    mean = uniform_filter1d(record.waveform, revolutions, axis=1, mode="nearest")
    return record.with_waveform(record.waveform - mean)

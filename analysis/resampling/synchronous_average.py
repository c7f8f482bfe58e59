"""Time-synchronous average over the revolutions of a record, and the residual without it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class SynchronousAverage:
    """The mean revolution of a record.

    Parameters
    ----------
    waveform : ndarray of float64, shape (2, points)
        Displacement towards the probes x and y from theta = 0 on, m, including the mean displacement.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of its points, m: the rms of the residual over the root of the revolutions, for a residual
        that does not repeat.
    revolutions : int
        Number of averaged revolutions.
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
    """Return the synchronous residual of a record: each revolution minus the mean of its neighbours.

    The residual contains whirl, rub and noise. 1X, 2X and all whole orders are removed as far as they are steady over
    the averaged revolutions. A component of non-integer order loses at most 1 / revolutions of its amplitude.

    Parameters
    ----------
    record : AngularRecord
        At any speed, also a run-up.
    revolutions : int
        Number of revolutions averaged around each revolution; at least 2.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions.

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

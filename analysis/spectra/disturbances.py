"""What is in a probe's signal that the shaft did not do: drift of its mean, and hum of the mains."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.spectra.slow_lines import MainsLine, SlowSignal

FloatArray = NDArray[np.float64]

BLOCKS = 20  # of the record, of which the means are compared
SHORTEST_HUM = 0.4  # s
CLEAR = 4.0  # standard deviations of the slope


@dataclass(frozen=True, slots=True)
class Drift:
    """How the mean of a signal moves with time.

    Parameters
    ----------
    slope : float
        Of a straight line through the means, unit/s.
    sigma : float
        Standard deviation of the slope, from how the means scatter about the line.
    total : float
        Over the record, in the signal's unit.
    """

    slope: float
    sigma: float
    total: float

    @property
    def is_clear(self) -> bool:
        """Whether the slope stands 4 standard deviations from none."""
        return abs(self.slope) > CLEAR * self.sigma


def drift(values: FloatArray, rate: float) -> Drift:
    """Return the drift of a signal at about one speed: least squares through the means of twenty blocks.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Uniformly in time, any unit.
    rate : float
        Sample rate, Hz.

    Raises
    ------
    RecordTooShortError
        With fewer than 200 samples.

    Notes
    -----
    Batch means make the errors of the blocks nearly independent (B. Schmeiser, Operations Research 30, 1982).
    """
    if values.ndim != 1 or not np.isfinite(values).all():
        raise ValueError(f"values: shape {values.shape}, expected (n,), finite")
    n = values.size // BLOCKS
    if n < 10:
        raise RecordTooShortError(f"{values.size} samples, expected at least {10 * BLOCKS}")
    means = values[: n * BLOCKS].reshape(BLOCKS, n).mean(axis=1)
    time = (np.arange(BLOCKS) - 0.5 * (BLOCKS - 1)) * n / rate
    slope = float(time @ means / (time @ time))
    rest = means - means.mean() - slope * time
    sigma = float(np.sqrt(rest @ rest / (BLOCKS - 2) / (time @ time)))
    return Drift(slope, sigma, slope * values.size / rate)


def mains_hum(values: FloatArray, rate: float, record: AngularRecord | None = None) -> MainsLine:
    """Return the mains' line in a signal, told from the shaft's orders where its angle is known.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        A second or more, uniformly in time, any unit.
    rate : float
        Sample rate, Hz.
    record : AngularRecord or None
        Of the same samples, for the shaft's angle; the speed should not change by more than a few per cent.

    Raises
    ------
    RecordTooShortError
        With less than 0.4 s, too little to tell 50 Hz from 60 Hz.

    Notes
    -----
    The shaft's lowest orders are taken out by least squares; the line is then the highest of a windowed spectrum near
    50 or 60 Hz (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    if values.ndim != 1 or not rate > 0.0:
        raise ValueError(f"values: shape {values.shape} at {rate} Hz, expected (n,) at a rate above 0")
    time = np.arange(values.size) / rate
    begin, end = (record.times[0], record.times[-1]) if record is not None else (-np.inf, np.inf)
    inside = (time >= begin) & (time <= end)
    seconds = float(np.count_nonzero(inside) / rate)
    if seconds < SHORTEST_HUM:
        raise RecordTooShortError(f"{seconds:.3f} s of samples, expected at least {SHORTEST_HUM} s to tell the mains")
    angle = None
    if record is not None:
        turns = np.arange(record.times.size, dtype=np.float64)
        angle = 2.0 * np.pi * np.interp(time[inside], record.times, turns)
    return SlowSignal(values[inside], rate, angle).mains()

"""Disturbances in a probe signal: mains hum, separated from the shaft's orders, and drift of the mean."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import ComplexArray, FloatArray
from analysis.signals.errors import RecordTooShortError
from analysis.signals.uncertainty import noise_floor_sigma
from analysis.spectra.windows import HANN

Number = TypeVar("Number", np.float64, np.complex128)

TAU = 2.0 * np.pi
SLOW_RATE = 5000.0  # Hz, of the decimated signal: mains and low shaft orders lie well below
MAINS_FREQUENCIES = (50.0, 60.0)  # Hz
MAX_MAINS_OFFSET = 0.6  # Hz, of the highest line from the mains frequency, for a resolution of about 1 s
SEARCH_WIDTH = 5.0  # Hz on either side of the mains frequency
SEARCH_STEP = 0.1  # Hz
SKIRT_LINES = HANN.main_lobe + 0.5  # lines on either side of the mains line that the window's main lobe covers
BASE_RATE = 100.0  # Hz, of the signal shifted down by a mains frequency: the search width lies well below
ORDERS = (1, 2, 3, 4)  # of the shaft that are subtracted
MIN_SEPARABLE_ENERGY = 0.5  # fraction of a mains line's energy that is no linear combination of shaft orders
MIN_RELATIVE_POWER = 1e-10  # of the largest eigenvalue: smaller ones are linearly dependent
MOTION_BAND = (2.0, 1000.0)  # Hz
DRIFT_BLOCKS = 20  # of the record; the trend is fitted to their means
MIN_HUM_DURATION = 0.4  # s
MIN_SLOPE_SIGMAS = 4.0  # standard deviations of the slope


@dataclass(frozen=True, slots=True)
class MainsLine:
    """The mains line in a signal.

    Parameters
    ----------
    frequency : float
        50 or 60, Hz.
    amplitude : float
        Peak, in the unit of the signal; 0 where no line stands out. Includes a shaft order at the same frequency.
    sigma : float
        Standard deviation of the amplitude, from the noise beside the line, without the contribution of shaft orders.
    is_separable : bool
        Whether the line can be separated from the shaft orders.
    """

    frequency: float
    amplitude: float
    sigma: float
    is_separable: bool


class LowFrequencySignal:
    """A stretch of a decimated signal, with the shaft orders separated where the shaft angle is known.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Consecutive samples, any unit.
    rate : float
        Sample rate, Hz.
    angle : ndarray of float64, shape (n,), or None
        Shaft angle at the samples, rad; None where unknown.
    """

    def __init__(self, values: FloatArray, rate: float, angle: FloatArray | None = None) -> None:
        if values.ndim != 1 or (angle is not None and angle.shape != values.shape):
            shape = None if angle is None else angle.shape
            raise ValueError(f"values: shape {values.shape} with angle {shape}, expected both (n,)")
        if values.size == 0 or not np.isfinite(values).all():
            raise ValueError(f"values: {values.size} samples, expected some, all finite")
        step = max(int(rate / SLOW_RATE), 1)
        thinned = _thinned(values, step)
        self._rate = rate / step
        self._time = np.arange(thinned.size) / self._rate
        self._window = np.hanning(thinned.size + 2)[1:-1]
        trend_columns = [np.ones_like(self._time), self._time]
        self._order_columns = [] if angle is None else _columns_of_orders(_thinned(angle, step))
        self._basis = np.stack([*trend_columns, *self._order_columns], axis=1)
        weighted = self._window[:, np.newaxis] * self._basis
        powers, turn = np.linalg.eigh(weighted.T @ weighted)
        turn = turn[:, powers > MIN_RELATIVE_POWER * powers[-1]] / np.sqrt(
            powers[powers > MIN_RELATIVE_POWER * powers[-1]]
        )
        self._factor = weighted @ turn  # orthonormal columns that span mean, trend and orders
        solution = turn @ (self._factor.T @ (self._window * thinned))
        self._solution = solution
        self._residual = self._window * (thinned - self._basis @ solution)
        self._detrended = self._residual + self._window * (self._basis[:, 2:] @ solution[2:])

    @property
    def vectors(self) -> ComplexArray:
        """Complex peak amplitudes of the shaft orders 1 to 4, mean over the stretch; empty without an angle.

        x(t) = Re[X exp(i k theta)].
        """
        if not self._order_columns:
            return np.empty(0, dtype=np.complex128)
        cosine, sine = self._solution[2::4], self._solution[3::4]
        return np.asarray(cosine - 1j * sine, dtype=np.complex128)

    def mains_line(self) -> MainsLine:
        """Return the stronger of the lines at 50 and 60 Hz."""
        return max((self._line(frequency) for frequency in MAINS_FREQUENCIES), key=lambda line: line.amplitude)

    def motion_rms(self) -> float:
        """Return the rms between 2 and 1000 Hz without the mains lines, in the unit of the signal."""
        spectrum = np.fft.rfft(self._detrended)
        frequency = np.fft.rfftfreq(self._detrended.size, 1.0 / self._rate)
        included = (frequency >= MOTION_BAND[0]) & (frequency <= MOTION_BAND[1])
        for mains in MAINS_FREQUENCIES:
            nearest = np.round(frequency / mains)
            included &= (nearest == 0) | (np.abs(frequency - nearest * mains) > 2.0)
        power = 2.0 * np.sum(np.abs(spectrum[included]) ** 2) / self._detrended.size
        return float(np.sqrt(power / np.sum(self._window**2)))

    def _line(self, mains: float) -> MainsLine:
        left = self._separable_energy(mains)
        is_separable = left >= MIN_SEPARABLE_ENERGY
        offsets = np.arange(-SEARCH_WIDTH, SEARCH_WIDTH + SEARCH_STEP / 2, SEARCH_STEP)
        signal = self._residual if is_separable else self._detrended
        step = max(int(self._rate / BASE_RATE), 1)
        base = _thinned(signal * np.exp(-1j * TAU * mains * self._time), step)
        time = step * np.arange(base.size) / self._rate
        phases = np.exp(-1j * TAU * np.outer(offsets, time))
        heights = np.abs(phases @ base) * 2.0 * step / np.sum(self._window)
        highest = int(np.argmax(heights))
        scale = 1.0 / left if is_separable else 1.0
        beside = heights[np.abs(offsets) > SKIRT_LINES * self._rate / self._window.size]
        sigma = scale * float(noise_floor_sigma(np.median(beside))) if beside.size else np.nan
        is_highest = abs(offsets[highest]) <= MAX_MAINS_OFFSET
        return MainsLine(mains, scale * float(heights[highest]) if is_highest else 0.0, sigma, is_separable)

    def _separable_energy(self, mains: float) -> float:
        """Return the fraction of a mains line's energy that remains after subtracting the shaft orders."""
        lines = self._window * np.stack([np.cos(TAU * mains * self._time), np.sin(TAU * mains * self._time)])
        taken = lines @ self._factor
        return 1.0 - float(np.max(np.sum(taken**2, axis=1) / np.sum(lines**2, axis=1)))


def _thinned(values: NDArray[Number], step: int) -> NDArray[Number]:
    """Return the means of ``step`` values each."""
    whole = values.size // step * step
    return np.asarray(values[:whole].reshape(-1, step).mean(axis=1), dtype=values.dtype)


def _columns_of_orders(angle: FloatArray) -> list[FloatArray]:
    """Return cosine and sine of each order, and both with a linear trend, as amplitudes change with the speed."""
    growth = np.linspace(-1.0, 1.0, angle.size)
    columns = []
    for order in ORDERS:
        cosine, sine = np.cos(order * angle), np.sin(order * angle)
        columns += [cosine, sine, growth * cosine, growth * sine]
    return columns


@dataclass(frozen=True, slots=True)
class Drift:
    """Drift of the mean of a signal over time.

    Parameters
    ----------
    slope : float
        Slope of a straight line through the block means, unit/s.
    sigma : float
        Standard deviation of the slope, from the scatter of the means about the line.
    total : float
        Drift over the record, in the unit of the signal.
    """

    slope: float
    sigma: float
    total: float

    @property
    def is_significant(self) -> bool:
        """Whether the slope exceeds 4 standard deviations."""
        return abs(self.slope) > MIN_SLOPE_SIGMAS * self.sigma


def drift(values: FloatArray, rate: float) -> Drift:
    """Return the drift of a signal at about constant speed: least squares through the means of twenty blocks.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Uniformly in time, any unit.
    rate : float
        Sample rate, Hz.

    Raises
    ------
    RecordTooShortError
        Fewer than 200 samples.

    Notes
    -----
    Batch means make the errors of the blocks nearly independent (B. Schmeiser, Operations Research 30, 1982).
    """
    if values.ndim != 1 or not np.isfinite(values).all():
        raise ValueError(f"values: shape {values.shape}, expected (n,), finite")
    n = values.size // DRIFT_BLOCKS
    if n < 10:
        raise RecordTooShortError(f"{values.size} samples, expected at least {10 * DRIFT_BLOCKS}")
    means = values[: n * DRIFT_BLOCKS].reshape(DRIFT_BLOCKS, n).mean(axis=1)
    time = (np.arange(DRIFT_BLOCKS) - 0.5 * (DRIFT_BLOCKS - 1)) * n / rate
    slope = float(time @ means / (time @ time))
    rest = means - means.mean() - slope * time
    sigma = float(np.sqrt(rest @ rest / (DRIFT_BLOCKS - 2) / (time @ time)))
    return Drift(slope, sigma, slope * values.size / rate)


def mains_hum(values: FloatArray, rate: float, record: AngularRecord | None = None) -> MainsLine:
    """Return the mains line in a signal, separated from the shaft orders where the shaft angle is known.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        A second or more, uniformly in time, any unit.
    rate : float
        Sample rate, Hz.
    record : AngularRecord or None
        Record of the same samples, for the shaft angle; the speed should not change by more than a few per cent.

    Raises
    ------
    RecordTooShortError
        Less than 0.4 s, too short to resolve 50 Hz from 60 Hz.

    Notes
    -----
    The lowest shaft orders are subtracted by least squares; the line is then the highest of a windowed spectrum near
    50 or 60 Hz (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    if values.ndim != 1 or not rate > 0.0:
        raise ValueError(f"values: shape {values.shape} at {rate} Hz, expected (n,) at a rate above 0")
    time = np.arange(values.size) / rate
    begin, end = (record.times[0], record.times[-1]) if record is not None else (-np.inf, np.inf)
    inside = (time >= begin) & (time <= end)
    seconds = float(np.count_nonzero(inside) / rate)
    if seconds < MIN_HUM_DURATION:
        raise RecordTooShortError(f"{seconds:.3f} s of samples, expected at least {MIN_HUM_DURATION} s for mains hum")
    angle = None
    if record is not None:
        turns = np.arange(record.times.size, dtype=np.float64)
        angle = 2.0 * np.pi * np.interp(time[inside], record.times, turns)
    return LowFrequencySignal(values[inside], rate, angle).mains_line()

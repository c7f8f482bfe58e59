"""What is in a probe's signal that the shaft did not do: drift of its mean, and hum of the mains.

Slow lines in a probe's signal: what goes round with the shaft, what the mains put in, whether anything moves.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.signals.uncertainty import noise_floor_sigma

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Number = TypeVar("Number", np.float64, np.complex128)

TAU = 2.0 * np.pi
SLOW_RATE = 5000.0  # Hz to which signals are thinned: the mains' and the shaft's lines lie well below
MAINS_FREQUENCIES = (50.0, 60.0)  # Hz
MAX_MAINS_OFFSET = 0.6  # Hz about a mains frequency in which its line must be the highest, a resolution of about 1 s
SEARCH_WIDTH = 5.0  # Hz about it
SEARCH_STEP = 0.1  # Hz
SKIRT_LINES = 2.5  # lines of the window's resolution about the mains' that its own skirt reaches
BASE_RATE = 100.0  # Hz, of the signal shifted down by a mains frequency: the neighbours lie well below
ORDERS = (1, 2, 3, 4)  # of the shaft that are taken out
MIN_SEPARABLE_ENERGY = 0.5  # part of a mains line's energy that the shaft's orders must leave of it
MIN_RELATIVE_POWER = 1e-10  # of the largest power: what is less is no direction of its own
MOTION_BAND = (2.0, 1000.0)  # Hz


@dataclass(frozen=True, slots=True)
class MainsLine:
    """The mains' line in a signal.

    Parameters
    ----------
    frequency : float
        50 or 60, Hz.
    amplitude : float
        Peak, in the signal's unit; 0 where no line stands out there. With the shaft's part where both lie together.
    sigma : float
        Standard deviation of the amplitude, from what lies beside the line; not in it: the shaft's part.
    is_separable : bool
        Whether it can be told from the shaft's own orders.
    """

    frequency: float
    amplitude: float
    sigma: float
    is_separable: bool


class LowFrequencySignal:
    """A stretch of a signal, thinned, with the orders of the shaft taken out where its angle is known.

    Parameters
    ----------
    values : ndarray of float64, shape (n,)
        Consecutive samples, any unit.
    rate : float
        Sample rate, Hz.
    angle : ndarray of float64, shape (n,), or None
        Angle of the shaft at the samples, rad; None where it is not known.
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
        still = [np.ones_like(self._time), self._time]
        self._turning = [] if angle is None else _order_columns(_thinned(angle, step))
        self._basis = np.stack([*still, *self._turning], axis=1)
        weighted = self._window[:, np.newaxis] * self._basis
        powers, turn = np.linalg.eigh(weighted.T @ weighted)
        turn = turn[:, powers > MIN_RELATIVE_POWER * powers[-1]] / np.sqrt(
            powers[powers > MIN_RELATIVE_POWER * powers[-1]]
        )
        self._factor = weighted @ turn  # orthonormal columns that span the orders
        solution = turn @ (self._factor.T @ (self._window * thinned))
        self._solution = solution
        self._rest = self._window * (thinned - self._basis @ solution)
        self._moving = self._rest + self._window * (self._basis[:, 2:] @ solution[2:])

    @property
    def vectors(self) -> ComplexArray:
        """Complex peak amplitudes of the shaft's orders 1 to 4, mean over the stretch; empty without an angle.

        x(t) = Re[X exp(i k theta)].
        """
        if not self._turning:
            return np.empty(0, dtype=np.complex128)
        cosine, sine = self._solution[2::4], self._solution[3::4]
        return np.asarray(cosine - 1j * sine, dtype=np.complex128)

    def mains_line(self) -> MainsLine:
        """Return the stronger of the lines at 50 and 60 Hz."""
        return max((self._line(frequency) for frequency in MAINS_FREQUENCIES), key=lambda line: line.amplitude)

    def motion_rms(self) -> float:
        """Return the rms of all that moves between 2 and 1000 Hz but for the mains' lines, in the signal's unit."""
        spectrum = np.fft.rfft(self._moving)
        frequency = np.fft.rfftfreq(self._moving.size, 1.0 / self._rate)
        kept = (frequency >= MOTION_BAND[0]) & (frequency <= MOTION_BAND[1])
        for mains in MAINS_FREQUENCIES:
            nearest = np.round(frequency / mains)
            kept &= (nearest == 0) | (np.abs(frequency - nearest * mains) > 2.0)
        power = 2.0 * np.sum(np.abs(spectrum[kept]) ** 2) / self._moving.size
        return float(np.sqrt(power / np.sum(self._window**2)))

    def _line(self, mains: float) -> MainsLine:
        left = self._left_of(mains)
        is_separable = left >= MIN_SEPARABLE_ENERGY
        offsets = np.arange(-SEARCH_WIDTH, SEARCH_WIDTH + SEARCH_STEP / 2, SEARCH_STEP)
        signal = self._rest if is_separable else self._moving
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

    def _left_of(self, mains: float) -> float:
        """Return the part of a mains line's energy that is left when the shaft's orders are taken out."""
        lines = self._window * np.stack([np.cos(TAU * mains * self._time), np.sin(TAU * mains * self._time)])
        taken = lines @ self._factor
        return 1.0 - float(np.max(np.sum(taken**2, axis=1) / np.sum(lines**2, axis=1)))


def _thinned(values: NDArray[Number], step: int) -> NDArray[Number]:
    """Return the means of so many values each."""
    whole = values.size // step * step
    return np.asarray(values[:whole].reshape(-1, step).mean(axis=1), dtype=values.dtype)


def _order_columns(angle: FloatArray) -> list[FloatArray]:
    """Return cosine and sine of each order, and both growing over the stretch: the speed, and so they, may change."""
    growth = np.linspace(-1.0, 1.0, angle.size)
    columns = []
    for order in ORDERS:
        cosine, sine = np.cos(order * angle), np.sin(order * angle)
        columns += [cosine, sine, growth * cosine, growth * sine]
    return columns


DRIFT_BLOCKS = 20  # of the record, of which the means are compared
MIN_HUM_DURATION = 0.4  # s
MIN_SLOPE_SIGMAS = 4.0  # standard deviations of the slope


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
    def is_significant(self) -> bool:
        """Whether the slope stands 4 standard deviations from none."""
        return abs(self.slope) > MIN_SLOPE_SIGMAS * self.sigma


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
    if seconds < MIN_HUM_DURATION:
        raise RecordTooShortError(
            f"{seconds:.3f} s of samples, expected at least {MIN_HUM_DURATION} s to tell the mains"
        )
    angle = None
    if record is not None:
        turns = np.arange(record.times.size, dtype=np.float64)
        angle = 2.0 * np.pi * np.interp(time[inside], record.times, turns)
    return LowFrequencySignal(values[inside], rate, angle).mains_line()

"""Order spectra of waveforms sampled uniformly in shaft angle: of one frame, and of successive frames of a record.

Conventions: zero-to-peak amplitudes; phases referred to the first sample, so that
x(theta) = Re[X exp(i k theta)] where the first sample lies at theta = 0. A frame of N whole revolutions has lines 1 / N
of an order apart. A component on a line is exact; two components must be a main lobe of the window apart.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.resampling.angular_record import AngularRecord
from analysis.signals import BoolArray, ComplexArray, FloatArray, IntArray
from analysis.signals.probes import ProbePair
from analysis.signals.uncertainty import clipping_sigma, mean_angle_sigma
from analysis.spectra.windows import HANN, Window

CHUNK_FRAMES = 128


class RevolutionFrames:
    """Overlapping frames of whole revolutions of a record.

    Parameters
    ----------
    record : AngularRecord
        Displacement against angle.
    revolutions : int
        Revolutions in a frame, at least 1.
    overlap : float
        Overlap of successive frames, 0 to below 1; the step is whole revolutions.
    window : Window
        Weighting of the frames.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions than a frame.
    """

    def __init__(self, record: AngularRecord, revolutions: int, overlap: float, window: Window) -> None:
        if revolutions < 1 or not 0.0 <= overlap < 1.0:
            raise ValueError(
                f"revolutions {revolutions}, overlap {overlap}: expected at least 1, and a part from 0 to below 1"
            )
        record.require(revolutions)
        self.revolutions = revolutions
        self._record = record
        self._noise_bandwidth = window.noise_bandwidth
        self.step = max(round(revolutions * (1.0 - overlap)), 1)
        self._starts = np.arange(0, record.revolutions - revolutions + 1, self.step)
        self._begin, self._end = record.times[self._starts], record.times[self._starts + revolutions]

    def __len__(self) -> int:
        return int(self._starts.size)

    def chunks(self) -> Iterator[tuple[slice, FloatArray]]:
        """Yield slices of the frames with their waveforms, shape (2, n, revolutions * points), m (views)."""
        points = self._record.points
        rows = self._record.waveform.reshape(2, -1)
        frames = np.lib.stride_tricks.sliding_window_view(rows, self.revolutions * points, axis=1)
        for begin in range(0, len(self), CHUNK_FRAMES):
            where = slice(begin, begin + CHUNK_FRAMES)
            yield where, frames[:, self._starts[where] * points]

    @property
    def turns(self) -> IntArray:
        """Number of each frame's first revolution, shape (n,)."""
        return np.asarray(self._record.first_turn + self._starts, dtype=np.int64)

    @property
    def times(self) -> FloatArray:
        """Time of each frame's middle, s, shape (n,)."""
        early, late = self._starts + self.revolutions // 2, self._starts + (self.revolutions + 1) // 2
        return np.asarray(0.5 * (self._record.times[early] + self._record.times[late]), dtype=np.float64)

    @property
    def speeds(self) -> FloatArray:
        """Mean speed of each frame, rad/s, shape (n,)."""
        return np.asarray(2.0 * np.pi * self.revolutions / (self._end - self._begin), dtype=np.float64)

    @property
    def middle_speeds(self) -> FloatArray:
        """Speed in the middle revolution of each frame, at steady acceleration, rad/s, shape (n,)."""
        return np.hypot(self.speeds, 0.5 * self.accelerations * (self._end - self._begin))

    @property
    def speed_sigma(self) -> FloatArray:
        """Standard deviation of the mean speeds, from that of the begin and end times, rad/s, shape (n,)."""
        sigma = self._record.time_sigma
        both = np.hypot(sigma[self._starts], sigma[self._starts + self.revolutions])
        return np.asarray(self.speeds * both / (self._end - self._begin), dtype=np.float64)

    @property
    def accelerations(self) -> FloatArray:
        """Mean rate of change of speed in each frame, rad/s², shape (n,)."""
        half, middle = np.pi * self.revolutions, self.times
        change = half / (self._end - middle) - half / (middle - self._begin)
        return np.asarray(change / (0.5 * (self._end - self._begin)), dtype=np.float64)

    @property
    def clipping_sigma(self) -> FloatArray:
        """Standard deviation of the amplitudes of all orders from clipped samples, shape (2, n), m peak."""
        fraction = self._record.clipped_fraction
        if fraction is None:
            return np.zeros((2, len(self)))
        relative = clipping_sigma(fraction, np.ones(1))
        kernel = np.full(self.revolutions, 1.0 / self.revolutions)
        mean = np.stack([np.convolve(row, kernel, mode="valid") for row in relative])[:, self._starts]
        amplitude = np.concatenate([np.sqrt(2.0) * waveforms.std(axis=2) for _, waveforms in self.chunks()], axis=1)
        return np.asarray(mean * amplitude, dtype=np.float64)

    @property
    def angle_sigma(self) -> FloatArray:
        """Standard deviation of the angle, averaged over a frame, from the tacho jitter, rad, shape (n,)."""
        return mean_angle_sigma(self.speeds, self._record.angle_jitter, self.revolutions, self._noise_bandwidth)


class Scaling(StrEnum):
    """Scaling of an amplitude."""

    PEAK = "peak"
    RMS = "rms"
    PEAK_TO_PEAK = "peak-to-peak"

    @property
    def factor(self) -> float:
        """Factor for the zero-to-peak amplitude of a single line."""
        return {Scaling.PEAK: 1.0, Scaling.RMS: 1.0 / math.sqrt(2.0), Scaling.PEAK_TO_PEAK: 2.0}[self]


@dataclass(frozen=True, slots=True, eq=False)
class OrderMap:
    """Order spectra of successive frames of whole revolutions.

    Parameters
    ----------
    orders : ndarray of float64, shape (n_orders,)
        From 0, step 1 / revolutions.
    spectrum : ndarray of complex128, shape (2, n_frames, n_orders)
        At the probes x and y, m peak, phase referred to theta = 0: x = Re[X exp(i order theta)].
    noise : ndarray of float64, shape (n_frames,)
        Median between the lines, m peak.
    speeds, accelerations : ndarray of float64, shape (n_frames,)
        Mean speed, rad/s, and its mean rate of change, rad/s².
    times : ndarray of float64, shape (n_frames,)
        Middle of each frame, s.
    turns : ndarray of int64, shape (n_frames,)
        Number of each frame's first revolution.
    revolutions, step : int
        Revolutions in a frame, and from one frame to the next.
    window : Window
        Weighting.
    speed_sigma : ndarray of float64, shape (n_frames,)
        Standard deviation of the speeds, rad/s; NaN without a tacho.
    angle_sigma : ndarray of float64, shape (n_frames,)
        Standard deviation of the angle, averaged over a frame, from the tacho jitter, rad.
    clipping_sigma : ndarray of float64, shape (2, n_frames)
        Standard deviation of the amplitudes from clipped samples, m peak; 0 without.
    pair : ProbePair
        Directions of the probes.
    """

    orders: FloatArray
    spectrum: ComplexArray
    noise: FloatArray
    speeds: FloatArray
    accelerations: FloatArray
    times: FloatArray
    turns: IntArray
    revolutions: int
    step: int
    window: Window
    speed_sigma: FloatArray
    angle_sigma: FloatArray
    clipping_sigma: FloatArray
    pair: ProbePair

    def amplitudes(self, scaling: Scaling = Scaling.PEAK) -> FloatArray:
        """Return the amplitudes, shape (2, n_frames, n_orders), m, in the given scaling."""
        return np.asarray(np.abs(self.spectrum) * scaling.factor, dtype=np.float64)


def order_map(
    record: AngularRecord,
    *,
    revolutions: int = 16,
    overlap: float = 0.75,
    highest_order: float = 8.0,
    window: Window = HANN,
) -> OrderMap:
    """Return the order spectra of a record.

    Parameters
    ----------
    record : AngularRecord
        Displacement against angle.
    revolutions : int
        Revolutions in a frame; the orders are 1 / revolutions apart.
    overlap : float
        Overlap of successive frames, 0 to below 1; the step is whole revolutions.
    highest_order : float
        Highest order of the spectra, at most ``record.highest_order``.
    window : Window
        Weighting.

    Raises
    ------
    RecordTooShortError
        The record has fewer revolutions than a frame.
    ValueError
        Settings out of range.

    Notes
    -----
    X = 2 / sum(w) sum(w x exp(-i order theta)) (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9 and 12). The
    mean of each frame is subtracted first.
    """
    if not 0.0 < highest_order <= record.highest_order:
        raise ValueError(f"highest order {highest_order}: expected above 0 to {record.highest_order}")
    frames = RevolutionFrames(record, revolutions, overlap, window)
    weights = window.weights(revolutions * record.points)
    lines = int(highest_order * revolutions + 1e-9) + 1
    spectrum = np.empty((2, len(frames), lines), dtype=np.complex128)
    for where, waveforms in frames.chunks():
        level = waveforms.mean(axis=2, keepdims=True)
        spectrum[:, where] = 2.0 * np.fft.rfft((waveforms - level) * weights)[..., :lines]
    spectrum[..., 0] *= 0.5
    return OrderMap(
        orders=np.arange(lines) / revolutions,
        spectrum=spectrum,
        noise=_floors(spectrum, window.clear_lines(lines, revolutions)),
        speeds=frames.speeds,
        accelerations=frames.accelerations,
        times=frames.times,
        turns=frames.turns,
        revolutions=revolutions,
        step=frames.step,
        window=window,
        speed_sigma=frames.speed_sigma,
        angle_sigma=frames.angle_sigma,
        clipping_sigma=frames.clipping_sigma,
        pair=record.pair,
    )


def _floors(spectrum: ComplexArray, between: BoolArray) -> FloatArray:
    """Return the median amplitude between the lines of each frame, as `whirl.components.noise_floor` does, m peak."""
    lines = np.flatnonzero(between)
    if not lines.size:
        return np.zeros(spectrum.shape[1])
    floors = [
        np.median(np.abs(spectrum[:, begin : begin + CHUNK_FRAMES, lines]), axis=(0, 2))
        for begin in range(0, spectrum.shape[1], CHUNK_FRAMES)
    ]
    return np.concatenate(floors)


def order_spectrum(waveform: FloatArray, revolutions: int, window: Window = HANN) -> tuple[FloatArray, ComplexArray]:
    """Return the order spectrum of whole revolutions.

    Parameters
    ----------
    waveform : ndarray of float64, shape (..., n)
        Samples uniformly in angle over ``revolutions`` whole revolutions, the first at theta = 0, any unit.
    revolutions : int
        Number of revolutions of the n samples; at least 1, with at least 2 samples per revolution.
    window : Window
        Weighting.

    Returns
    -------
    orders : ndarray of float64, shape (n // 2 + 1,)
        Order axis, from 0, step ``1 / revolutions``.
    spectrum : ndarray of complex128, shape (..., n // 2 + 1)
        Complex peak amplitude in the unit of the waveform, x(theta) = Re[X exp(i order theta)]; line 0 is the mean.

    Raises
    ------
    ValueError
        Too few samples for the revolutions, or samples not finite.

    Notes
    -----
    X_k = 2 / sum(w) * sum_n w_n x_n exp(-2 pi i k n / N) (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    waveform = np.asarray(waveform, dtype=np.float64)
    if waveform.ndim == 0 or revolutions < 1 or waveform.shape[-1] < 2 * revolutions:
        raise ValueError(
            f"waveform of shape {waveform.shape} over {revolutions} revolutions: expected at least 1 revolution and "
            "2 samples a revolution on the last axis"
        )
    if not np.isfinite(waveform).all():
        raise ValueError("waveform: holds values that are not finite")
    n = waveform.shape[-1]
    spectrum = 2.0 * np.fft.rfft(waveform * window.weights(n), axis=-1)
    spectrum[..., 0] *= 0.5
    if n % 2 == 0:
        spectrum[..., -1] *= 0.5  # the Nyquist line has no mirror image either
    orders = np.arange(spectrum.shape[-1]) / revolutions
    return orders, spectrum


def order_vectors(spectrum: ComplexArray, revolutions: int, count: int) -> ComplexArray:
    """Return the vectors of the whole orders 1 to ``count``.

    Parameters
    ----------
    spectrum : ndarray of complex128, shape (..., n_orders)
        From `order_spectrum`.
    revolutions : int
        Revolutions in its frame.
    count : int
        Number of whole orders.

    Returns
    -------
    ndarray of complex128, shape (count, ...)
        ``vectors[k - 1]`` is the kX vector, peak; 0 where the spectrum ends below k.

    Notes
    -----
    A frame of whole revolutions has lines at all whole orders (A. Brandt, Noise and Vibration Analysis, 2011, ch. 12).
    """
    lines = revolutions * np.arange(1, count + 1)
    vectors = np.zeros((count, *spectrum.shape[:-1]), dtype=np.complex128)
    inside = lines < spectrum.shape[-1]
    vectors[inside] = np.moveaxis(spectrum[..., lines[inside]], -1, 0)
    return vectors

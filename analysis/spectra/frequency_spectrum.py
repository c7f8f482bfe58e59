"""Amplitude spectra against frequency: averaged (Welch's method), or frame by frame as waterfall and cascade."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analysis.signals import FloatArray
from analysis.signals.errors import BandLimitError, RecordTooShortError
from analysis.signals.probes import require_displacement
from analysis.signals.uncertainty import independent_frames, noise_floor_sigma
from analysis.spectra.windows import HANN, Window
from analysis.tacho.shaft_angle import ShaftAngle


@dataclass(frozen=True, slots=True, eq=False)
class FrequencySpectrum:
    """An averaged amplitude spectrum.

    Parameters
    ----------
    frequencies : ndarray of float64, shape (n_lines,)
        From 0, Hz.
    amplitudes : ndarray of float64, shape (..., n_lines)
        Root mean square over the frames, peak amplitude of a single line, in the unit of the waveform.
    noise_bandwidth : float
        Equivalent noise bandwidth of a line, Hz.
    frames : int
        Number of averaged frames.
    relative_sigma : float
        Standard deviation over value of a noise line: 1 / (2 sqrt(independent frames)), for many frames.
    """

    frequencies: FloatArray
    amplitudes: FloatArray
    noise_bandwidth: float
    frames: int
    relative_sigma: float

    @property
    def density(self) -> FloatArray:
        """Power spectral density, unit²/Hz, shape (..., n_lines)."""
        return np.asarray(0.5 * self.amplitudes**2 / self.noise_bandwidth, dtype=np.float64)


def frequency_spectrum(
    waveform: FloatArray, rate: float, *, resolution: float = 1.0, overlap: float = 0.5, window: Window = HANN
) -> FrequencySpectrum:
    """Return the averaged amplitude spectrum of a waveform.

    Parameters
    ----------
    waveform : ndarray of float64, shape (..., n)
        Uniformly in time, any unit; the mean of each frame is subtracted.
    rate : float
        Sample rate, Hz.
    resolution : float
        Approximate distance of the lines, Hz; a frame is 1 / resolution long.
    overlap : float
        Overlap of successive frames, 0 to below 1.
    window : Window
        Weighting.

    Raises
    ------
    RecordTooShortError
        The waveform is shorter than a frame.

    Notes
    -----
    P. Welch, IEEE Trans. Audio Electroacoust. 15, 1967; scaling as A. Brandt, Noise and Vibration
    Analysis, 2011, ch. 9.
    """
    waveform = np.asarray(waveform, dtype=np.float64)
    frames = FrequencyFrames(waveform, rate, resolution, overlap, window)
    power = np.zeros((*waveform.shape[:-1], frames.frequencies.size))
    for lines in frames:
        power += lines**2
    return FrequencySpectrum(
        frequencies=frames.frequencies,
        amplitudes=np.sqrt(power / len(frames)),
        noise_bandwidth=frames.noise_bandwidth,
        frames=len(frames),
        relative_sigma=0.5 / float(np.sqrt(frames.independent)),
    )


class FrequencyFrames:
    """Successive frames of a waveform; iteration gives the amplitudes of each frame's lines.

    Amplitudes are those of single lines, peak, in the unit of the waveform, shape (..., n_lines). The mean of each
    frame is subtracted.

    Parameters
    ----------
    waveform, rate, resolution, overlap, window
        As for `frequency_spectrum`.

    Raises
    ------
    RecordTooShortError
        The waveform is shorter than a frame.
    BandLimitError
        A resolution above a quarter of the rate.
    ValueError
        Settings out of range, or samples not finite.
    """

    def __init__(self, waveform: FloatArray, rate: float, resolution: float, overlap: float, window: Window) -> None:
        if waveform.ndim == 0 or not 0.0 <= overlap < 1.0 or not resolution > 0.0 or not 0.0 < rate < math.inf:
            raise ValueError(
                f"waveform {waveform.shape}, overlap {overlap}, resolution {resolution} Hz, rate {rate} Hz: expected "
                "samples, 0 to below 1, above 0, above 0"
            )
        if resolution > 0.25 * rate:
            raise BandLimitError(
                f"resolution: {resolution} Hz, expected at most {0.25 * rate} Hz, a quarter of the rate"
            )
        if not np.isfinite(waveform).all():
            raise ValueError("waveform: holds values that are not finite")
        n = round(rate / resolution)
        if waveform.shape[-1] < n:
            raise RecordTooShortError(
                f"{waveform.shape[-1]} samples, expected at least {n} for a resolution of {resolution} Hz"
            )
        self._waveform, self._size, self._weights = waveform, n, window.weights(n)
        self._starts = range(0, waveform.shape[-1] - n + 1, max(round(n * (1.0 - overlap)), 1))
        self.frequencies = np.arange(n // 2 + 1) * rate / n
        self.begins = np.array(self._starts) / rate
        self.duration = n / rate
        self.noise_bandwidth = window.noise_bandwidth * rate / n

    def __len__(self) -> int:
        return len(self._starts)

    def __iter__(self) -> Iterator[FloatArray]:
        for start in self._starts:
            frame = self._waveform[..., start : start + self._size]
            lines = np.fft.rfft((frame - frame.mean(axis=-1, keepdims=True)) * self._weights)
            amplitudes = 2.0 * np.abs(lines)
            amplitudes[..., 0] *= 0.5
            if self._size % 2 == 0:
                amplitudes[..., -1] *= 0.5
            yield np.asarray(amplitudes, dtype=np.float64)

    @property
    def independent(self) -> float:
        """Number of independent frames with the same variance of the mean power."""
        return independent_frames(self._weights, self._starts.step, len(self), of_power=True)


@dataclass(frozen=True, slots=True, eq=False)
class FrequencyMap:
    """Frequency spectra of successive frames.

    Parameters
    ----------
    frequencies : ndarray of float64, shape (n_lines,)
        From 0, Hz.
    amplitudes : ndarray of float64, shape (2, n_frames, n_lines)
        At the probes x and y, peak of a single line, m.
    sigma : ndarray of float64, shape (n_frames,)
        Standard deviation of the amplitudes, m peak, from the median over the lines of each frame.
    times : ndarray of float64, shape (n_frames,)
        Middle of each frame, s.
    speeds : ndarray of float64, shape (n_frames,)
        Mean speed of each frame, rad/s; NaN outside the range of the angle or without an angle.
    noise_bandwidth : float
        Equivalent noise bandwidth of a line, Hz.
    """

    frequencies: FloatArray
    amplitudes: FloatArray
    sigma: FloatArray
    times: FloatArray
    speeds: FloatArray
    noise_bandwidth: float

    def cascade(self, width: float) -> tuple[FloatArray, FloatArray]:
        """Return the largest amplitudes in each bin of speed.

        Parameters
        ----------
        width : float
            Width of a bin, rad/s.

        Returns
        -------
        speeds : ndarray of float64, shape (n_rows,)
            Middle of each bin that contains frames, rad/s, rising.
        amplitudes : ndarray of float64, shape (2, n_rows, n_lines)
            m peak.
        """
        if not width > 0.0:
            raise ValueError(f"width: {width} rad/s, expected more than 0")
        number = np.round(self.speeds / width)  # NaN where unknown
        bins = np.unique(number[np.isfinite(number)])
        rows = np.empty((2, bins.size, self.frequencies.size))
        for row, one in enumerate(bins):
            rows[:, row] = self.amplitudes[:, number == one].max(axis=1)
        return np.asarray(bins * width, dtype=np.float64), rows


def frequency_map(
    displacement: FloatArray,
    rate: float,
    angle: ShaftAngle | None = None,
    *,
    resolution: float = 2.0,
    overlap: float = 0.5,
    highest: float | None = None,
    window: Window = HANN,
) -> FrequencyMap:
    """Return the frequency spectra of a record.

    An order whose frequency changes within a frame is smeared over several lines and reads too low. Use
    `analysis.spectra.order_map` for amplitudes of orders, and this for components independent of the shaft speed.

    Parameters
    ----------
    displacement : ndarray of float64, shape (2, n)
        Towards the probes x and y, uniformly in time, m; the mean of each frame is subtracted.
    rate : float
        Sample rate, Hz.
    angle : ShaftAngle or None
        For the speed of each frame.
    resolution : float
        Approximate distance of the lines, Hz; a frame is 1 / resolution long.
    overlap : float
        Overlap of successive frames, 0 to below 1.
    highest : float or None
        Highest frequency returned, Hz; None returns all.
    window : Window
        Weighting.

    Raises
    ------
    RecordTooShortError
        The record is shorter than a frame.

    Notes
    -----
    Scaling as `analysis.spectra.frequency_spectrum` (A. Brandt, Noise and Vibration Analysis, 2011, ch. 9).
    """
    require_displacement(displacement, rate)
    if not (highest is None or highest > 0.0):
        raise ValueError(f"highest: {highest} Hz, expected above 0")
    frames = FrequencyFrames(displacement, rate, resolution, overlap, window)
    count = int(np.searchsorted(frames.frequencies, np.inf if highest is None else highest, side="right"))
    amplitudes = np.empty((2, len(frames), count))
    for frame, lines in enumerate(frames):
        amplitudes[:, frame] = lines[:, :count]
    return FrequencyMap(
        frequencies=frames.frequencies[:count],
        amplitudes=amplitudes,
        sigma=noise_floor_sigma(np.median(amplitudes, axis=(0, 2))),
        times=frames.begins + 0.5 * frames.duration,
        speeds=_speeds(angle, frames.begins, frames.begins + frames.duration),
        noise_bandwidth=frames.noise_bandwidth,
    )


def _speeds(angle: ShaftAngle | None, begin: FloatArray, end: FloatArray) -> FloatArray:
    if angle is None:
        return np.full(begin.size, np.nan)
    return np.asarray(2.0 * np.pi * (angle.turns(end) - angle.turns(begin)) / (end - begin), dtype=np.float64)

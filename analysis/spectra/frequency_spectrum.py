"""Averaged amplitude spectra against frequency (Welch's method)."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.errors import BandLimitError, RecordTooShortError
from analysis.signals.uncertainty import independent_frames
from analysis.spectra.windows import HANN, Window

FloatArray = NDArray[np.float64]


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

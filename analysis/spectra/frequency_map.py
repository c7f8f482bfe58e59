"""Frequency spectra of successive frames: a waterfall against time, a cascade against speed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.signals.probes import require_displacement
from analysis.signals.uncertainty import noise_floor_sigma
from analysis.spectra.frequency_spectrum import FrequencyFrames
from analysis.spectra.windows import HANN, Window
from analysis.tacho.shaft_angle import ShaftAngle

FloatArray = NDArray[np.float64]


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

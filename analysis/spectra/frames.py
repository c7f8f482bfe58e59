"""Successive frames of whole revolutions, and what is common to all that is computed from them."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.resampling.angular_record import AngularRecord
from analysis.signals.errors import RecordTooShortError
from analysis.signals.uncertainty import independent_frames, mean_angle_sigma
from analysis.spectra.order_spectrum import hann

FloatArray = NDArray[np.float64]

CHUNK_FRAMES = 128
HANN_POINTS = 8  # a revolution: tell how alike the noise of two frames is


def independent_hann_frames(revolutions: int, step: int, count: int) -> float:
    """Return as how many independent ones so many Hann frames count, a step of whole revolutions apart.

    Notes
    -----
    P. Welch, IEEE Trans. Audio Electroacoust. 15, 1967.
    """
    return independent_frames(hann(HANN_POINTS * revolutions), HANN_POINTS * step, count)


class Frames:
    """Frames of a record, each sharing a part of its revolutions with the next.

    Parameters
    ----------
    record : AngularRecord
        Displacement against angle.
    revolutions : int
        In a frame, at least 1.
    overlap : float
        Part of a frame that the next one shares, 0 to below 1; the step is whole revolutions.

    Raises
    ------
    RecordTooShortError
        Where the record holds fewer revolutions than a frame.
    """

    def __init__(self, record: AngularRecord, revolutions: int, overlap: float) -> None:
        if revolutions < 1 or not 0.0 <= overlap < 1.0:
            raise ValueError(
                f"revolutions {revolutions}, overlap {overlap}: expected at least 1, and a part from 0 to below 1"
            )
        if record.revolutions < revolutions:
            raise RecordTooShortError(
                f"{record.revolutions} revolutions in the record, expected at least {revolutions}"
            )
        self.revolutions = revolutions
        self._record = record
        self.step = max(round(revolutions * (1.0 - overlap)), 1)
        self._starts = np.arange(0, record.revolutions - revolutions + 1, self.step)
        self._begin, self._end = record.times[self._starts], record.times[self._starts + revolutions]

    def __len__(self) -> int:
        return int(self._starts.size)

    def chunks(self) -> Iterator[tuple[slice, FloatArray]]:
        """Yield places among the frames and their waveforms, shape (2, n, revolutions * points), m (views)."""
        points = self._record.points
        rows = self._record.waveform.reshape(2, -1)
        frames = np.lib.stride_tricks.sliding_window_view(rows, self.revolutions * points, axis=1)
        for begin in range(0, len(self), CHUNK_FRAMES):
            where = slice(begin, begin + CHUNK_FRAMES)
            yield where, frames[:, self._starts[where] * points]

    @property
    def turns(self) -> NDArray[np.int64]:
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
    def speed_sigma(self) -> FloatArray:
        """Standard deviation of the mean speeds, from that of their two marks, rad/s, shape (n,)."""
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
    def angle_sigma(self) -> FloatArray:
        """Standard deviation of the angle as the mean of a frame feels it, from the tacho's jitter, rad, shape (n,)."""
        return mean_angle_sigma(self.speeds, self._record.angle_jitter, self.revolutions)

"""Decimation pyramid: samples at the rate over 1, 2, 4, …, for angular resampling without aliasing at any speed."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal.windows import kaiser

FloatArray = NDArray[np.float64]

HALF_BAND_REACH = 27  # samples on each side of the half-band filter, odd
_BETA = 8.6  # of its Kaiser window: stop band 86 dB from 0.3 of the input rate


def _half_band() -> FloatArray:
    """Return the half-band filter taps at odd distances (the tap at 0 is 1/2, those at even distances are 0)."""
    distance = np.arange(-HALF_BAND_REACH, HALF_BAND_REACH + 1, 2)
    taps = np.sin(0.5 * np.pi * distance) / (np.pi * distance) * kaiser(2 * HALF_BAND_REACH + 1, _BETA)[::2]
    return np.asarray(0.5 * taps / taps.sum(), dtype=np.float64)  # gain 1 at 0 Hz


_TAPS = _half_band()


class DecimationPyramid:
    """The last samples at the sample rate over 1, 2, 4, …, updated with every push.

    Sample m of level k lies at sample m * 2**k of the original: the filters are symmetric and without delay, but the
    newest samples of a level become available later than those of the level below.

    Parameters
    ----------
    n_channels : int
        Number of channels.
    levels : int
        Number of levels, including the original.
    capacity : int
        Number of samples stored in each level.
    first : int
        Index of the first sample that will be pushed.
    late : int
        Additional samples of the original to store; each level stores those of the same time.

    Notes
    -----
    F. Mintzer, On half-band, third-band, and Nth-band FIR filters and their design, IEEE Trans. Acoust. Speech Signal
    Process. 30, 1982; Kaiser's window.
    """

    def __init__(self, n_channels: int, levels: int, capacity: int, first: int, late: int = 0) -> None:
        self._capacity = [max(capacity, 4 * HALF_BAND_REACH) + (late >> level) for level in range(levels)]
        self._samples = [np.empty((n_channels, 0)) for _ in range(levels)]
        self._first = [first]
        self._next = [first]  # index, in its level, of the next sample to compute; for level 0 its end
        for _ in range(levels - 1):
            start = -((-self._first[-1] - HALF_BAND_REACH) // 2)
            self._first.append(start)
            self._next.append(start)

    @property
    def levels(self) -> int:
        """Number of levels."""
        return len(self._samples)

    def push(self, samples: FloatArray) -> None:
        """Add consecutive samples, shape (n_channels, n); the first ones are stored without a copy."""
        self._append(0, samples)
        for level in range(1, self.levels):
            first, end = self._next[level], (self._next[level - 1] - 1 - HALF_BAND_REACH) // 2 + 1
            if end <= first:
                break
            below, origin = self._samples[level - 1], self._first[level - 1]
            even = below[:, 2 * first - origin : 2 * end - 1 - origin : 2]
            odd = below[:, 2 * first - HALF_BAND_REACH - origin : 2 * end - 1 + HALF_BAND_REACH - origin : 2]
            filtered = 0.5 * even
            for row, of_channel in enumerate(odd):
                filtered[row] += np.correlate(of_channel, _TAPS, mode="valid")  # the taps are symmetric
            self._append(level, filtered)
        self._trim()

    def _append(self, level: int, samples: FloatArray) -> None:
        before = self._samples[level]
        self._samples[level] = np.concatenate([before, samples], axis=1) if before.shape[1] else samples
        self._next[level] += samples.shape[1]

    def _trim(self) -> None:
        for level, samples in enumerate(self._samples):
            surplus = samples.shape[1] - self._capacity[level]
            if surplus > 0:
                self._samples[level] = samples[:, surplus:].copy()
                self._first[level] += surplus

    def level(self, level: int) -> tuple[FloatArray, int]:
        """Return the samples of a level, shape (n_channels, n), and the index of the first one in that level."""
        return self._samples[level], self._first[level]

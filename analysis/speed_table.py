"""Amplitude and phase against speed: a table of bounded size however long the run."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.snapshot import OrderFrame, Snapshot

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BIN_WIDTH = 2.0 * np.pi * 200.0 / 60.0  # rad/s


@dataclass(frozen=True, slots=True, eq=False)
class SpeedRow:
    """What the frames in one bin of speed said.

    Parameters
    ----------
    speed : float
        Mean speed of the frames in the bin, rad/s.
    frames : int
        Number of frames.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: complex mean of the kX vectors at x and y, m peak, x(t) = Re[X exp(i k theta)].
    scatter : ndarray of float64, shape (2, 2)
        Standard deviation of those vectors about their mean (modulus of the complex deviation), m peak.
    peak_to_peak : ndarray of float64, shape (2,)
        Mean overall peak-to-peak at x and y, m.
    largest_peak_to_peak : ndarray of float64, shape (2,)
        Largest overall peak-to-peak at x and y, m.
    noise : float
        Mean noise floor of the order spectra, m peak.
    whirl_amplitude : float
        Largest sub-synchronous amplitude, m peak; 0 where there was none.
    whirl_order : float
        Its order; NaN where there was none.
    """

    speed: float
    frames: int
    vectors: ComplexArray
    scatter: FloatArray
    peak_to_peak: FloatArray
    largest_peak_to_peak: FloatArray
    noise: float
    whirl_amplitude: float
    whirl_order: float


@dataclass(slots=True, eq=False)
class _Bin:
    """Sums over one bin of speed."""

    frames: int
    speed: float
    vectors: ComplexArray
    squares: FloatArray
    noise: float
    whirl_amplitude: float
    whirl_order: float
    overalls: int
    overall: FloatArray
    largest: FloatArray


def _empty() -> _Bin:
    return _Bin(
        frames=0,
        speed=0.0,
        vectors=np.zeros((2, 2), dtype=np.complex128),
        squares=np.zeros((2, 2)),
        noise=0.0,
        whirl_amplitude=0.0,
        whirl_order=np.nan,
        overalls=0,
        overall=np.zeros(2),
        largest=np.zeros(2),
    )


class SpeedTable:
    """Gathers snapshots in bins of speed, running sums only.

    A frame counts at its own mean speed, the overall vibration, which is younger, at the speed of its snapshot.

    Parameters
    ----------
    width : float
        Width of a bin, rad/s; each has a multiple of it in its middle, so that a held round speed fills one bin.
    """

    def __init__(self, width: float = BIN_WIDTH) -> None:
        if not width > 0.0:
            raise ValueError(f"width: {width} rad/s, expected more than 0")
        self._width = width
        self._bins: defaultdict[int, _Bin] = defaultdict(_empty)

    def snapshot(self, snapshot: Snapshot) -> None:
        """Take a snapshot."""
        if np.isfinite(snapshot.speed):
            entry = self._bins[round(snapshot.speed / self._width)]
            entry.overalls += 1
            entry.overall += snapshot.peak_to_peak
            entry.largest = np.maximum(entry.largest, snapshot.peak_to_peak)
        if snapshot.frame is not None:
            self._frame(snapshot.frame)

    def _frame(self, frame: OrderFrame) -> None:
        entry = self._bins[round(frame.speed / self._width)]
        entry.frames += 1
        entry.speed += frame.speed
        entry.vectors += frame.vectors
        entry.squares += np.abs(frame.vectors) ** 2
        entry.noise += frame.noise
        if frame.whirl is not None and frame.whirl.amplitude > entry.whirl_amplitude:
            entry.whirl_amplitude, entry.whirl_order = frame.whirl.amplitude, frame.whirl.order

    def rows(self) -> tuple[SpeedRow, ...]:
        """Return the bins that hold frames, in rising order of speed."""
        bins = [entry for _, entry in sorted(self._bins.items())]
        return tuple(_row(entry) for entry in bins if entry.frames and entry.overalls)


def _row(entry: _Bin) -> SpeedRow:
    vectors = entry.vectors / entry.frames
    return SpeedRow(
        speed=entry.speed / entry.frames,
        frames=entry.frames,
        vectors=vectors,
        scatter=np.sqrt(np.maximum(entry.squares / entry.frames - np.abs(vectors) ** 2, 0.0)),
        peak_to_peak=entry.overall / entry.overalls,
        largest_peak_to_peak=entry.largest.copy(),
        noise=entry.noise / entry.frames,
        whirl_amplitude=entry.whirl_amplitude,
        whirl_order=entry.whirl_order,
    )

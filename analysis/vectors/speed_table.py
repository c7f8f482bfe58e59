"""Amplitude and phase against speed in bins, updated during a run, with bounded memory."""

from collections import defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.signals.ramp import RampDirection, RampStep, RampTracker
from analysis.signals.snapshot import OrderFrame, Snapshot
from analysis.signals.units import RPM

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BIN_WIDTH = 200.0 * RPM  # rad/s


@dataclass(frozen=True, slots=True, eq=False)
class SpeedRow:
    """Mean results of the frames in one bin of speed.

    Parameters
    ----------
    direction : RampDirection
        Whether the shaft was running up or down.
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
        Largest sub-synchronous amplitude, m peak; 0 without one.
    whirl_order : float
        Its order; NaN without one.
    compensated : ndarray of complex128, shape (2, 2)
        Complex mean of the kX vectors minus run-out, over the frames of known run-out; NaN without such frames.
    """

    direction: RampDirection
    speed: float
    frames: int
    vectors: ComplexArray
    scatter: FloatArray
    peak_to_peak: FloatArray
    largest_peak_to_peak: FloatArray
    noise: float
    whirl_amplitude: float
    whirl_order: float
    compensated: ComplexArray

    @property
    def motion(self) -> ComplexArray:
        """Vectors of the shaft motion: compensated where the run-out is known, else as measured."""
        return np.where(np.isnan(self.compensated), self.vectors, self.compensated)


@dataclass(slots=True, eq=False)
class _Bin:
    """Sums over one bin of speed."""

    frames: int = 0
    speed: float = 0.0
    vectors: ComplexArray = field(default_factory=lambda: np.zeros((2, 2), dtype=np.complex128))
    squares: FloatArray = field(default_factory=lambda: np.zeros((2, 2)))
    compensated: ComplexArray = field(default_factory=lambda: np.zeros((2, 2), dtype=np.complex128))
    compensated_frames: int = 0
    noise: float = 0.0
    whirl_amplitude: float = 0.0
    whirl_order: float = np.nan
    overalls: int = 0
    overall: FloatArray = field(default_factory=lambda: np.zeros(2))
    largest: FloatArray = field(default_factory=lambda: np.zeros(2))

    def add_frame(self, frame: OrderFrame) -> None:
        self.frames += 1
        self.speed += frame.speed
        self.vectors += frame.vectors
        self.squares += np.abs(frame.vectors) ** 2
        self.noise += frame.noise
        if frame.compensated is not None:
            self.compensated += frame.compensated
            self.compensated_frames += 1
        if frame.whirl is not None:
            self._whirl(frame.whirl.amplitude, frame.whirl.order)

    def add_peak_to_peak(self, overall: FloatArray) -> None:
        self.overalls += 1
        self.overall += overall
        self.largest = np.maximum(self.largest, overall)

    def add(self, other: "_Bin") -> None:
        self.frames += other.frames
        self.speed += other.speed
        self.vectors += other.vectors
        self.squares += other.squares
        self.compensated += other.compensated
        self.compensated_frames += other.compensated_frames
        self.noise += other.noise
        self._whirl(other.whirl_amplitude, other.whirl_order)
        self.overalls += other.overalls
        self.overall += other.overall
        self.largest = np.maximum(self.largest, other.largest)

    def _whirl(self, amplitude: float, order: float) -> None:
        if amplitude > self.whirl_amplitude:
            self.whirl_amplitude, self.whirl_order = amplitude, order

    def row(self, direction: RampDirection) -> SpeedRow:
        vectors = self.vectors / self.frames
        known = self.compensated_frames > 0
        return SpeedRow(
            direction=direction,
            speed=self.speed / self.frames,
            frames=self.frames,
            vectors=vectors,
            scatter=np.sqrt(np.maximum(self.squares / self.frames - np.abs(vectors) ** 2, 0.0)),
            peak_to_peak=self.overall / self.overalls,
            largest_peak_to_peak=self.largest.copy(),
            noise=self.noise / self.frames,
            whirl_amplitude=self.whirl_amplitude,
            whirl_order=self.whirl_order,
            compensated=self.compensated / self.compensated_frames if known else np.full((2, 2), np.nan + 0j),
        )


_Bins = defaultdict[int, _Bin]


class SpeedTable:
    """Running sums of snapshots in bins of speed, run-up and run-down separately.

    A frame is added at its own mean speed, the overall vibration, which is more recent, at the speed of its snapshot. A
    reversal is detected a little late; the results since the furthest speed are then added to the new direction.

    Parameters
    ----------
    width : float
        Width of a bin, rad/s. The middle of each bin is a multiple of it, so that a constant round speed fills one bin.
    """

    def __init__(self, width: float = BIN_WIDTH) -> None:
        if not width > 0.0:
            raise ValueError(f"width: {width} rad/s, expected more than 0")
        self._width = width
        self._ramp = RampTracker()
        self._settled: dict[RampDirection, _Bins] = {direction: defaultdict(_Bin) for direction in RampDirection}
        self._since: _Bins = defaultdict(_Bin)  # since the furthest speed

    @property
    def direction(self) -> RampDirection:
        """Present ramp direction."""
        return self._ramp.direction

    def add_snapshot(self, snapshot: Snapshot) -> None:
        """Add a snapshot."""
        if np.isfinite(snapshot.speed):
            if self._ramp.update(snapshot.speed) is not RampStep.WITHIN:
                self._settle()
            self._since[round(snapshot.speed / self._width)].add_peak_to_peak(snapshot.peak_to_peak)
        if snapshot.frame is not None:
            self._since[round(snapshot.frame.speed / self._width)].add_frame(snapshot.frame)

    def _settle(self) -> None:
        bins = self._settled[self._ramp.direction]
        for number, entry in self._since.items():
            bins[number].add(entry)
        self._since.clear()

    def rows(self) -> tuple[SpeedRow, ...]:
        """Return the bins that contain frames, in rising order of speed, run-up before run-down."""
        rows = []
        for place, (direction, bins) in enumerate(self._settled.items()):
            since = self._since if direction is self._ramp.direction else {}
            for number in {*bins, *since}:
                entry = _Bin()
                for part in (bins, since):
                    if number in part:
                        entry.add(part[number])
                if entry.frames and entry.overalls:
                    rows.append((number, place, entry.row(direction)))
        return tuple(row for _, _, row in sorted(rows, key=lambda each: each[:2]))

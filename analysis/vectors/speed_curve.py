"""Amplitude and phase of orders against speed, for run-up and run-down: Bode and polar data, and live speed bins."""

import math
from collections import defaultdict
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import numpy as np

from analysis.signals import BoolArray, ComplexArray, FloatArray, IntArray
from analysis.signals.blocks import RampDirection, RampStep, RampTracker
from analysis.signals.snapshot import OVERALL, OrderFrame, Snapshot
from analysis.signals.units import NUMBER, PEAK, RPM, SPEED
from analysis.spectra.windows import HANN

if TYPE_CHECKING:  # imports scipy, for which listing runs need not wait
    from analysis.vectors.order_track import OrderTrack

MIN_REVERSAL_OF_SPAN = 0.02  # of the speed range: a smaller change does not reverse the ramp direction
MIN_REVERSAL_OF_SPEED = 0.005  # of the speed: likewise
MAX_CONSTANT_SPREAD = 0.25  # bins, of the speeds of frames whose vectors are averaged
MIN_FITTED_FRAMES, FITTED_WIDTH = 5, 0.75  # frames, and bins on either side, of a local polynomial
ENOUGH_FRAMES = 8  # in the bin itself
MAX_FITTED_COLUMNS = 4  # coefficients of it
MIN_RESONANCE_POINTS = 2  # bins above half the power of a resolved peak
MIN_PEAK_RATIO = 1.1  # of a peak to the higher of the minima on its two sides
BIN_WIDTH = 200.0 * RPM  # rad/s


@dataclass(frozen=True, slots=True)
class Resonance:
    """A peak of the amplitude over speed.

    Parameters
    ----------
    speed : float
        Speed of the largest amplitude, rad/s.
    amplitude : float
        Largest amplitude, m peak.
    amplification_factor : float
        Speed over the width at half power, N / (N2 - N1) (API 684); NaN where the half-power points lie outside the
        curve, or the bins of speed are too wide to resolve the peak.
    phase_change : float
        Change of lag between the half-power points, rad, about pi/2 for a resonance; NaN likewise.
    speed_sigma, amplitude_sigma, amplification_factor_sigma : float
        Standard deviations, rad/s, m peak and 1.
    """

    speed: float
    amplitude: float
    amplification_factor: float = math.nan
    phase_change: float = math.nan
    speed_sigma: float = math.nan
    amplitude_sigma: float = math.nan
    amplification_factor_sigma: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class SpeedCurve:
    """Vectors of an order against speed in one ramp direction.

    Parameters
    ----------
    order : float
        Frequency over shaft frequency.
    direction : RampDirection
        Run-up or run-down.
    speeds : ndarray of float64, shape (n,)
        Mean speed of the frames in each bin, rad/s, rising.
    vectors : ndarray of complex128, shape (2, n)
        Vectors at the probes x and y, m peak, from the frames within a bin's width; the lag is -arg.
    sigma : ndarray of float64, shape (2, n)
        Standard deviation of the amplitudes of the means, m peak: from the noise or from the scatter of the frames,
        whichever is larger.
    phase_sigma : ndarray of float64, shape (2, n)
        Standard deviation of the phases of the means, rad.
    frames : ndarray of int64, shape (n,)
        Number of frames in each bin.
    """

    order: float
    direction: RampDirection
    speeds: FloatArray
    vectors: ComplexArray
    sigma: FloatArray
    phase_sigma: FloatArray
    frames: IntArray

    @property
    def amplitudes(self) -> FloatArray:
        """Amplitudes at the probes x and y, shape (2, n), m peak."""
        return np.abs(self.vectors)

    @property
    def lags(self) -> FloatArray:
        """Phase lags, continuous over speed, shape (2, n), rad."""
        return np.asarray(np.unwrap(-np.angle(self.vectors), axis=1), dtype=np.float64)

    def resonances(self, probe: int) -> tuple[Resonance, ...]:
        """Return the peaks of a probe's amplitude at least 10 % above the minima beside them, in order of speed."""
        amplitude = self.amplitudes[probe]
        found = []
        for at in range(1, amplitude.size - 1):
            if not amplitude[at - 1] <= amplitude[at] > amplitude[at + 1]:
                continue
            left, right = _saddle(amplitude[at::-1]), _saddle(amplitude[at:])
            if amplitude[at] >= MIN_PEAK_RATIO * max(left, right):
                found.append(_resonance(self, probe, at))
        return tuple(found)


def speed_curves(track: "OrderTrack", width: float) -> tuple[SpeedCurve, ...]:
    """Return the vectors of an order against speed, one curve for each ramp direction.

    Parameters
    ----------
    track : OrderTrack
        From `track_order`.
    width : float
        Width of a bin of speed, rad/s.

    Notes
    -----
    The direction reverses where the speed goes back by 2 % of its range and 0.5 % of its value. On a fast run-up the
    peak is shifted against the steady-state curve, with beating after a resonance: compare run-up and run-down before
    concluding on a split resonance. Bode and polar plots: D. Bently and C. Hatch, Fundamentals of Rotating Machinery
    Diagnostics, 2002, ch. 7.
    """
    if not width > 0.0:
        raise ValueError(f"width: {width} rad/s, expected more than 0")
    going_up = _directions(track.speeds)
    curves = []
    for direction, chosen in ((RampDirection.RUN_UP, going_up), (RampDirection.RUN_DOWN, ~going_up)):
        if chosen.any():
            curves.append(_curve(track, chosen, direction, width))
    return tuple(curves)


def _curve(track: "OrderTrack", chosen: BoolArray, direction: RampDirection, width: float) -> SpeedCurve:
    number = np.round(track.speeds / width).astype(np.int64)
    bins = np.unique(number[chosen])
    speeds = np.empty(bins.size)
    vectors = np.empty((2, bins.size), dtype=np.complex128)
    sigma, phase = np.empty((2, bins.size)), np.empty((2, bins.size))
    frames = np.empty(bins.size, dtype=np.int64)
    candidates = np.flatnonzero(chosen)
    for column, one in enumerate(bins):
        here = np.flatnonzero(chosen & (number == one))
        speeds[column], used, basis = _local_basis(track.speeds, candidates, here, width)
        frames[column] = here.size
        inverse = np.linalg.pinv(basis)
        of_bin = track.vectors[:, used]
        fitted = of_bin @ inverse.T
        mean, rest = fitted[:, 0], of_bin - fitted @ basis.T
        scatter = np.sqrt(0.5 * np.sum(np.abs(rest) ** 2, axis=1) / max(used.size - basis.shape[1], 1))
        noise = np.sqrt(np.mean(track.sigma[:, used] ** 2, axis=1))
        shared = used.size / HANN.independent_frames(track.revolutions, track.step, used.size)
        part = float(np.sqrt(inverse[0] @ inverse[0] * shared))
        vectors[:, column], sigma[:, column] = mean, np.maximum(scatter, noise) * part
        angle = np.sqrt(np.mean(track.phase_sigma[:, used] ** 2, axis=1)) * part
        phase[:, column] = np.maximum(angle, sigma[:, column] / np.maximum(np.abs(mean), 1e-300))
    return SpeedCurve(track.order, direction, speeds, vectors, sigma, np.minimum(phase, np.pi / np.sqrt(3.0)), frames)


def _local_basis(
    speeds: FloatArray, candidates: IntArray, here: IntArray, width: float
) -> tuple[float, IntArray, FloatArray]:
    """Return the speed of a bin, the frames from which its vector is fitted, and the columns of the fit, value first.

    The mean where the speed is about constant; else a parabola or cubic through the frames of the bin and as many
    beside it as are needed, as the mean over a bin that a resonance crosses reads too low (W. Cleveland, J. Am. Stat.
    Assoc. 74, 1979); on a ramp so fast that there are few of these, the middle frame alone.
    """
    middle = float(speeds[here].mean())
    if float(np.ptp(speeds[here])) < MAX_CONSTANT_SPREAD * width:
        return middle, here, np.ones((here.size, 1))
    near = here
    if here.size < ENOUGH_FRAMES:
        near = candidates[np.abs(speeds[candidates] - middle) <= FITTED_WIDTH * width]
    if near.size >= MIN_FITTED_FRAMES:
        columns = min(near.size - 2, MAX_FITTED_COLUMNS)
        return middle, near, np.vander((speeds[near] - middle) / width, columns, increasing=True)
    nearest = here[[int(np.argmin(np.abs(speeds[here] - middle)))]]
    return float(speeds[nearest[0]]), nearest, np.ones((1, 1))


def _directions(speeds: FloatArray) -> BoolArray:
    """Return whether each frame belongs to a run-up, ignoring speed fluctuations below the reversal limits."""
    step = max(MIN_REVERSAL_OF_SPAN * float(np.ptp(speeds)), MIN_REVERSAL_OF_SPEED * float(speeds.max()))
    turns, high, low, going = [0], 0, 0, 0
    for at, speed in enumerate(speeds):
        high, low = (at if speed > speeds[high] else high), (at if speed < speeds[low] else low)
        if going >= 0 and speeds[high] - speed > step:
            turns.append(high)
            going, low = -1, at
        elif going <= 0 and speed - speeds[low] > step:
            turns.append(low)
            going, high = 1, at
    up = np.ones(speeds.size, dtype=np.bool_)
    for begin, end in pairwise([*turns, speeds.size - 1]):
        up[begin : end + 1] = speeds[end] >= speeds[begin]
    return up


def _saddle(outward: FloatArray) -> float:
    """Return the lowest amplitude between a peak (first element) and the next higher point or the end."""
    higher = np.flatnonzero(outward > outward[0])
    return float(outward[: higher[0]].min()) if higher.size else float(outward.min())


def _resonance(curve: SpeedCurve, probe: int, at: int) -> Resonance:
    """Return a peak of the curve, from the points down to half the power.

    For the response to unbalance the inverse power is exactly a parabola over the inverse square of the speed; it is
    fitted by least squares.
    """
    amplitude, speeds = curve.amplitudes[probe], curve.speeds
    half = amplitude[at] / np.sqrt(2.0)
    below, above = np.flatnonzero(amplitude[:at] < half), np.flatnonzero(amplitude[at:] < half)
    unresolved = Resonance(float(speeds[at]), float(amplitude[at]), amplitude_sigma=float(curve.sigma[probe, at]))
    if not (below.size and above.size) or at + above[0] - below[-1] <= MIN_RESONANCE_POINTS:
        return unresolved
    used = np.arange(below[-1], at + above[0] + 1)
    y, power = (speeds[at] / speeds[used]) ** 2, (amplitude[at] / amplitude[used]) ** 2
    weight = 1.0 / np.maximum(2.0 * power * curve.sigma[probe, used] / amplitude[used], 1e-9)
    basis = np.vander(y, 3, increasing=True)
    parabola = np.linalg.lstsq(weight[:, None] * basis, weight * power, rcond=None)[0]
    if not (parabola[2] > 0.0 and 4.0 * parabola[0] * parabola[2] > parabola[1] ** 2):
        return unresolved
    left = weight * (power - basis @ parabola)
    spread = max(float(left @ left) / max(used.size - 3, 1), 1.0)
    covariance = spread * np.linalg.pinv((weight[:, None] * basis).T @ (weight[:, None] * basis))
    values = _peak(parabola)
    steps = np.diag(1e-3 * np.sqrt(np.diag(covariance)))
    slopes = np.stack([(_peak(parabola + step) - values) / step.sum() for step in steps], axis=1)
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", slopes, covariance, slopes))
    lag = np.interp(speeds[at] * values[3:], speeds, curve.lags[probe])
    return Resonance(
        speed=float(speeds[at] * values[0]),
        amplitude=float(amplitude[at] * values[1]),
        amplification_factor=float(values[2]),
        phase_change=float(lag[1] - lag[0]),
        speed_sigma=float(speeds[at] * sigma[0]),
        amplitude_sigma=float(amplitude[at] * sigma[1]),
        amplification_factor_sigma=float(sigma[2]),
    )


def _peak(parabola: FloatArray) -> FloatArray:
    """Return speed, amplitude, amplification factor and half-power speeds of a + b y + c y², y = 1 / speed²."""
    a, b, c = parabola
    middle, least = -0.5 * b / c, a - 0.25 * b**2 / c
    width = np.sqrt(least / c)
    speed, first, second = (1.0 / np.sqrt(place) for place in (middle, middle + width, middle - width))
    return np.array([speed, 1.0 / np.sqrt(least), speed / (second - first), first, second])


@dataclass(frozen=True, slots=True, eq=False)
class SpeedRow:
    """Mean results of the frames in one bin of speed.

    Parameters
    ----------
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: complex mean of the kX vectors at x and y, m peak, x(t) = Re[X exp(i k theta)].
    scatter : ndarray of float64, shape (2, 2)
        Standard deviation of those vectors about their mean (modulus of the complex deviation), m peak.
    mean_overall, largest_overall : ndarray of float64, shape (n_measures, 2)
        Measures `OVERALL` of the probes.
    compensated : ndarray of complex128, shape (2, 2)
        Complex mean of the kX vectors minus run-out, over the frames of known run-out; NaN without such frames.
    """

    direction: Annotated[RampDirection, NUMBER.of("Ramp direction of the shaft speed", "ramp_direction")]
    speed: Annotated[float, SPEED.of("Mean shaft speed")]
    frames: Annotated[int, NUMBER.of("Number of order spectra in the bin")]
    vectors: ComplexArray
    scatter: FloatArray
    mean_overall: Annotated[FloatArray, OVERALL.called("mean", at_probes=True)]
    largest_overall: Annotated[FloatArray, OVERALL.called("largest", at_probes=True)]
    noise: Annotated[float, PEAK.of("Mean noise floor of the order spectra", "noise_peak")]
    whirl_amplitude: Annotated[
        float,
        PEAK.of(
            "Largest component below 1X, half the major axis of its ellipse; unknown without one above the noise",
            "whirl_peak",
        ),
    ]
    whirl_order: Annotated[float, NUMBER.of("Order of the largest component below 1X; unknown likewise")]
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
    overall: FloatArray = field(default_factory=lambda: np.zeros((len(OVERALL.rows), 2)))
    largest: FloatArray = field(default_factory=lambda: np.zeros((len(OVERALL.rows), 2)))

    @classmethod
    def of_frame(cls, frame: OrderFrame) -> "_Bin":
        whirl, compensated = frame.whirl, frame.compensated
        return cls(
            frames=1,
            speed=frame.speed,
            vectors=frame.vectors,
            squares=np.abs(frame.vectors) ** 2,
            compensated=np.zeros((2, 2), dtype=np.complex128) if compensated is None else compensated,
            compensated_frames=int(compensated is not None),
            noise=frame.noise,
            whirl_amplitude=0.0 if whirl is None else whirl.amplitude,
            whirl_order=np.nan if whirl is None else whirl.order,
        )

    def add(self, other: "_Bin") -> None:
        for name in _SUMS:
            setattr(self, name, getattr(self, name) + getattr(other, name))
        if other.whirl_amplitude > self.whirl_amplitude:
            self.whirl_amplitude, self.whirl_order = other.whirl_amplitude, other.whirl_order
        self.largest = np.maximum(self.largest, other.largest)

    def row(self, direction: RampDirection) -> SpeedRow:
        vectors = self.vectors / self.frames
        known = self.compensated_frames > 0
        return SpeedRow(
            direction=direction,
            speed=self.speed / self.frames,
            frames=self.frames,
            vectors=vectors,
            scatter=np.sqrt(np.maximum(self.squares / self.frames - np.abs(vectors) ** 2, 0.0)),
            mean_overall=self.overall / self.overalls,
            largest_overall=self.largest.copy(),
            noise=self.noise / self.frames,
            whirl_amplitude=self.whirl_amplitude or np.nan,
            whirl_order=self.whirl_order,
            compensated=self.compensated / self.compensated_frames if known else np.full((2, 2), np.nan + 0j),
        )


_Bins = defaultdict[int, _Bin]
_SUMS = ("frames", "speed", "vectors", "squares", "compensated", "compensated_frames", "noise", "overalls", "overall")


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
            overall = snapshot.overall
            self._since[round(snapshot.speed / self._width)].add(_Bin(overalls=1, overall=overall, largest=overall))
        if snapshot.frame is not None:
            self._since[round(snapshot.frame.speed / self._width)].add(_Bin.of_frame(snapshot.frame))

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

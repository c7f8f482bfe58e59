"""Snapshots: the results of the live analysis at one sample, shared by view, service, recording and summary.

Phase convention: x(t) = Re[X exp(i k theta)] with theta = 0 when the keyphasor mark passes the tacho. Phases shown to
operators are the *lag*, -arg(X), in degrees. Amplitudes are zero-to-peak unless the name says otherwise.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from analysis.signals import BoolArray, ComplexArray, FloatArray, IntArray
from analysis.signals.uncertainty import phase_sigma
from analysis.signals.units import MICROSECOND

RECENT_TIME = 10.0  # s: span of the recent counts


class TachoState(StrEnum):
    """State of the tacho signal."""

    GOOD = "good"
    NO_PULSES = "no pulses"  # in the last seconds: shaft at rest, sensor unplugged or misaligned
    IRREGULAR = "irregular"  # pulse intervals too unequal for a shaft: noise, or sensor response exceeded
    TOO_FAST = "too fast"  # light or dark is shorter than the sensor response: speed may read too low


@dataclass(frozen=True, slots=True)
class TachoReport:
    """Present state of the tacho and its pulse counts since the start of the run.

    Parameters
    ----------
    state : TachoState
        State over the last update interval.
    pulses : int
        Accepted pulses.
    filled : int
        Missing pulses that were filled in.
    rejected : int
        Edges rejected as doubles or noise.
    jitter : float
        Robust scatter (1.4826 MAD) of the edges about the smooth angle, s; NaN without an angle.
    phase_reference_is_arbitrary : bool
        Whether theta = 0 is the first mark seen of several indistinguishable ones: phases hold within a train only.
    """

    state: TachoState
    pulses: int
    filled: int
    rejected: int
    jitter: float
    phase_reference_is_arbitrary: bool = False


class CounterState(StrEnum):
    """Agreement of the tacho counter with the sampled tacho waveform."""

    AGREES = "agrees"
    COUNT_DIFFERS = "count differs"  # some edges are in only one of them
    TIMES_DIFFER = "times differ"  # by more than the configured tolerance
    FAILED = "failed"  # the counter delivers no more timestamps in this segment


@dataclass(frozen=True, slots=True)
class CounterReport:
    """Comparison of the tacho counter with the tacho waveform since the start of the run.

    Edges are compared with a short delay, so that late timestamps are included.

    Parameters
    ----------
    is_working : bool
        Whether the counter still delivers timestamps.
    compared : int
        Edges found by both.
    missing : int
        Edges of the waveform without a timestamp.
    extra : int
        Timestamps without an edge in the waveform.
    out_of_tolerance : int
        Edges found by both whose times differ by more than the configured tolerance.
    mean_difference : float
        Mean time of the counter minus that of the waveform, s; NaN where none were compared.
    largest_difference : float
        Largest time difference, s; NaN where none were compared.
    recent : int
        Edges of either that were compared in the last `RECENT_TIME` s.
    recent_mismatches : int
        Of those: missing, extra or out of tolerance.
    """

    is_working: bool
    compared: int
    missing: int
    extra: int
    out_of_tolerance: int
    mean_difference: float
    largest_difference: float
    recent: int = 0
    recent_mismatches: int = 0

    @property
    def state(self) -> CounterState:
        """State of the comparison."""
        if not self.is_working:
            return CounterState.FAILED
        if self.missing or self.extra:
            return CounterState.COUNT_DIFFERS
        return CounterState.TIMES_DIFFER if self.out_of_tolerance else CounterState.AGREES

    @property
    def message(self) -> str:
        """Message for the operator; empty where both agree."""
        messages = {
            CounterState.FAILED: ["the counter delivers no more timestamps: speed and phase use the samples"],
            CounterState.COUNT_DIFFERS: [
                f"{count:,} {what}"
                for count, what in (
                    (self.missing, "edges of the waveform without a timestamp"),
                    (self.extra, "timestamps without an edge in the waveform"),
                )
                if count
            ],
            CounterState.TIMES_DIFFER: [
                f"{self.out_of_tolerance:,} edges up to {self.largest_difference / MICROSECOND:,.1f} µs apart"
            ],
        }
        return " and ".join(messages.get(self.state, []))

    @property
    def recent_message(self) -> str:
        """Mismatches in the last `RECENT_TIME` s; empty where both agree or the counter has failed."""
        if self.state in {CounterState.AGREES, CounterState.FAILED}:
            return ""
        how_many = f"{self.recent_mismatches:,} of {self.recent:,}" if self.recent_mismatches else "none"
        return f"{how_many} in the last {RECENT_TIME:g} s"


@dataclass(frozen=True, slots=True, eq=False)
class Whirl:
    """A component below 1X in one order frame.

    Parameters
    ----------
    order : float
        Frequency over shaft frequency.
    forward, backward : float
        Amplitudes of its forward and backward circles, m peak; the half axes are their sum and difference.
    vectors : ndarray of complex128, shape (2,)
        Peak amplitude and phase at the probes x and y, m (phases only meaningful relative to each other).
    order_sigma : float
        Standard deviation of the order, from the noise floor; NaN in older files.
    sigma : float
        Standard deviation of the amplitude, from the noise floor, m peak; NaN in older files.
    """

    order: float
    forward: float
    backward: float
    vectors: ComplexArray
    order_sigma: float = math.nan
    sigma: float = math.nan

    @property
    def amplitude(self) -> float:
        """Half the major axis of its ellipse, m peak."""
        return self.forward + self.backward

    @property
    def is_forward(self) -> bool:
        """Whether it precesses with the rotation."""
        return self.forward >= self.backward


@dataclass(frozen=True, slots=True, eq=False)
class RunOut:
    """Run-out of the probed surfaces, to be subtracted from the measured motion.

    Parameters
    ----------
    vectors : ndarray of complex128, shape (n_orders, 2)
        ``vectors[k - 1, probe]``: run-out of the whole order k, at least 1 and 2, m peak; NaN where unknown.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of the amplitudes of 1X and 2X, m peak; 0 where unknown.
    """

    vectors: ComplexArray
    sigma: FloatArray

    def waveform(self, points: int) -> FloatArray:
        """Return the run-out over one revolution from theta = 0, shape (2, points), m; unknown orders count as 0."""
        orders = np.arange(1, len(self.vectors) + 1)
        turn = np.exp(2j * np.pi * np.outer(orders, np.arange(points) / points))
        return np.asarray((np.nan_to_num(self.vectors).T @ turn).real, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class OrderFrame:
    """Order spectrum, vectors, whirl components and orbit of the last whole revolutions.

    Parameters
    ----------
    speed : float
        Mean shaft speed over the frame, rad/s.
    acceleration : float
        Mean rate of change of speed over the frame, rad/s².
    orders : ndarray of float64, shape (n_orders,)
        Order axis, from 0, step 1 / revolutions.
    spectrum : ndarray of complex128, shape (2, n_orders)
        Order spectrum at x and y with the window of the settings, m peak, phase referred to theta = 0.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: the kX vector, k = 1, 2, at x and y, m peak.
    noise : float
        Noise floor of the order spectrum between the whole orders, m peak (median over orders and probes).
    whirls : tuple of Whirl
        Sub-synchronous components above the noise floor, the strongest first; older files hold one at most.
    orbit : ndarray of float64, shape (2, n_points)
        Displacement in the bench axes X and Y over the last ``orbit_revolutions`` whole revolutions, mean removed, m;
        every ``points_per_revolution``-th point, starting with the first, lies at theta = 0.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of the amplitudes of 1X and of 2X at either probe, from the neighbouring lines, m peak; NaN
        in older files.
    angle_sigma : float
        Standard deviation of the shaft angle, averaged by the window, from the tacho jitter, rad; NaN in older files.
    runout : RunOut or None
        Known run-out; None where unknown or not to be subtracted.
    compensated_orbit : ndarray of float64, shape (2, n_points), or None
        Orbit minus run-out; None where not requested or unknown.
    """

    speed: float
    acceleration: float
    orders: FloatArray
    spectrum: ComplexArray
    vectors: ComplexArray
    noise: float
    whirls: tuple[Whirl, ...]
    orbit: FloatArray
    sigma: FloatArray = field(default_factory=lambda: np.full(2, np.nan))
    angle_sigma: float = math.nan
    runout: RunOut | None = None
    compensated_orbit: FloatArray | None = None

    @property
    def compensated(self) -> ComplexArray | None:
        """``vectors`` minus the run-out, NaN for an order of unknown run-out; None where no run-out is known."""
        return None if self.runout is None else self.vectors - self.runout.vectors[:2]

    @property
    def compensated_sigma(self) -> FloatArray:
        """Standard deviation of the amplitudes of ``compensated``, shape (2,), m peak: root of the sum of squares."""
        return self.sigma if self.runout is None else np.hypot(self.sigma, self.runout.sigma)

    @property
    def compensated_phase_sigma(self) -> FloatArray:
        """Standard deviation of the phases of ``compensated``, shape (2, 2), rad.

        An error of the shaft angle turns the whole measured vector, run-out included.
        """
        rest = self.vectors if self.compensated is None else self.compensated
        turned = self.angle_sigma * np.array([[1.0], [2.0]]) * np.abs(self.vectors)
        spread = np.hypot(self.compensated_sigma[:, None], turned)
        return phase_sigma(np.abs(rest), spread, np.zeros(()), 1.0)

    @property
    def motion(self) -> ComplexArray:
        """Vectors of the shaft motion: compensated where the run-out is known, else as measured."""
        compensated = self.compensated
        return self.vectors if compensated is None else np.where(np.isnan(compensated), self.vectors, compensated)

    @property
    def whirl(self) -> Whirl | None:
        """The strongest component below 1X."""
        return self.whirls[0] if self.whirls else None

    @property
    def phase_sigma(self) -> FloatArray:
        """Standard deviation of the phases of ``vectors``, shape (2, 2), rad; NaN in older files."""
        sigmas = [
            phase_sigma(np.abs(vectors), np.full(2, sigma), np.full(2, self.angle_sigma), order)
            for order, vectors, sigma in zip((1.0, 2.0), self.vectors, self.sigma, strict=True)
        ]
        return np.stack(sigmas)


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """The last samples as waveforms, thinned for display.

    Parameters
    ----------
    time : ndarray of float64, shape (n,)
        Time in the segment, s.
    displacement : ndarray of float64, shape (2, n)
        Displacement towards the probes x and y, mean subtracted, m.
    tacho : ndarray of float64, shape (n,)
        Tacho voltage, V.
    """

    time: FloatArray
    displacement: FloatArray
    tacho: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Results of the live analysis at one sample.

    Snapshots lie at fixed sample indices, every ``update_interval`` and at the end of a segment. They do not depend on
    the block size and are identical, bit for bit, live and in replay.

    Parameters
    ----------
    segment : int
        Segment of the run.
    sample : int
        Index one past the last sample used.
    time : float
        ``sample / rate``, s in the segment.
    speed : float
        Shaft speed over the last revolutions, rad/s; NaN without valid tacho pulses.
    tacho : TachoReport
        State and pulse counts of the tacho.
    gap_volts : ndarray of float64, shape (2,)
        Mean voltage of the probes over the last update interval, V.
    gap_in_window : ndarray of bool, shape (2,)
        Whether each lies within its limits.
    peak_to_peak : ndarray of float64, shape (2,)
        Overall peak-to-peak of each probe over the last update interval or revolution, whichever is longer, m: whole
        update intervals, each without the extreme 0.2 ms (2 % at most) at either end, to exclude sensor glitches.
    clipped : ndarray of int64, shape (n_channels,)
        Samples at the limits of the converter range since the start of the run, per channel.
    frame : OrderFrame or None
        None until the segment has enough whole revolutions, and without valid tacho pulses.
    trace : Trace
        The last samples.
    outside_calibration : ndarray of int64, shape (2,)
        Samples of each probe since the start of the run outside the calibrated voltage range: their displacement is
        extrapolated.
    counter : CounterReport or None
        Comparison of the tacho counter with the waveform; None without a counter.
    """

    segment: int
    sample: int
    time: float
    speed: float
    tacho: TachoReport
    gap_volts: FloatArray
    gap_in_window: BoolArray
    peak_to_peak: FloatArray
    clipped: IntArray
    frame: OrderFrame | None
    trace: Trace
    outside_calibration: IntArray = field(default_factory=lambda: np.zeros(2, dtype=np.int64))
    counter: CounterReport | None = None

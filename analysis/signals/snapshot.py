"""Snapshots: the results of the live analysis at one sample, shared by view, service, recording and summary.

Phase convention: x(t) = Re[X exp(i k theta)] with theta = 0 when the keyphasor mark passes the tacho. Phases shown to
operators are the *lag*, -arg(X), in degrees. Amplitudes are zero-to-peak unless the name says otherwise.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Self

import numpy as np

from analysis.signals import BoolArray, ComplexArray, FloatArray, IntArray
from analysis.signals.uncertainty import phase_sigma
from analysis.signals.units import (
    ACCELERATION,
    LENGTH,
    MICROSECOND,
    NUMBER,
    PEAK,
    PEAK_TO_PEAK,
    RMS,
    SHORT_TIME,
    SPEED,
    TIME,
    Measures,
)

RECENT_TIME = 10.0  # s: span of the recent counts

OVERALL = Measures(
    (
        PEAK_TO_PEAK.of("overall vibration", "peak_to_peak"),
        RMS.of("overall vibration without its mean; unknown in older recordings", "rms"),
    ),
    at_probes=True,
)
"""Measures of the overall, unfiltered vibration, from `analysis.shaft.overall.OverallWindow`."""
LARGEST_OVERALL = OVERALL.called("largest")


class TachoState(StrEnum):
    """State of the tacho signal."""

    GOOD = "good"
    NO_PULSES = "no pulses"  # in the last seconds: shaft at rest, sensor unplugged or misaligned
    IRREGULAR = "irregular"  # pulse intervals too unequal for a shaft: noise, or sensor response exceeded
    TOO_FAST = "too fast"  # light or dark is shorter than the sensor response: speed may read too low


@dataclass(frozen=True, slots=True)
class TachoReport:
    """Present state of the tacho and its pulse counts since the start of the run."""

    state: Annotated[TachoState, NUMBER.of("State over the last update interval")]
    pulses: Annotated[int, NUMBER.of("Pulses accepted")]
    filled: Annotated[int, NUMBER.of("Missing pulses that were filled in")]
    rejected: Annotated[int, NUMBER.of("Edges rejected as doubles or noise")]
    jitter: Annotated[float, SHORT_TIME.of("Robust scatter (1.4826 MAD) of the edges about the smooth angle")]
    phase_reference_is_arbitrary: Annotated[
        bool,
        NUMBER.of(
            "Whether several keyphasor marks are indistinguishable; phases then refer to the first one of each "
            "pulse train and cannot be compared between trains or runs"
        ),
    ] = False


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
    """

    is_working: bool
    compared: Annotated[int, NUMBER.of("Edges found by both")]
    missing: Annotated[int, NUMBER.of("Edges of the waveform without a timestamp of the counter")]
    extra: Annotated[int, NUMBER.of("Timestamps without an edge of the waveform")]
    out_of_tolerance: Annotated[int, NUMBER.of("Edges with a time difference above the limit of the rig file")]
    mean_difference: Annotated[
        float, SHORT_TIME.of("Mean time of the counter minus that of the waveform; unknown where none were compared")
    ]
    largest_difference: Annotated[float, SHORT_TIME.of("Largest magnitude of the time difference")]
    recent: Annotated[int, NUMBER.of(f"Edges found by either in the last {RECENT_TIME:g} s")] = 0
    recent_mismatches: Annotated[
        int, NUMBER.of(f"Edges of the last {RECENT_TIME:g} s that are missing, extra or out of tolerance")
    ] = 0

    @property
    def state(self) -> Annotated[CounterState, NUMBER.of("Verdict of the comparison")]:
        """State of the comparison."""
        if not self.is_working:
            return CounterState.FAILED
        if self.missing or self.extra:
            return CounterState.COUNT_DIFFERS
        return CounterState.TIMES_DIFFER if self.out_of_tolerance else CounterState.AGREES

    @property
    def message(
        self,
    ) -> Annotated[str, NUMBER.of("Disagreement over the whole run, for the operator; empty where both agree")]:
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
    def recent_message(
        self,
    ) -> Annotated[
        str, NUMBER.of(f"Disagreement in the last {RECENT_TIME:g} s; empty where both agree or the counter has failed")
    ]:
        """Mismatches in the last `RECENT_TIME` s; empty where both agree or the counter has failed."""
        if self.state in {CounterState.AGREES, CounterState.FAILED}:
            return ""
        how_many = f"{self.recent_mismatches:,} of {self.recent:,}" if self.recent_mismatches else "none"
        return f"{how_many} in the last {RECENT_TIME:g} s"


class WhirlDirection(StrEnum):
    """Sense of a whirl relative to the rotation."""

    FORWARD = "forward"  # with the shaft
    BACKWARD = "backward"

    @classmethod
    def of(cls, *, is_forward: bool) -> Self:
        """Return the sense of a whirl."""
        return cls.FORWARD if is_forward else cls.BACKWARD


@dataclass(frozen=True, slots=True, eq=False)
class Whirl:
    """A component below 1X in one order frame.

    Parameters
    ----------
    forward, backward : float
        Amplitudes of its forward and backward circles, m peak; the half axes are their sum and difference.
    vectors : ndarray of complex128, shape (2,)
        Peak amplitude and phase at the probes x and y, m (phases only meaningful relative to each other).
    """

    order: Annotated[float, NUMBER.of("Frequency over shaft frequency")]
    forward: float
    backward: float
    vectors: ComplexArray
    order_sigma: Annotated[float, NUMBER.of("Standard deviation of the order, from the noise between the lines")] = (
        math.nan
    )
    sigma: Annotated[
        float, LENGTH.of("Standard deviation of the amplitude, from the noise between the lines", "amplitude_sigma")
    ] = math.nan

    @property
    def direction(self) -> Annotated[WhirlDirection, NUMBER.of("Sense of the whirl relative to the rotation")]:
        """Sense of the whirl."""
        return WhirlDirection.of(is_forward=self.is_forward)

    @property
    def amplitude(self) -> Annotated[float, PEAK.of("Half the major axis of the ellipse", "amplitude_peak")]:
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
    orders : ndarray of float64, shape (n_orders,)
        Order axis, from 0, step 1 / revolutions.
    spectrum : ndarray of complex128, shape (2, n_orders)
        Order spectrum at x and y with the window of the settings, m peak, phase referred to theta = 0.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: the kX vector, k = 1, 2, at x and y, m peak.
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

    speed: Annotated[float, SPEED.of("Mean shaft speed over the frame")]
    acceleration: Annotated[float, ACCELERATION.of("Mean rate of change of speed over the frame")]
    orders: FloatArray
    spectrum: ComplexArray
    vectors: ComplexArray
    noise: Annotated[
        float,
        PEAK.of(
            "Noise floor of the order spectrum between the whole orders (median over orders and probes)", "noise_peak"
        ),
    ]
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
    tacho : TachoReport
        State and pulse counts of the tacho.
    gap_volts : ndarray of float64, shape (2,)
        Mean voltage of the probes over the last update interval, V.
    gap_in_window : ndarray of bool, shape (2,)
        Whether each lies within its limits.
    overall : ndarray of float64, shape (n_measures, 2)
        Measures `OVERALL` of each probe over the last update interval or revolution, whichever is longer: whole update
        intervals.
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

    segment: Annotated[int, NUMBER.of("Gap-free stretch of the run, from 0")]
    sample: Annotated[int, NUMBER.of("Index in the segment, one past the last sample used")]
    time: Annotated[float, TIME.of("Sample time in the segment")]
    speed: Annotated[float, SPEED.of("Shaft speed over the last revolutions; unknown without tacho pulses")]
    tacho: TachoReport
    gap_volts: FloatArray
    gap_in_window: BoolArray
    overall: Annotated[FloatArray, OVERALL]
    clipped: IntArray
    frame: OrderFrame | None
    trace: Trace
    outside_calibration: IntArray = field(default_factory=lambda: np.zeros(2, dtype=np.int64))
    counter: CounterReport | None = None

    @property
    def peak_to_peak(self) -> FloatArray:
        """Overall peak-to-peak of each probe, shape (2,), m."""
        return np.asarray(self.overall[0], dtype=np.float64)

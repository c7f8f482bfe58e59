"""What the analyser says of the shaft at one moment: the one result that view, service, recording and summary share.

Phase convention, written once: x(t) = Re[X exp(i k theta)] with theta = 0 when the mark passes the tacho.
Where operators read a phase it is the *lag*, -arg(X), in degrees. Amplitudes are zero-to-peak unless the name says
otherwise.
"""

import math
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from analysis.signals.uncertainty import phase_sigma

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


class TachoState(StrEnum):
    """What the tacho gives."""

    GOOD = "good"
    NO_PULSES = "no pulses"  # nothing in the last seconds: standing still, unplugged or misaligned
    IRREGULAR = "irregular"  # pulses too unequal to be a shaft: noise, or a response limit passed
    TOO_FAST = "too fast"  # light or dark time under the sensor's response time: speed may read too low


@dataclass(frozen=True, slots=True)
class TachoReport:
    """What was seen of the tacho since the run began, and its state now.

    Parameters
    ----------
    state : TachoState
        The verdict on the last update interval.
    pulses : int
        Pulses accepted.
    filled : int
        Pulses that were missing and filled in.
    rejected : int
        Edges that were rejected as doubles or noise.
    jitter : float
        Robust scatter (1.4826 MAD) of the edges about the smooth angle, s; NaN where there is none.
    phase_reference_is_arbitrary : bool
        Whether theta = 0 is the first mark seen of several that cannot be told apart: phases hold within a train only.
    """

    state: TachoState
    pulses: int
    filled: int
    rejected: int
    jitter: float
    phase_reference_is_arbitrary: bool = False


RECENT_TIME = 10.0  # s: what happened longer ago is history to whoever watches


class CounterState(StrEnum):
    """How the tacho's counter and its waveform stand to one another."""

    AGREES = "agrees"
    COUNT_DIFFERS = "count differs"  # edges that only one of them has
    TIMES_DIFFER = "times differ"  # by more than the rig says they may
    FAILED = "failed"  # the counter gives no more stamps in this segment


@dataclass(frozen=True, slots=True)
class CounterReport:
    """The tacho's counter against its waveform since the run began; edges are compared a little later than they come.

    Parameters
    ----------
    is_working : bool
        Whether it still gives stamps.
    compared : int
        Edges that both have.
    missing : int
        Edges of the waveform that the counter has not stamped.
    extra : int
        Stamps where the waveform has no edge.
    out_of_tolerance : int
        Edges of both that lie further apart than the rig says they may.
    mean_difference : float
        How much later the counter has them, in the mean, s; NaN where none were compared.
    largest_difference : float
        Largest distance of the two, s; NaN where none were compared.
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
        """The verdict."""
        if not self.is_working:
            return CounterState.FAILED
        if self.missing or self.extra:
            return CounterState.COUNT_DIFFERS
        return CounterState.TIMES_DIFFER if self.out_of_tolerance else CounterState.AGREES

    @property
    def message(self) -> str:
        """What an operator should know; empty where they agree."""
        odds = {
            CounterState.FAILED: ["the counter gives no more stamps: speed and phase are taken from the samples"],
            CounterState.COUNT_DIFFERS: [
                f"{count:,} {what}"
                for count, what in (
                    (self.missing, "edges of the waveform that the counter has not stamped"),
                    (self.extra, "stamps where the waveform has no edge"),
                )
                if count
            ],
            CounterState.TIMES_DIFFER: [
                f"{self.out_of_tolerance:,} edges up to {self.largest_difference * 1e6:,.1f} µs apart"
            ],
        }
        return " and ".join(odds.get(self.state, []))

    @property
    def recent_message(self) -> str:
        """Whether they still differ where they have; empty where they agree, or the counter has failed."""
        if self.state in {CounterState.AGREES, CounterState.FAILED}:
            return ""
        how_many = f"{self.recent_mismatches:,} of {self.recent:,}" if self.recent_mismatches else "none"
        return f"{how_many} in the last {RECENT_TIME:g} s"


@dataclass(frozen=True, slots=True, eq=False)
class Whirl:
    """A component below 1X.

    Parameters
    ----------
    order : float
        Its frequency over the shaft's.
    forward, backward : float
        Amplitudes of its forward and backward circles, m peak; the ellipse's half axes are their sum and difference.
    vectors : ndarray of complex128, shape (2,)
        Peak amplitude and phase at the probes x and y, m (phase only meaningful relative to each other).
    order_sigma : float
        Standard deviation of the order from the floor; NaN in older files.
    sigma : float
        Standard deviation of the amplitude from the floor, m peak; NaN in older files.
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
        """Whether it goes round with the shaft."""
        return self.forward >= self.backward


@dataclass(frozen=True, slots=True, eq=False)
class RunOut:
    """What the probes see of the surface, to be taken off what they see of the motion.

    Parameters
    ----------
    vectors : ndarray of complex128, shape (n_orders, 2)
        ``vectors[k - 1, probe]``: of the whole order k, at least 1 and 2, m peak; NaN where unknown.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of the amplitudes of 1X and 2X, m peak; 0 where nobody knows.
    """

    vectors: ComplexArray
    sigma: FloatArray

    def waveform(self, points: int) -> FloatArray:
        """Return it from the mark on over a turn, shape (2, points), m; orders that are not known leave nothing."""
        orders = np.arange(1, len(self.vectors) + 1)
        turn = np.exp(2j * np.pi * np.outer(orders, np.arange(points) / points))
        return np.asarray((np.nan_to_num(self.vectors).T @ turn).real, dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class OrderFrame:
    """What the last whole revolutions say.

    Parameters
    ----------
    speed : float
        Mean shaft speed over the frame, rad/s.
    acceleration : float
        Mean rate of change of speed over the frame, rad/s².
    orders : ndarray of float64, shape (n_orders,)
        Order axis, from 0, step 1 / revolutions.
    spectrum : ndarray of complex128, shape (2, n_orders)
        Hann-windowed order spectrum at x and y, m peak, phase referred to theta = 0.
    vectors : ndarray of complex128, shape (2, 2)
        ``vectors[k - 1, probe]``: the kX vector, k = 1, 2, at x and y, m peak.
    noise : float
        Floor of the order spectrum between the lines, m peak (median over orders and probes).
    whirls : tuple of Whirl
        Sub-synchronous components that stand above the floor, the strongest first; older files hold one at most.
    orbit : ndarray of float64, shape (2, n_points)
        Displacement in the bench's directions X and Y over the last ``orbit_revolutions`` whole revolutions, mean
        removed, m; every ``points_per_revolution``-th point from the first on lies on the mark.
    sigma : ndarray of float64, shape (2,)
        Standard deviation of the amplitudes of 1X and of 2X at either probe, from the lines beside them, m peak; NaN
        in older files.
    angle_sigma : float
        Standard deviation of the shaft's angle as the frame feels it, from the tacho's jitter, rad; NaN likewise.
    runout : RunOut or None
        What is known of the run-out; None where nothing is, or where it is not to be taken off.
    compensated_orbit : ndarray of float64, shape (2, n_points), or None
        The orbit less the run-out; None where that was not asked for or is not known.
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
        """``vectors`` less the run-out, NaN for an order whose run-out is not known; None where none is."""
        return None if self.runout is None else self.vectors - self.runout.vectors[:2]

    @property
    def compensated_sigma(self) -> FloatArray:
        """Standard deviation of the amplitudes of ``compensated``, shape (2,), m peak: both added in square."""
        return self.sigma if self.runout is None else np.hypot(self.sigma, self.runout.sigma)

    @property
    def compensated_phase_sigma(self) -> FloatArray:
        """Standard deviation of the phases of ``compensated``, shape (2, 2), rad: the angle's error turns all of it."""
        rest = self.vectors if self.compensated is None else self.compensated
        turned = self.angle_sigma * np.array([[1.0], [2.0]]) * np.abs(self.vectors)
        spread = np.hypot(self.compensated_sigma[:, None], turned)
        return phase_sigma(np.abs(rest), spread, np.zeros(()), 1.0)

    @property
    def motion(self) -> ComplexArray:
        """The vectors of the motion as well as they are known: compensated where the run-out is known."""
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
    """The last samples as a scope would show them, thinned for the eye.

    Parameters
    ----------
    time : ndarray of float64, shape (n,)
        Time in the segment, s.
    displacement : ndarray of float64, shape (2, n)
        Displacement towards the probes x and y, mean removed, m.
    tacho : ndarray of float64, shape (n,)
        Tacho voltage, V.
    """

    time: FloatArray
    displacement: FloatArray
    tacho: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The state of the shaft at one sample.

    Snapshots come at fixed sample indices, every ``update_interval`` and at a segment's end, whatever the size of the
    blocks, and hold the same bits live and in replay.

    Parameters
    ----------
    segment : int
        Segment of the run.
    sample : int
        One past the last sample used.
    time : float
        ``sample / rate``, s in the segment.
    speed : float
        Shaft speed over the last revolutions, rad/s; NaN where the tacho does not tell.
    tacho : TachoReport
        How far the tacho is to be trusted.
    gap_volts : ndarray of float64, shape (2,)
        Mean voltage of the probes over the last update interval, V.
    gap_ok : ndarray of bool, shape (2,)
        Whether each lies in its window.
    peak_to_peak : ndarray of float64, shape (2,)
        Overall peak-to-peak of each probe over the last update interval or revolution, whichever is longer, m: whole
        update intervals, each without the extreme 0.2 ms (2 % at most) at either side, where a sensor's glitches lie.
    clipped : ndarray of int64, shape (n_channels,)
        Samples at the converter's rails since the run began, per channel.
    frame : OrderFrame or None
        None until there are enough whole revolutions in the segment, and where the tacho does not allow one.
    trace : Trace
        The last samples.
    beyond_calibration : ndarray of int64, shape (2,)
        Samples of each probe since the run began whose voltage lies outside the span that was calibrated: their
        displacement is extrapolated.
    counter : CounterReport or None
        The tacho's counter against its waveform; None where no counter stamps its edges.
    """

    segment: int
    sample: int
    time: float
    speed: float
    tacho: TachoReport
    gap_volts: FloatArray
    gap_ok: NDArray[np.bool_]
    peak_to_peak: FloatArray
    clipped: NDArray[np.int64]
    frame: OrderFrame | None
    trace: Trace
    beyond_calibration: NDArray[np.int64] = field(default_factory=lambda: np.zeros(2, dtype=np.int64))
    counter: CounterReport | None = None

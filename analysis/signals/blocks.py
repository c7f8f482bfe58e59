"""Sample blocks and segment ends as a source delivers them; times, ramp direction and clock error of a run.

Index conventions: a *segment* is a stretch of samples without a gap, numbered from 0. The time of a sample is its
index over the sample rate. Arrays have channels first, samples last.
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated

import numpy as np

from analysis.signals import CodeArray, IntArray
from analysis.signals.header import Acquisition
from analysis.signals.units import CLOCK_ERROR, NUMBER, RPM, SPEED, TIME

CONFIDENCE_SIGMAS = 2.0  # standard deviations
GROUP_DURATION = 1.0  # s of samples averaged to one point, as delays within it are correlated
MIN_GROUPS = 5
MAX_CLOCK_ERROR = 0.01  # a larger error means that samples did not arrive in real time: simulation or replay
MIN_REVERSAL = 100.0 * RPM  # rad/s: a smaller change back is speed fluctuation
MIN_REVERSAL_FRACTION = 0.02  # of the speed, where that is more


@dataclass(frozen=True, slots=True, eq=False)
class SampleBlock:
    """Consecutive samples of all channels, as codes of the A/D converter.

    Parameters
    ----------
    codes : ndarray of int16, shape (n_channels, n_samples)
        Converter codes, C-contiguous.
    segment : int
        Number of the segment in its run, from 0.
    first_sample : int
        Index of the first sample in its segment.
    host_time_ns : int
        Wall clock of the host when the block had been read, ns since 1970 (for the record, never used to compute).
    backlog : int
        Samples per channel that the device still held after this block was read.
    ticks : ndarray of int64, shape (n_pulses,), or None
        Tacho edges stamped by a counter: ticks of its timebase since the first sample of the segment, rising from
        block to block. Contains the edges up to the last sample of this block that no earlier block contains; a late
        edge lies before the first sample. None without a counter, or after it failed.
    """

    codes: CodeArray
    segment: int
    first_sample: int
    host_time_ns: int
    backlog: int = 0
    ticks: IntArray | None = None

    def __post_init__(self) -> None:
        if self.codes.ndim != 2 or self.codes.dtype != np.int16:
            raise ValueError(
                f"codes: {self.codes.dtype} of shape {self.codes.shape}, expected int16 (n_channels, n_samples)"
            )

    @property
    def n_samples(self) -> int:
        """Number of samples per channel."""
        return int(self.codes.shape[1])

    @property
    def end(self) -> int:
        """Index one past the last sample."""
        return self.first_sample + self.n_samples

    def relocated(self, segment: int, first_sample: int, ticks_per_sample: float) -> "SampleBlock":
        """Return the block with another segment and first sample, without edges from before the new segment.

        Parameters
        ----------
        segment, first_sample : int
            New position of the block in its run.
        ticks_per_sample : float
            Counter ticks per sample.
        """
        ticks = self.ticks
        if ticks is not None and first_sample != self.first_sample:
            ticks = ticks - round((self.first_sample - first_sample) * ticks_per_sample)
            ticks = ticks[ticks >= 0]
        return replace(self, segment=segment, first_sample=first_sample, ticks=ticks)


class EndReason(StrEnum):
    """Why a segment ended."""

    STOPPED = "stopped"  # by the operator
    FINISHED = "finished"  # end of the source: planned length reached, or recording replayed
    OVERRUN = "overrun"  # samples were lost between the device and this program
    UNPLUGGED = "unplugged"  # the device was disconnected
    DEVICE_ERROR = "device error"  # any other error that the driver reported
    RECORDER = "recorder"  # the recorder was too slow or could not write
    CUT = "cut"  # the recording was truncated: its writer was killed


@dataclass(frozen=True, slots=True)
class SegmentEnd:
    """The end of a segment and the number of samples lost there."""

    segment: Annotated[int, NUMBER.of("Number of the segment, from 0")]
    samples: Annotated[int, NUMBER.of("Samples per channel that the segment delivered")]
    reason: Annotated[EndReason, NUMBER.of("Reason of the end", "end_reason")]
    lost: Annotated[int, NUMBER.of("Lost samples per channel after the last one", "lost_samples")] = 0
    lost_is_exact: Annotated[bool, NUMBER.of("False where the number of lost samples is a lower bound")] = True
    detail: Annotated[str, NUMBER.of("Message and code of the driver; empty without an error")] = ""

    @property
    def is_gap_free(self) -> bool:
        """Whether nothing was lost."""
        return self.lost == 0 and self.lost_is_exact


SourceItem = SampleBlock | SegmentEnd


@dataclass(frozen=True, slots=True)
class TimeInRun:
    """A time within a run, with the shaft speed at that time."""

    segment: Annotated[int, NUMBER.of("Gap-free stretch of the run, from 0")]
    time: Annotated[float, TIME.of("Sample time in that segment; of an order frame: its middle")]
    speed: Annotated[float, SPEED.of("Shaft speed there; unknown without tacho pulses")]


@dataclass(frozen=True, slots=True)
class ClockError:
    """Relative error of the card's sample clock against the host clock."""

    error: Annotated[
        float,
        CLOCK_ERROR.of(
            "Error of the card's clock against the computer's; positive where the card is fast", "clock_error"
        ),
    ]
    uncertainty: Annotated[
        float, CLOCK_ERROR.of("Half width of the 95 % interval of the clock error", "clock_uncertainty")
    ]


@dataclass(slots=True)
class _SegmentRegression:
    """Running sums of the regression in one segment: host time (s, from its first group) against card time (s)."""

    origin_ns: int
    n: int = 0
    card_mean: float = 0.0
    late_mean: float = 0.0
    card_card: float = 0.0
    card_late: float = 0.0
    late_late: float = 0.0

    def add(self, card: float, late: float) -> None:
        """Add a point: card time, s, and host time minus card time, s."""
        self.n += 1
        card_off, late_off = card - self.card_mean, late - self.late_mean
        self.card_mean += card_off / self.n
        self.late_mean += late_off / self.n
        self.card_card += card_off * (card - self.card_mean)
        self.card_late += card_off * (late - self.late_mean)
        self.late_late += late_off * (late - self.late_mean)


class ClockEstimator:
    """Regression of host time on card time over a run; memory grows only with the number of segments.

    Each segment has its own offset, all share one slope. The card time includes the backlog of the device, so that a
    late reader does not bias the slope.

    Parameters
    ----------
    rate : float
        Nominal sample rate, Hz.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._lines: dict[int, _SegmentRegression] = {}
        self._group = -1
        self._held: list[tuple[float, float]] = []

    def add_block(self, block: SampleBlock) -> None:
        """Add a block as it was read."""
        line = self._lines.get(block.segment)
        if line is None:
            self._close_group()
            line = self._lines[block.segment] = _SegmentRegression(block.host_time_ns)
            self._group = 0
        card = (block.end + block.backlog) / self._rate
        group = int(block.end / (self._rate * GROUP_DURATION))
        if group != self._group:
            self._close_group()
            self._group = group
        self._held.append((card, (block.host_time_ns - line.origin_ns) / 1e9 - card))

    def error(self) -> ClockError | None:
        """Return the clock error so far; None with too few samples, or where they did not arrive in real time."""
        lines = [line for line in self._lines.values() if line.n >= 2]
        n = sum(line.n for line in lines)
        freedom = n - len(lines) - 1
        if n < MIN_GROUPS or freedom < 1:
            return None
        spread = sum(line.card_card for line in lines)
        slope = sum(line.card_late for line in lines) / spread
        rest = max(0.0, sum(line.late_late for line in lines) - slope**2 * spread)
        if abs(slope) > MAX_CLOCK_ERROR:
            return None
        return ClockError(-slope / (1.0 + slope), CONFIDENCE_SIGMAS * math.sqrt(rest / freedom / spread))

    def _close_group(self) -> None:
        if self._held:
            n = len(self._held)
            line = self._lines[max(self._lines)]
            line.add(sum(card for card, _ in self._held) / n, sum(late for _, late in self._held) / n)
            self._held = []


@dataclass(frozen=True, slots=True)
class DeliveryStatistics:
    """Clock error and buffer use of a run.

    Parameters
    ----------
    clock : ClockError or None
        Clock error of the card; None where it could not be determined.
    """

    clock: ClockError | None = None
    backlog: Annotated[
        float | None,
        TIME.of("Longest time that samples waited in the card's buffer; unknown without a card", "largest_backlog"),
    ] = None
    buffer: Annotated[
        float | None, TIME.of("Capacity of the card's buffer; a larger backlog loses samples; unknown without a card")
    ] = None


class DeliveryMonitor:
    """Collects delivery statistics from the blocks of a run; memory grows only with the number of segments.

    Parameters
    ----------
    acquisition : Acquisition
        Rates and buffer size; the backlog is known only with the buffer size.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._clock = ClockEstimator(acquisition.rate)
        self._backlog = 0  # samples per channel

    def add_block(self, block: SampleBlock) -> None:
        """Add a block as it was read."""
        self._clock.add_block(block)
        self._backlog = max(self._backlog, block.backlog)

    def statistics(self) -> DeliveryStatistics:
        """Return the statistics so far."""
        buffer = self._acquisition.buffer_time
        backlog = None if buffer is None else self._backlog / self._acquisition.rate
        return DeliveryStatistics(self._clock.error(), backlog, buffer)


class RampDirection(StrEnum):
    """Direction in which the speed changes."""

    RUN_UP = "run-up"
    RUN_DOWN = "run-down"


class RampStep(StrEnum):
    """A speed compared with those before it."""

    FURTHEST = "furthest"  # the furthest so far in the present direction
    WITHIN = "within"  # not so far: speed fluctuation, or the beginning of a reversal
    REVERSED = "reversed"  # so far back that the direction has reversed, at the furthest speed before


class RampTracker:
    """Tracks the ramp direction of a run.

    At constant speed the direction of the ramp before it stays. A run that starts at constant speed is a run-up.
    """

    def __init__(self) -> None:
        self._low = self._high = np.nan  # since the last reversal
        self._direction: RampDirection | None = None

    @property
    def direction(self) -> RampDirection:
        """Present ramp direction."""
        return self._direction or RampDirection.RUN_UP

    def update(self, speed: float) -> RampStep:
        """Add a speed, rad/s, finite; return how it compares with those before."""
        if np.isnan(self._low):
            self._low = self._high = speed
        rises, falls = speed > self._high, speed < self._low
        self._low, self._high = min(self._low, speed), max(self._high, speed)
        step = max(MIN_REVERSAL, MIN_REVERSAL_FRACTION * speed)
        if self._direction is not RampDirection.RUN_DOWN and self._high - speed > step:
            return self._reverse(RampDirection.RUN_DOWN, speed)
        if self._direction is not RampDirection.RUN_UP and speed - self._low > step:
            return self._reverse(RampDirection.RUN_UP, speed)
        is_furthest = rises if self._direction is RampDirection.RUN_UP else falls and self._direction is not None
        return RampStep.FURTHEST if is_furthest else RampStep.WITHIN

    def _reverse(self, direction: RampDirection, speed: float) -> RampStep:
        self._direction = direction
        self._low = self._high = speed
        return RampStep.REVERSED

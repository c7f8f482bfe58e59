"""Delivery of samples from the device: error of the card's clock against the host clock, and buffer backlog."""

import math
from dataclasses import dataclass

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition

PPM = 1e-6
CONFIDENCE_SIGMAS = 2.0  # standard deviations
GROUP_DURATION = 1.0  # s of samples averaged to one point, as delays within it are correlated
MIN_GROUPS = 5
MAX_CLOCK_ERROR = 0.01  # a larger error means that samples did not arrive in real time: simulation or replay


@dataclass(frozen=True, slots=True)
class ClockError:
    """Relative error of the card's sample clock against the host clock.

    Parameters
    ----------
    error : float
        Relative; positive where the card takes more samples per host second than its nominal rate.
    uncertainty : float
        Relative half width of the interval of about 95 % confidence, for a correct host clock and random delays.
    """

    error: float
    uncertainty: float


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
    backlog : float or None
        Largest backlog in the device after a block was read, s of samples; None where unknown.
    buffer : float or None
        Size of the device buffer, s of samples; None where unknown.
    """

    clock: ClockError | None = None
    backlog: float | None = None
    buffer: float | None = None


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

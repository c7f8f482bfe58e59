"""How a run's samples came from the device, beside what they say: the card's clock, and how full its buffer became.

How fast the card's clock runs by the host's: a straight line through when its blocks were read.
"""

import math
from dataclasses import dataclass

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition

PPM = 1e-6
CONFIDENCE_SIGMAS = 2.0  # standard deviations
GROUP_DURATION = 1.0  # s of samples that are taken as one: delays within it belong together
MIN_GROUPS = 5
MAX_CLOCK_ERROR = 0.01  # an error beyond which the samples did not come as time went: simulated or replayed flat out


@dataclass(frozen=True, slots=True)
class ClockError:
    """The card's clock against the host's.

    Parameters
    ----------
    error : float
        Relative: positive where the card takes more samples a second of the host than its nominal rate.
    uncertainty : float
        Relative; the truth is within it on either side with about 95 % confidence, as far as the host's own clock is
        right and its delays are irregular.
    """

    error: float
    uncertainty: float


@dataclass(slots=True)
class _SegmentRegression:
    """Running sums of one segment: host time (s, from its first group) against card time (s)."""

    origin_ns: int
    n: int = 0
    card_mean: float = 0.0
    late_mean: float = 0.0
    card_card: float = 0.0
    card_late: float = 0.0
    late_late: float = 0.0

    def add(self, card: float, late: float) -> None:
        """Take a point: seconds by the card, and by how much the host's clock was ahead of it, s."""
        self.n += 1
        card_off, late_off = card - self.card_mean, late - self.late_mean
        self.card_mean += card_off / self.n
        self.late_mean += late_off / self.n
        self.card_card += card_off * (card - self.card_mean)
        self.card_late += card_off * (late - self.late_mean)
        self.late_late += late_off * (late - self.late_mean)


class ClockEstimator:
    """Regression of host time on card time over a run; memory grows with its segments alone.

    Each segment has its own beginning, all have one slope. What the device held when a block was read was taken by then
    as well, so that a late reader does not bend the line.

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
        """Take a block as it was read."""
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
        """Return the clock's error so far; None where the run cannot tell."""
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
    """How samples came from the device.

    Parameters
    ----------
    clock : ClockError or None
        The card's clock against the host's; None where the run cannot tell.
    backlog : float or None
        Most that waited in the device when a block had been read, s of samples; None where nobody knows.
    buffer : float or None
        What the device holds for a late reader, s of samples; None likewise.
    """

    clock: ClockError | None = None
    backlog: float | None = None
    buffer: float | None = None


class DeliveryMonitor:
    """Watches the blocks of a run as they come; memory grows with its segments alone.

    Parameters
    ----------
    acquisition : Acquisition
        What delivers them; without a buffer of known size there is no backlog.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._clock = ClockEstimator(acquisition.rate)
        self._backlog = 0  # samples per channel

    def add_block(self, block: SampleBlock) -> None:
        """Take a block as it was read."""
        self._clock.add_block(block)
        self._backlog = max(self._backlog, block.backlog)

    def statistics(self) -> DeliveryStatistics:
        """Return how they came so far."""
        buffer = self._acquisition.buffer_time
        backlog = None if buffer is None else self._backlog / self._acquisition.rate
        return DeliveryStatistics(self._clock.error(), backlog, buffer)

"""How a run's samples came from the device, beside what they say: the card's clock, and how full its buffer became."""

from dataclasses import dataclass

from analysis.live.clock import ClockError, ClockFit
from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition


@dataclass(frozen=True, slots=True)
class Delivery:
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


class DeliveryWatch:
    """Watches the blocks of a run as they come; memory grows with its segments alone.

    Parameters
    ----------
    acquisition : Acquisition
        What delivers them; without a buffer of known size there is no backlog.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._clock = ClockFit(acquisition.rate)
        self._backlog = 0  # samples per channel

    def block(self, block: SampleBlock) -> None:
        """Take a block as it was read."""
        self._clock.block(block)
        self._backlog = max(self._backlog, block.backlog)

    def delivery(self) -> Delivery:
        """Return how they came so far."""
        buffer = self._acquisition.buffer_time
        backlog = None if buffer is None else self._backlog / self._acquisition.rate
        return Delivery(self._clock.error(), backlog, buffer)

"""What the card's counter stamped, in step with the samples; where it fails, the samples go on without.

Counts of 32 bits that go on for ever: how often the counter has begun again.
"""

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SegmentEnd
from daq.errors import DeviceError, DeviceFault

WRAP = 1 << 32


class Unwrapping:
    """Makes the counts that edges latched, in their order, rise through every wrap.

    From one count to the next the counter has begun again at most once where less than a wrap has passed. After a
    longer silence only the samples know: no edge had come when the counter was last found empty, and so the next lies
    behind that, by less than a wrap.
    """

    def __init__(self) -> None:
        self._least = 0  # that the next count can be, in ticks since the beginning

    def ticks(self, counts: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return the ticks since the counter began for the counts read next."""
        if counts.size == 0:
            return np.empty(0, np.int64)
        steps = np.diff(counts).astype(np.int64)  # modulo 2³²
        first = self._least + (int(counts[0]) - self._least) % WRAP
        ticks = first + np.concatenate([[0], np.cumsum(steps)])
        self._least = int(ticks[-1]) + 1
        return ticks

    def none_before(self, tick: int) -> None:
        """Take note that no count which has not been read was latched before a tick."""
        self._least = max(self._least, tick)


if TYPE_CHECKING:
    from daq.drivers.ni.card import NiCard

LATE = 5.0  # s that a stamp may be under way from the card: more than any, and much less than a wrap


class Stamps:
    """The counter's part of a segment.

    Parameters
    ----------
    card : NiCard
        The card with its counter, if it has one.
    """

    def __init__(self, card: "NiCard") -> None:
        self._card = card
        self._counter = card.acquisition.tacho.counter
        self._ticks_per_sample = card.acquisition.ticks_per_sample
        self._begin()

    def _begin(self) -> None:
        self._unwrapping = Unwrapping()
        self._ahead = np.empty(0, np.int64)  # of samples that have not been read yet
        self._fault = ""

    def start(self, *, again: bool) -> None:
        """Begin a segment; the counter waits for its first sample."""
        self._begin()
        if self._counter is None:
            return
        if again:
            with suppress(DeviceError):  # what is wrong with it is told by its start
                self._card.stop_counter()
        try:
            self._card.start_counter()
        except DeviceError as error:
            self.fail(0, error)

    def upto(self, end: int, backlog: int) -> NDArray[np.int64] | None:
        """Return what was stamped before a sample and not given before, at once; None without a counter that works.

        Parameters
        ----------
        end : int
            One past the last sample that was read.
        backlog : int
            Samples that the card has taken beyond it.
        """
        if self._counter is None or self._fault:
            return None
        try:
            counts, is_empty = self._card.counts()
        except DeviceError as error:
            self.fail(end, error)
            return None
        timebase, here = self._counter.timebase, end * self._ticks_per_sample
        ticks, newest = self._unwrapping.ticks(counts), here + backlog * self._ticks_per_sample
        if ticks.size and ticks[-1] > newest + LATE * timebase:
            counted = f"it counted {ticks[-1] / timebase:.1f} s where the samples are at {newest / timebase:.1f} s"
            self.fail(end, DeviceError(DeviceFault.OTHER, f"{counted}: another clock, or not begun with them"))
            return None
        if is_empty:
            self._unwrapping.none_before(int(here - LATE * timebase))
        known = np.concatenate([self._ahead, ticks])
        given, self._ahead = np.split(known, [np.searchsorted(known, here)])
        return given

    def fail(self, end: int, error: DeviceError) -> None:
        """Do without the counter from a sample on, for the rest of the segment."""
        if self._counter is not None and not self._fault:
            self._fault = f"the tacho's counter {self._counter.counter} gave no stamps from sample {end} on: {error}"

    def told(self, end: SegmentEnd) -> SegmentEnd:
        """Return the segment's end with what is to be said of the counter."""
        return replace(end, detail="; ".join(filter(None, (end.detail, self._fault))))

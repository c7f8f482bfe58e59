"""The counter's stamps of the tacho edges, matched to the samples; a counter fault does not stop the samples."""

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SegmentEnd
from daq.errors import DeviceError, DeviceFault

if TYPE_CHECKING:
    from daq.drivers.ni.card import NiCard

MAX_TIMESTAMP_DELAY = 5.0  # s from the edge to the program: longer than any real delay, much shorter than a wrap


class CounterUnwrapper:
    """Extends latched counts to 64 bits.

    Between two counts less than a wrap apart, the counter wraps at most once. After a longer pause the counts alone are
    ambiguous. Then the samples decide: the counter was empty when it was last read, so the next edge came later than
    that, by less than a wrap.

    Parameters
    ----------
    wrap : int
        Number of ticks after which the card's count starts again from 0.
    """

    def __init__(self, wrap: int) -> None:
        self._wrap = wrap
        self._minimum = 0  # of the next count, in ticks since the counter started

    def ticks(self, counts: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return the ticks since the counter started, for the counts read next."""
        if counts.size == 0:
            return np.empty(0, np.int64)
        steps = np.mod(np.diff(counts.astype(np.int64)), self._wrap)
        first = self._minimum + (int(counts[0]) - self._minimum) % self._wrap
        ticks = first + np.concatenate([[0], np.cumsum(steps)])
        self._minimum = int(ticks[-1]) + 1
        return ticks

    def no_edge_before(self, tick: int) -> None:
        """Set the tick before which no unread edge can lie."""
        self._minimum = max(self._minimum, tick)


class CounterStamps:
    """The counter's stamps in one segment.

    Parameters
    ----------
    card : NiCard
        The card, with or without a counter.
    """

    def __init__(self, card: "NiCard") -> None:
        self._card = card
        self._counter = card.acquisition.tacho.counter
        self._ticks_per_sample = card.acquisition.ticks_per_sample
        self._reset()

    def _reset(self) -> None:
        self._unwrapper = CounterUnwrapper(self._card.counter_wrap)
        self._ahead = np.empty(0, np.int64)  # stamps of samples that have not been read yet
        self._fault = ""

    def start(self, *, again: bool) -> None:
        """Begin a segment: start the counter, which then waits for the first sample."""
        self._reset()
        if self._counter is None:
            return
        if again:
            with suppress(DeviceError):  # starting it reports the same error
                self._card.stop_counter()
        try:
            self._card.start_counter()
        except DeviceError as error:
            self.fail(0, error)

    def take_until(self, end: int, backlog: int) -> NDArray[np.int64] | None:
        """Return the new stamps up to a sample, without waiting; None without a working counter.

        Parameters
        ----------
        end : int
            One past the last sample that was read.
        backlog : int
            Number of samples that the card has acquired after it.
        """
        if self._counter is None or self._fault:
            return None
        try:
            counts, is_empty = self._card.counts()
        except DeviceError as error:
            self.fail(end, error)
            return None
        timebase, here = self._counter.timebase, end * self._ticks_per_sample
        ticks, newest = self._unwrapper.ticks(counts), here + backlog * self._ticks_per_sample
        if ticks.size and ticks[-1] > newest + MAX_TIMESTAMP_DELAY * timebase:
            counted = f"it counted {ticks[-1] / timebase:.1f} s, but the samples are at {newest / timebase:.1f} s"
            reason = "it uses another clock or did not start with them"
            self.fail(end, DeviceError(DeviceFault.OTHER, f"{counted}: {reason}"))
            return None
        if is_empty:
            self._unwrapper.no_edge_before(int(here - MAX_TIMESTAMP_DELAY * timebase))
        known = np.concatenate([self._ahead, ticks])
        taken, self._ahead = np.split(known, [np.searchsorted(known, here)])
        return taken

    def fail(self, end: int, error: DeviceError) -> None:
        """Stop using the counter for the rest of the segment, from a sample on."""
        if self._counter is not None and not self._fault:
            self._fault = f"the tacho's counter {self._counter.counter} gave no stamps from sample {end} on: {error}"

    def with_fault(self, end: SegmentEnd) -> SegmentEnd:
        """Return the segment's end with a fault of the counter added to its detail."""
        return replace(end, detail="; ".join(filter(None, (end.detail, self._fault))))

"""Whether what a counter stamped follows as a recording's must, and belongs to the samples beside it."""

from collections.abc import Iterator

import numpy as np

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition
from recordings.integrity.findings import Check, Finding
from recordings.mcap.messages import parsed
from recordings.mcap.schema import rig_pb2


class PulseCheck:
    """Takes the stamps and blocks of a file in their order and says where they do not fit.

    Parameters
    ----------
    acquisition : Acquisition
        What the header says of the counter.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._acquisition = acquisition
        self._segment, self._next, self._last = -1, 0, -1
        self._waiting: tuple[int, int] | None = None  # place of the block whose stamps have come
        self.stamps = 0
        """Stamps in all messages."""

    def pulses(self, data: bytes, where: str) -> Iterator[Finding]:
        """Take the next message of stamps and yield what is wrong with it; ValueError where the bytes are none."""
        message = parsed(rig_pb2.Pulses(), data)
        place, ticks = f"{where}, segment {message.segment}", np.array(message.ticks, dtype=np.int64)
        self.stamps += ticks.size
        if self._acquisition.tacho.counter is None:
            yield Finding(Check.CONTINUITY, place, "stamps of a counter, and none in the header")
        if message.segment != self._segment:
            self._segment, self._next, self._last = message.segment, 0, -1
        if message.first_pulse != self._next:
            what = f"stamps from number {message.first_pulse} on, expected number {self._next}"
            yield Finding(Check.CONTINUITY, place, what)
        if (np.diff(ticks, prepend=self._last) <= 0).any():
            yield Finding(Check.CONTINUITY, place, f"stamps from number {message.first_pulse} on do not rise")
        if ticks.size:
            self._last = int(ticks[-1])
        self._next = message.first_pulse + ticks.size
        if message.has_failed:
            what = f"the tacho's counter failed after {self._next} stamps, before sample {message.first_sample}"
            yield Finding(Check.CONTINUITY, place, what, is_fault=False)
        self._waiting = (message.segment, message.first_sample)

    def block(self, block: SampleBlock, where: str) -> Iterator[Finding]:
        """Take the next block and yield what is wrong with the stamps that came before it."""
        if self._waiting is None:
            return
        place, self._waiting = self._waiting, None
        if place != (block.segment, block.first_sample):
            what = f"stamps of the block from sample {place[1]} of segment {place[0]}, which does not follow"
            yield Finding(Check.CONTINUITY, where, what)
        elif self._last >= block.end * self._acquisition.ticks_per_sample + 1:
            what = f"a stamp of {self._last} ticks lies behind sample {block.end - 1}, the last that it came with"
            yield Finding(Check.CONTINUITY, where, what)

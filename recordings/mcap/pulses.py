"""What a counter stamped of the tacho's edges: messages of their own beside the blocks that they were read with."""

from dataclasses import replace

import numpy as np

from analysis.signals.blocks import SampleBlock
from analysis.signals.header import Acquisition
from recordings.mcap.messages import parse_message
from recordings.mcap.schema import rig_pb2


class PulseEncoder:
    """Makes the messages of a run's stamps, numbering them through each segment.

    Parameters
    ----------
    acquisition : Acquisition
        Whether a counter stamps.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._has_counter = acquisition.tacho.counter is not None
        self._segment = -1
        self._next, self._has_failed = 0, False
        self.told = 0
        """Stamps in all messages."""

    def message(self, block: SampleBlock) -> bytes | None:
        """Return the message that goes in front of a block's; None where there is nothing to say."""
        if block.segment != self._segment:
            self._segment, self._next, self._has_failed = block.segment, 0, False
        if not self._has_counter or self._has_failed:
            return None
        if block.ticks is None:
            self._has_failed = True
        elif block.ticks.size == 0:
            return None
        ticks = [] if block.ticks is None else block.ticks.tolist()
        message = rig_pb2.Pulses(
            segment=block.segment,
            first_sample=block.first_sample,
            first_pulse=self._next,
            ticks=ticks,
            has_failed=self._has_failed,
        )
        self._next += len(ticks)
        self.told += len(ticks)
        return message.SerializeToString()


class PulseMerger:
    """Gives the blocks of a file their stamps back.

    Parameters
    ----------
    acquisition : Acquisition
        Whether a counter stamped.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._has_counter = acquisition.tacho.counter is not None
        self._waiting: dict[tuple[int, int], rig_pb2.Pulses] = {}
        self._failed_in = -1

    def pulses(self, data: bytes) -> None:
        """Take a message of stamps; ValueError where the bytes are none."""
        message = parse_message(rig_pb2.Pulses(), data)
        self._waiting[message.segment, message.first_sample] = message

    def block(self, block: SampleBlock) -> SampleBlock:
        """Return a block with what was stamped of it, whose message has come before it."""
        if not self._has_counter:
            return block
        place = (block.segment, block.first_sample)
        message = self._waiting.get(place)
        self._waiting = {key: told for key, told in self._waiting.items() if key > place}  # the rest was damaged
        if message is not None and message.has_failed:
            self._failed_in = block.segment
        if block.segment == self._failed_in:
            return block
        ticks = np.array([] if message is None else message.ticks, dtype=np.int64)
        return replace(block, ticks=ticks)

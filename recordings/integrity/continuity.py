"""Whether the blocks and segment ends of a file follow one another as a recording's must, and how many there are."""

from collections.abc import Iterator

import numpy as np

from analysis.signals.blocks import SampleBlock, SegmentEnd
from analysis.signals.header import CODE_MAX, CODE_MIN, Acquisition
from recordings.integrity.checks import Check, Finding


class Continuity:
    """Takes the blocks and ends of a file in their order and says where they do not follow.

    Parameters
    ----------
    acquisition : Acquisition
        What the header says of the samples.
    """

    def __init__(self, acquisition: Acquisition) -> None:
        self._channels = acquisition.channels
        self._segment, self._next_sample = 0, 0
        self._is_open = False
        self._ends: list[SegmentEnd] = []
        self.samples = 0
        """Samples per channel in all blocks."""
        self._railed = np.zeros(len(self._channels), dtype=np.int64)
        self._uncalibrated = np.zeros(len(self._channels), dtype=np.int64)
        codes = np.arange(2**16, dtype=np.uint16).view(np.int16)
        self._outside = []
        for channel in self._channels:
            calibration, volts = channel.calibration, channel.volts(codes)
            low, high = (-np.inf, np.inf) if calibration is None else (calibration.volts_low, calibration.volts_high)
            self._outside.append((volts < low) | (volts > high))

    @property
    def ends(self) -> tuple[SegmentEnd, ...]:
        """The ends of segments that came."""
        return tuple(self._ends)

    def block(self, block: SampleBlock, where: str) -> Iterator[Finding]:
        """Take the next block and yield what is wrong with it."""
        if block.codes.shape[0] != len(self._channels):
            what = f"a block of {block.codes.shape[0]} channels, expected {len(self._channels)}"
            yield Finding(Check.CONTINUITY, where, what)
            return
        if (block.segment, block.first_sample) != (self._segment, self._next_sample):
            yield Finding(
                Check.CONTINUITY,
                where,
                f"samples from {block.first_sample} of segment {block.segment}, "
                f"expected sample {self._next_sample} of segment {self._segment}",
            )
        self._segment, self._next_sample, self._is_open = block.segment, block.end, True
        self.samples += block.n_samples
        self._railed += np.count_nonzero((block.codes == CODE_MAX) | (block.codes == CODE_MIN), axis=1)
        for row, outside in enumerate(self._outside):
            self._uncalibrated[row] += np.count_nonzero(outside[block.codes[row].view(np.uint16)])

    def segment_end(self, end: SegmentEnd, where: str) -> Iterator[Finding]:
        """Take the next end of a segment and yield what is wrong with it."""
        if (end.segment, end.samples) != (self._segment, self._next_sample):
            yield Finding(
                Check.CONTINUITY,
                where,
                f"segment {end.segment} ends after {end.samples} samples, "
                f"expected the end of segment {self._segment} after {self._next_sample}",
            )
        self._segment, self._next_sample, self._is_open = end.segment + 1, 0, False
        self._ends.append(end)

    def finish(self) -> Iterator[Finding]:
        """Yield what is missing at the end of the file, and what the operator should know of the samples."""
        if self._is_open or not self._ends:
            what = f"segment {self._segment} has no end: the recording breaks off after {self._next_sample} samples"
            yield Finding(Check.CONTINUITY, "end of file", what)
        for end in self._ends:
            if not end.is_gap_free:
                lost = f"{'' if end.lost_is_exact else 'at least '}{end.lost} samples lost"
                what = f"{lost} after sample {end.samples}: {end.reason.value}" + (end.detail and f", {end.detail}")
                yield Finding(Check.CONTINUITY, f"segment {end.segment}", what, is_fault=False)
        for channel, railed, outside in zip(self._channels, self._railed, self._uncalibrated, strict=True):
            if railed:
                what = f"{railed} samples at the converter's rails"
                yield Finding(Check.CALIBRATION, f"channel {channel.name}", what, is_fault=False)
            if outside and channel.calibration is not None:
                low, high = channel.calibration.volts_low, channel.calibration.volts_high
                what = f"{outside / self.samples:.2%} of the samples outside the calibrated {low:g} to {high:g} V"
                yield Finding(Check.CALIBRATION, f"channel {channel.name}", what, is_fault=False)

"""The order that a run's blocks must have, and the honest end of a segment where a file breaks it."""

from collections.abc import Iterator, Mapping

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem

BREAKS_OFF = "the recording breaks off here"


class Sequence:
    """Lets through what follows without a gap; the rest of a segment after damage is left out and counted as lost.

    Parameters
    ----------
    ends : mapping of int to SegmentEnd
        The end of each segment as far as it is known.
    """

    def __init__(self, ends: Mapping[int, SegmentEnd]) -> None:
        self._ends = ends
        self._segment = -1
        self._next_sample = 0
        self._is_open = False
        self._is_broken = False

    def block(self, block: SampleBlock) -> Iterator[SourceItem]:
        """Take the next block of the file and yield what can be passed on."""
        if block.segment < self._segment or (block.segment == self._segment and not self._is_open):
            return
        if block.segment > self._segment:
            yield from self.finish()
            self._segment, self._next_sample = block.segment, 0
            self._is_open, self._is_broken = True, False
        if self._is_broken or block.first_sample != self._next_sample:
            self._is_broken = True
            return
        self._next_sample = block.end
        yield block

    def segment_end(self, end: SegmentEnd) -> Iterator[SourceItem]:
        """Take the next end of a segment in the file and yield what can be passed on."""
        if end.segment < self._segment or (end.segment == self._segment and not self._is_open):
            return
        if end.segment > self._segment:
            yield from self.finish()
            self._segment, self._next_sample = end.segment, 0
        self._is_open = False
        yield self._end(end)

    def finish(self) -> Iterator[SourceItem]:
        """End the segment that is open, if one is: no more of it will come."""
        if self._is_open:
            self._is_open = False
            yield self._end(self._ends.get(self._segment))

    def _end(self, recorded: SegmentEnd | None) -> SegmentEnd:
        if recorded is None:
            return cut_end(self._segment, self._next_sample)
        missing = recorded.samples - self._next_sample
        if missing <= 0:
            return recorded
        return SegmentEnd(
            segment=self._segment,
            samples=self._next_sample,
            reason=EndReason.CUT,
            lost=missing + recorded.lost,
            lost_is_exact=recorded.lost_is_exact,
            detail=f"the recording is damaged after sample {self._next_sample} of {recorded.samples}",
        )


def cut_end(segment: int, samples: int) -> SegmentEnd:
    """Return the end of a segment whose recording breaks off: what came after is not known."""
    return SegmentEnd(segment, samples, EndReason.CUT, lost=0, lost_is_exact=False, detail=BREAKS_OFF)

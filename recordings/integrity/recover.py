"""A whole copy of what is intact in a damaged recording, and exactly what is missing from it."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from recordings.errors import DamagedError, RecordingError
from recordings.mcap.chunk_table import ChunkLocation
from recordings.mcap.container import Container
from recordings.mcap.layout import (
    CHANNEL_IDS,
    END_RECORD,
    MARKER,
    PULSES,
    RECOVERED_RECORD,
    SAMPLES,
    SEGMENT_END,
    decode_metadata,
)
from recordings.mcap.markers import Marker, decode_marker
from recordings.mcap.messages import PulseMerger, decode_block, decode_segment_end
from recordings.mcap.reader import segment_end_from_json
from recordings.mcap.salvage import read_header, search_chunks
from recordings.mcap.writer import write_run


@dataclass(frozen=True, slots=True)
class MissingSamples:
    """Samples that the damaged recording had, or may have had, and its copy lacks.

    Parameters
    ----------
    segment : int
        Segment of the damaged recording.
    first : int
        First sample that is missing.
    stop : int or None
        One past the last; None where nobody knows how far the segment went.
    """

    segment: int
    first: int
    stop: int | None

    @property
    def samples(self) -> int | None:
        """Samples per channel that are missing; None where that is not known."""
        return None if self.stop is None else self.stop - self.first


@dataclass(frozen=True, slots=True)
class RecoveredSegment:
    """Consecutive samples that came through: a segment of the copy.

    Parameters
    ----------
    segment : int
        Segment of the copy.
    from_segment : int
        Segment of the damaged recording.
    first, stop : int
        Its samples there: the first, and one past the last.
    """

    segment: int
    from_segment: int
    first: int
    stop: int


@dataclass(frozen=True, slots=True)
class Recovery:
    """What came of a recovery.

    Parameters
    ----------
    source, target : Path
        The damaged file and its copy.
    damaged_chunks : int
        Chunks that are there but do not match their checksum.
    stretches : tuple of Stretch
        What came through.
    missing : tuple of Missing
        What did not.
    """

    source: Path
    target: Path
    damaged_chunks: int
    stretches: tuple[RecoveredSegment, ...]
    missing: tuple[MissingSamples, ...]

    @property
    def samples(self) -> int:
        """Samples per channel that came through."""
        return sum(stretch.stop - stretch.first for stretch in self.stretches)


def recover(source: Path, target: Path) -> Recovery:
    """Write a whole copy of what is intact in a recording; the recording itself is only read.

    Every sample of every intact chunk is in the copy, where a gap inside a segment divides it in two. The header is the
    recording's, bit for bit; results are computed again from the samples, and the record `rig.recovered` says what is
    missing.

    Parameters
    ----------
    source : Path
        The recording's file.
    target : Path
        File to be created; it must not exist.

    Raises
    ------
    NotFoundError, DamagedError, UnknownFormatError
        Where the source is no recording, or neither a header nor any samples are left of it.
    StorageError
        Where the source cannot be read or the copy cannot be written; then there is none.
    """
    container = Container(source)
    try:
        header = read_header(container)
        salvage = _Salvage(container, header)
        if not any(isinstance(item, SampleBlock) for item in salvage.read()):
            raise DamagedError(f"{source}: nothing to recover: it holds no intact samples")
        told: dict[str, object] = {}
        items = _told(salvage, source, told)
        write_run(target, header, items, {RECOVERED_RECORD: told}, salvage.markers())
        return Recovery(source, target, salvage.damaged, tuple(salvage.stretches), tuple(salvage.missing))
    finally:
        container.close()


def _told(salvage: "_Salvage", source: Path, told: dict[str, object]) -> Iterator[SourceItem]:
    """Pass on what comes through, and at its end tell what did not."""
    yield from salvage.items()
    told |= {
        "source": source.name,
        "damaged_chunks": salvage.damaged,
        "segments": [asdict(stretch) for stretch in salvage.stretches],
        "missing": [asdict(missing) for missing in salvage.missing],
    }


class _Salvage:
    """What is intact in a file, as the items of a new recording."""

    def __init__(self, container: Container, header: RunHeader) -> None:
        self._file = container
        self._n_channels = len(header.acquisition.channels)
        found = {place.offset: place for place in (*container.chunks, *search_chunks(container))}
        self._places = [found[offset] for offset in sorted(found)]
        self._named = {place.offset for place in container.chunks}
        self._known_ends = self._ends()
        self._acquisition = header.acquisition
        self._pulses = PulseMerger(header.acquisition)
        self.damaged = 0
        self.stretches: list[RecoveredSegment] = []
        self.missing: list[MissingSamples] = []
        self._markers: list[Marker] = []
        self._segment = 0  # of the copy
        self._from_segment, self._first, self._next_sample = 0, 0, 0
        self._is_open = True

    def read(self) -> Iterator[SampleBlock | SegmentEnd]:
        """Yield all blocks and ends of segments that can be read, in the order of the file."""
        self.damaged = 0
        self._markers = []
        self._pulses = PulseMerger(self._acquisition)
        for place in self._places:
            yield from self._chunk(place)

    def markers(self) -> Iterator[Marker]:
        """Yield the markers where they lie in the copy, once all items have come; one in a hole is at its beginning."""
        for marker in self._markers:
            before = [
                stretch
                for stretch in self.stretches
                if (stretch.from_segment, stretch.first) <= (marker.segment, marker.sample)
            ]
            if before:
                stretch = before[-1]
                same = stretch.from_segment == marker.segment
                sample = min(marker.sample, stretch.stop) - stretch.first if same else stretch.stop - stretch.first
                yield replace(marker, segment=stretch.segment, sample=sample)

    def items(self) -> Iterator[SourceItem]:
        """Yield what is intact as segments without a gap, each with its end."""
        for item in self.read():
            if isinstance(item, SampleBlock):
                yield from self._block(item)
            elif (item.segment, self._is_open) == (self._from_segment, True) or item.segment > self._from_segment:
                yield from self._go_to(item.segment)
                yield from self._end(item)
        if self._is_open:
            yield from self._end(self._known_ends.get(self._from_segment))
        for segment in sorted(self._known_ends):
            if segment > self._from_segment and self._known_ends[segment].samples:
                self.missing.append(MissingSamples(segment, 0, self._known_ends[segment].samples))

    def _block(self, block: SampleBlock) -> Iterator[SourceItem]:
        is_past = block.segment == self._from_segment and (block.first_sample < self._next_sample or not self._is_open)
        if block.segment < self._from_segment or is_past or block.codes.shape[0] != self._n_channels:
            return  # a record that stands in the file twice
        yield from self._go_to(block.segment)
        if block.first_sample > self._next_sample:
            self.missing.append(MissingSamples(self._from_segment, self._next_sample, block.first_sample))
            yield self._close(
                EndReason.CUT, block.first_sample - self._next_sample, detail="the recording is damaged here"
            )
            self._first = self._next_sample = block.first_sample
        first = self._next_sample - self._first
        self._next_sample = block.end
        yield block.relocated(self._segment, first, self._acquisition.ticks_per_sample)

    def _go_to(self, segment: int) -> Iterator[SourceItem]:
        """End the segments before this one."""
        while self._from_segment < segment:
            if self._is_open:
                yield from self._end(self._known_ends.get(self._from_segment))
            self._from_segment += 1
            self._first = self._next_sample = 0
            self._is_open = True

    def _end(self, end: SegmentEnd | None) -> Iterator[SourceItem]:
        """End the segment as recorded, as far as that is known."""
        self._is_open = False
        if end is None:
            self.missing.append(MissingSamples(self._from_segment, self._next_sample, None))
            yield self._close(EndReason.CUT, 0, lost_is_exact=False, detail="the recording breaks off here")
        elif end.samples > self._next_sample:
            self.missing.append(MissingSamples(self._from_segment, self._next_sample, end.samples))
            lost = end.samples - self._next_sample + end.lost
            detail = f"the recording is damaged up to the end of the segment: {end.reason.value}"
            yield self._close(EndReason.CUT, lost, lost_is_exact=end.lost_is_exact, detail=detail)
        else:
            yield self._close(end.reason, end.lost, lost_is_exact=end.lost_is_exact, detail=end.detail)

    def _close(self, reason: EndReason, lost: int, *, lost_is_exact: bool = True, detail: str) -> SegmentEnd:
        """Return the end of the copy's segment."""
        samples = self._next_sample - self._first
        self.stretches.append(RecoveredSegment(self._segment, self._from_segment, self._first, self._next_sample))
        self._segment += 1
        return SegmentEnd(self._segment - 1, samples, reason, lost, lost_is_exact, detail)

    def _chunk(self, place: ChunkLocation) -> Iterator[SampleBlock | SegmentEnd]:
        try:
            messages = list(self._file.messages(place))
        except DamagedError:
            self.damaged += place.offset in self._named  # what only looked like a chunk does not count
            return
        for message in messages:
            try:
                if message.channel == CHANNEL_IDS[SAMPLES]:
                    yield self._pulses.merge(decode_block(message.data))
                elif message.channel == CHANNEL_IDS[PULSES]:
                    self._pulses.add_pulses(message.data)
                elif message.channel == CHANNEL_IDS[SEGMENT_END]:
                    yield decode_segment_end(message.data)
                elif message.channel == CHANNEL_IDS[MARKER]:
                    self._markers.append(decode_marker(message.data))
            except ValueError:  # intact, but no message of ours
                continue

    def _ends(self) -> dict[int, SegmentEnd]:
        """Return how the segments ended, as far as the file still tells."""
        for entries in self._file.metadata(END_RECORD):
            try:
                document = decode_metadata(self._file.path, END_RECORD, entries)
            except RecordingError:
                continue
            return {end["segment"]: segment_end_from_json(end) for end in document["segments"]}
        return {}

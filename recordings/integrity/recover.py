"""Recovery: a complete copy of the intact samples of a damaged recording, and a list of the missing ones."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.units import NUMBER
from recordings.errors import DamagedError, MessageError, RecordingError
from recordings.mcap.container import ChunkLocation, Container
from recordings.mcap.layout import (
    CHANNEL_IDS,
    END_RECORD,
    MARKER,
    RECOVERED_RECORD,
    decode_metadata,
)
from recordings.mcap.messages import ItemDecoder
from recordings.mcap.reader import segment_end_from_json
from recordings.mcap.results import Marker, decode_marker
from recordings.mcap.salvage import read_header, search_chunks
from recordings.mcap.writer import write_run


@dataclass(frozen=True, slots=True)
class MissingSamples:
    """Samples of the damaged recording, known or possible, that the copy lacks."""

    segment: Annotated[int, NUMBER.of("Segment of the damaged recording")]
    first: Annotated[int, NUMBER.of("First missing sample", "first_sample")]
    stop: Annotated[
        int | None, NUMBER.of("One past the last; unknown where the length of the segment is", "stop_sample")
    ]

    @property
    def samples(self) -> Annotated[int | None, NUMBER.of("Missing samples per channel; unknown likewise")]:
        """Missing samples per channel; None if unknown."""
        return None if self.stop is None else self.stop - self.first


@dataclass(frozen=True, slots=True)
class RecoveredSegment:
    """A segment of the copy: consecutive samples that were recovered."""

    segment: Annotated[int, NUMBER.of("Segment of the copy")]
    from_segment: Annotated[int, NUMBER.of("Segment of the damaged recording")]
    first: Annotated[int, NUMBER.of("First of its samples there", "first_sample")]
    stop: Annotated[int, NUMBER.of("One past the last", "stop_sample")]


@dataclass(frozen=True, slots=True)
class Recovery:
    """Result of a recovery."""

    source: Annotated[Path, NUMBER.of("The damaged file")]
    target: Annotated[Path, NUMBER.of("Its copy")]
    damaged_chunks: Annotated[int, NUMBER.of("Chunks that do not match their checksum")]
    segments: Annotated[tuple[RecoveredSegment, ...], NUMBER.of("Segments of the copy")]
    missing: Annotated[tuple[MissingSamples, ...], NUMBER.of("Samples that the copy lacks")]

    @property
    def samples(self) -> Annotated[int, NUMBER.of("Recovered samples per channel")]:
        """Recovered samples per channel."""
        return sum(segment.stop - segment.first for segment in self.segments)


def recover(source: Path, target: Path) -> Recovery:
    """Write a complete copy of the intact samples of a recording, which is only read.

    The copy has every sample of every intact chunk; a gap inside a segment divides it in two. The header is identical,
    results are computed again from the samples, and the record `rig.recovered` lists what is missing.

    Parameters
    ----------
    source : Path
        The recording.
    target : Path
        File to create; it must not exist.

    Raises
    ------
    NotFoundError, DamagedError, UnknownFormatError
        If the source is no recording, or has no intact header or no intact samples.
    StorageError
        If the source cannot be read or the copy cannot be written; no copy is left then.
    """
    container = Container(source)
    try:
        header = read_header(container)
        salvage = _Salvage(container, header)
        if not any(isinstance(item, SampleBlock) for item in salvage.read()):
            raise DamagedError(f"{source}: nothing to recover: it has no intact samples")
        record: dict[str, object] = {}
        items = _with_record(salvage, source, record)
        write_run(target, header, items, {RECOVERED_RECORD: record}, salvage.markers())
        return Recovery(source, target, salvage.damaged, tuple(salvage.segments), tuple(salvage.missing))
    finally:
        container.close()


def _with_record(salvage: "_Salvage", source: Path, record: dict[str, object]) -> Iterator[SourceItem]:
    """Yield the items of the copy, and fill in the record of the recovery after the last."""
    yield from salvage.items()
    record |= {
        "source": source.name,
        "damaged_chunks": salvage.damaged,
        "segments": [asdict(segment) for segment in salvage.segments],
        "missing": [asdict(missing) for missing in salvage.missing],
    }


class _Salvage:
    """Reader of the intact content of a file, as the items of a new recording.

    Positions are tracked in both files: `_segment` counts segments of the copy; `_from_segment`, `_first` and
    `_next_sample` are segment, first sample of the current stretch and next sample in the damaged recording.
    """

    def __init__(self, container: Container, header: RunHeader) -> None:
        self._file = container
        chunks = {chunk.offset: chunk for chunk in (*container.chunks, *search_chunks(container))}
        self._chunks = [chunks[offset] for offset in sorted(chunks)]
        self._indexed = {chunk.offset for chunk in container.chunks}
        self._known_ends = self._ends()
        self._acquisition = header.acquisition
        self._decoder = ItemDecoder(header.acquisition)
        self.damaged = 0
        self.segments: list[RecoveredSegment] = []
        self.missing: list[MissingSamples] = []
        self._markers: list[Marker] = []
        self._segment = 0
        self._from_segment, self._first, self._next_sample = 0, 0, 0
        self._is_open = True

    def read(self) -> Iterator[SampleBlock | SegmentEnd]:
        """Yield all readable blocks and segment ends, in file order."""
        self.damaged = 0
        self._markers = []
        self._decoder = ItemDecoder(self._acquisition)
        for chunk in self._chunks:
            yield from self._items_of(chunk)

    def markers(self) -> Iterator[Marker]:
        """Yield the markers with their position in the copy, after the last item; one in a gap goes to its start."""
        for marker in self._markers:
            before = [
                segment
                for segment in self.segments
                if (segment.from_segment, segment.first) <= (marker.segment, marker.sample)
            ]
            if before:
                last = before[-1]
                stop = min(marker.sample, last.stop) if last.from_segment == marker.segment else last.stop
                yield replace(marker, segment=last.segment, sample=stop - last.first)

    def items(self) -> Iterator[SourceItem]:
        """Yield the intact samples as gap-free segments, each with its end."""
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
        if block.segment < self._from_segment or is_past:
            return  # a record that is in the file twice
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
        """End the segments before a segment of the damaged recording."""
        while self._from_segment < segment:
            if self._is_open:
                yield from self._end(self._known_ends.get(self._from_segment))
            self._from_segment += 1
            self._first = self._next_sample = 0
            self._is_open = True

    def _end(self, end: SegmentEnd | None) -> Iterator[SourceItem]:
        """End the current segment as recorded, or as cut if samples are missing at its end."""
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
        """Return the end of the copy's current segment, and begin the next."""
        samples = self._next_sample - self._first
        self.segments.append(RecoveredSegment(self._segment, self._from_segment, self._first, self._next_sample))
        self._segment += 1
        return SegmentEnd(self._segment - 1, samples, reason, lost, lost_is_exact, detail)

    def _items_of(self, chunk: ChunkLocation) -> Iterator[SampleBlock | SegmentEnd]:
        try:
            messages = list(self._file.messages(chunk))
        except DamagedError:
            self.damaged += chunk.offset in self._indexed  # what only looked like a chunk does not count
            return
        for message in messages:
            with suppress(MessageError):  # intact, but written by another program or with another header
                if message.channel == CHANNEL_IDS[MARKER]:
                    self._markers.append(decode_marker(message.data))
                elif (item := self._decoder.decode(message.channel, message.data)) is not None:
                    yield item

    def _ends(self) -> dict[int, SegmentEnd]:
        """Return the segment ends in the end record; empty if there is no intact one."""
        for entries in self._file.metadata(END_RECORD):
            try:
                record = decode_metadata(self._file.path, END_RECORD, entries)
            except RecordingError:
                continue
            return {end["segment"]: segment_end_from_json(end) for end in record["segments"]}
        return {}

"""Reading run files, finished or truncated: header, samples, pulses, markers and recorded results."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import ClockError, DeliveryStatistics, EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import PPM
from recordings.errors import DamagedError, MessageError
from recordings.mcap import rig_pb2
from recordings.mcap.container import ChunkLocation, Container, StoredMessage
from recordings.mcap.layout import (
    CHANNEL_IDS,
    END_RECORD,
    FEATURES,
    MARKER,
    NANOSECONDS,
    ORDER_FRAME,
    PULSES,
    SAMPLES,
    SEGMENT_END,
    decode_metadata,
    sample_time_ns,
)
from recordings.mcap.messages import ItemDecoder, block_span, decode_segment_end, parse_message
from recordings.mcap.results import Marker, decode_marker, decode_snapshot
from recordings.mcap.salvage import SequenceFilter, cut_end, read_header

SAMPLE_CHANNEL = frozenset({CHANNEL_IDS[SAMPLES]})
END_CHANNEL = frozenset({CHANNEL_IDS[SEGMENT_END]})
PULSE_CHANNEL = frozenset({CHANNEL_IDS[PULSES]})
MAX_PULSE_DELAY = 1.0  # s by which a pulse may be read later than the sample at its time
MARKER_CHANNEL = frozenset({CHANNEL_IDS[MARKER]})
MARKERS_LEAD_NS = 2 * NANOSECONDS  # by which a marker may precede the results in its chunk
RESULT_CHANNELS = frozenset({CHANNEL_IDS[FEATURES], CHANNEL_IDS[ORDER_FRAME]})


class RunReader:
    """A recorded run, safe for several threads (each iterator for one).

    A truncated file (its writer killed, the disk full, still being written) is read as far as it goes; its last
    segment then ends with `EndReason.CUT`.

    Parameters
    ----------
    path : Path
        The file.

    Attributes
    ----------
    header : RunHeader
        The run's header.
    segment_ends : tuple of SegmentEnd
        End of each segment, in order.
    is_complete : bool
        Whether the run was finished properly: every segment has its end, and the file its own.
    skipped_samples : int
        Samples per channel that the live analysis skipped: their results are missing, the samples are not.
    delivery : DeliveryStatistics
        Statistics of the transfer from the device; empty if the run was not finished.

    Raises
    ------
    NotFoundError
        If there is no such file.
    DamagedError
        If it is empty, not MCAP, or ends before the first samples.
    UnknownFormatError
        If it is no run, or of a format version that this program does not read.
    StorageError
        If it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._container = Container(path)
        try:
            self.header = read_header(self._container)
            self._read_ends()
        except BaseException:
            self._container.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def n_samples(self) -> int:
        """Samples per channel in all segments."""
        return sum(end.samples for end in self.segment_ends)

    @property
    def duration(self) -> float:
        """Sample time of all segments, s."""
        return self.n_samples / self.header.acquisition.rate

    @property
    def is_gap_free(self) -> bool:
        """Whether the run was finished properly and is one segment without a loss."""
        return self.is_complete and len(self.segment_ends) == 1 and self.segment_ends[0].is_gap_free

    def segment_started_ns(self, segment: int) -> int:
        """Return the start of a segment by sample time, ns since 1970; ValueError if there is no such segment."""
        if segment not in self._starts_ns:
            raise ValueError(f"segment: {segment}, expected one of {sorted(self._starts_ns)}")
        return self._starts_ns[segment]

    def items(self) -> Iterator[SourceItem]:
        """Yield the recorded blocks, each segment followed by its end.

        After damage, the rest of the segment is left out and its end counts it as lost.
        """
        sequence = SequenceFilter({end.segment: end for end in self.segment_ends})
        decoder = ItemDecoder(self.header.acquisition)
        for message in self._messages(SAMPLE_CHANNEL | END_CHANNEL | PULSE_CHANNEL):
            with suppress(MessageError):  # an invalid message counts as lost
                item = decoder.decode(message.channel, message.data)
                if item is not None:
                    yield from sequence.add(item)
        yield from sequence.finish()

    def samples(self, segment: int, first: int, stop: int) -> NDArray[np.int16]:
        """Return the codes of part of a segment.

        Parameters
        ----------
        segment : int
            The segment.
        first, stop : int
            First sample, and one past the last, as indices in the segment.

        Returns
        -------
        ndarray of int16, shape (n_channels, stop - first)
            Converter codes.

        Raises
        ------
        ValueError
            If the segment has no such samples.
        DamagedError
            If the file is damaged there.
        """
        ends = {end.segment: end for end in self.segment_ends}
        if segment not in ends:
            raise ValueError(f"segment: {segment}, expected one of {sorted(ends)}")
        if not 0 <= first <= stop <= ends[segment].samples:
            raise ValueError(f"samples: {first} to {stop}, expected within 0 to {ends[segment].samples}")
        codes = np.empty((len(self.header.acquisition.channels), stop - first), dtype=np.int16)
        filled = first
        for block in self._blocks_from(segment, first):
            if block.first_sample > filled or filled >= stop:
                break
            end = min(block.end, stop)
            codes[:, filled - first : end - first] = block.codes[
                :, filled - block.first_sample : end - block.first_sample
            ]
            filled = end
        if filled < stop:
            raise DamagedError(f"{self.path}: segment {segment} is damaged after sample {filled}")
        return codes

    def ticks(self, segment: int, first: int, stop: int) -> NDArray[np.int64]:
        """Return the times of the tacho's edges in part of a segment, from the card's counter.

        Parameters
        ----------
        segment, first, stop : int
            As in `samples`.

        Returns
        -------
        ndarray of int64, shape (n_pulses,)
            Ticks of the counter's timebase since the segment's first sample, increasing; pulses in damaged chunks are
            missing.
        """
        acquisition = self.header.acquisition
        parts = [np.empty(0, np.int64)]
        if segment in self._starts_ns:
            time_ns = self._starts_ns[segment] + sample_time_ns(first, acquisition.rate)
            first_chunk = self._container.chunks.last_before(PULSE_CHANNEL, time_ns)
            for message in self._messages(PULSE_CHANNEL, first_chunk):
                with suppress(MessageError):
                    pulses = parse_message(rig_pb2.Pulses(), message.data)
                    if (pulses.segment, pulses.first_sample) >= (segment, stop + MAX_PULSE_DELAY * acquisition.rate):
                        break
                    if pulses.segment == segment:
                        parts.append(np.array(pulses.ticks, dtype=np.int64))
        ticks = np.concatenate(parts)
        low, high = first * acquisition.ticks_per_sample, stop * acquisition.ticks_per_sample
        return ticks[(ticks >= low) & (ticks < high)]

    def markers(self) -> tuple[Marker, ...]:
        """Return the markers in time order; those in damaged chunks are missing."""
        markers = []
        for message in self._messages(MARKER_CHANNEL):
            with suppress(MessageError):
                markers.append(decode_marker(message.data))
        return tuple(sorted(markers, key=lambda marker: (marker.segment, marker.sample)))

    def snapshots(self, first_chunk: int = 0) -> Iterator[Snapshot]:
        """Yield the recorded snapshots, from a chunk on, with an empty trace; those in damaged chunks are missing."""
        frame: rig_pb2.OrderFrame | None = None
        for message in self._messages(RESULT_CHANNELS, first_chunk):
            with suppress(MessageError):  # a result that cannot be read can be computed again
                if message.channel == CHANNEL_IDS[ORDER_FRAME]:
                    frame = parse_message(rig_pb2.OrderFrame(), message.data)
                else:
                    features = parse_message(rig_pb2.Features(), message.data)
                    belongs = frame is not None and (frame.segment, frame.sample) == (features.segment, features.sample)
                    yield decode_snapshot(features, frame if belongs else None)

    def snapshot(self, segment: int, sample: int) -> Snapshot | None:
        """Return the recorded snapshot at a sample, without reading those before; None if there is none.

        Parameters
        ----------
        segment, sample : int
            As in the snapshot itself.
        """
        if segment not in self._starts_ns:
            return None
        time_ns = self._starts_ns[segment] + sample_time_ns(sample, self.header.acquisition.rate)
        first = self._container.chunks.last_before(RESULT_CHANNELS, time_ns - MARKERS_LEAD_NS)
        for snapshot in self.snapshots(first):
            if (snapshot.segment, snapshot.sample) == (segment, sample):
                return snapshot
            if (snapshot.segment, snapshot.sample) > (segment, sample):
                break
        return None

    def close(self) -> None:
        """Close the file; no effect if closed already."""
        self._container.close()

    def _read_ends(self) -> None:
        record = self._end_record()
        self.is_complete = bool(record.get("complete", False))
        self.skipped_samples = int(record.get("skipped_samples", 0))
        self.delivery = DeliveryStatistics(
            _clock_error(record), record.get("largest_backlog_s"), self.header.acquisition.buffer_time
        )
        if self.is_complete:
            self.segment_ends = tuple(segment_end_from_json(end) for end in record["segments"])
        else:
            self.segment_ends = self._found_ends()
        self._starts_ns: dict[int, int] = {}
        start_ns = self.header.started_ns
        for end in self.segment_ends:
            self._starts_ns[end.segment] = start_ns
            start_ns += sample_time_ns(end.samples + end.lost, self.header.acquisition.rate)

    def _end_record(self) -> dict[str, Any]:
        """Return the end record; empty if the run was not finished or the record is damaged."""
        entries = self._container.metadata(END_RECORD)
        if not entries or not self._container.is_finished:
            return {}
        try:
            return decode_metadata(self.path, END_RECORD, entries[-1])
        except DamagedError:
            return {}

    def _found_ends(self) -> tuple[SegmentEnd, ...]:
        """Return the segment ends of a file that was not finished, from its messages."""
        ends = {}
        for message in self._messages(END_CHANNEL):
            with suppress(MessageError):
                end = decode_segment_end(message.data)
                ends[end.segment] = end
        for chunk in reversed(self._container.chunks):
            span = None
            with suppress(MessageError):
                for message in self._messages_of(chunk, SAMPLE_CHANNEL):
                    span = block_span(message.data)
            if span is not None:
                ends.setdefault(span[0], cut_end(*span))
                break
        if not ends:
            raise DamagedError(f"{self.path}: truncated or damaged: it ends before the first samples")
        return tuple(ends[segment] for segment in sorted(ends))

    def _messages(self, channels: frozenset[int], first_chunk: int = 0) -> Iterator[StoredMessage]:
        """Yield the messages of these channels, from a chunk on."""
        for chunk in self._container.chunks.starting_at(first_chunk):
            yield from self._messages_of(chunk, channels)

    def _messages_of(self, chunk: ChunkLocation, channels: frozenset[int]) -> Iterator[StoredMessage]:
        """Yield the messages of these channels in a chunk; none if it is damaged, which the callers notice."""
        if chunk.may_contain(channels):
            with suppress(DamagedError):
                yield from (message for message in self._container.messages(chunk) if message.channel in channels)

    def _blocks_from(self, segment: int, sample: int) -> Iterator[SampleBlock]:
        """Yield the blocks of a segment, from the one with this sample on."""
        time_ns = self._starts_ns[segment] + sample_time_ns(sample, self.header.acquisition.rate)
        first_chunk = self._container.chunks.last_before(SAMPLE_CHANNEL, time_ns)
        decoder = ItemDecoder(self.header.acquisition)
        for message in self._messages(SAMPLE_CHANNEL, first_chunk):
            with suppress(MessageError):
                block = decoder.decode(message.channel, message.data)
                if isinstance(block, SampleBlock) and (block.segment, block.end) > (segment, sample):
                    if block.segment > segment:
                        return
                    yield block


def segment_end_from_json(values: dict[str, Any]) -> SegmentEnd:
    """Return a segment end from an entry of the end record."""
    return SegmentEnd(**(values | {"reason": EndReason(values["reason"])}))


def _clock_error(record: dict[str, Any]) -> ClockError | None:
    error, uncertainty = record.get("clock_error_ppm"), record.get("clock_uncertainty_ppm")
    return None if error is None or uncertainty is None else ClockError(error * PPM, uncertainty * PPM)

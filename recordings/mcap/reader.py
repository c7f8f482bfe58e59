"""Reading a run's file, finished or cut short."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from analysis.live.delivery import PPM, ClockError, DeliveryStatistics
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import DamagedError
from recordings.mcap.chunk_table import ChunkLocation
from recordings.mcap.container import Container, StoredMessage
from recordings.mcap.layout import (
    CHANNEL_IDS,
    END_RECORD,
    FEATURES,
    MARK,
    NANOSECONDS,
    ORDER_FRAME,
    PULSES,
    SAMPLES,
    SEGMENT_END,
    Sequence,
    cut_end,
    decode_metadata,
    sample_time_ns,
)
from recordings.mcap.markers import Marker, decode_marker
from recordings.mcap.messages import block_span, decode_block, decode_segment_end, parse_message
from recordings.mcap.pulses import PulseMerger
from recordings.mcap.results import decode_snapshot
from recordings.mcap.salvage import read_header
from recordings.mcap.schema import rig_pb2

SAMPLE_CHANNEL = frozenset({CHANNEL_IDS[SAMPLES]})
END_CHANNEL = frozenset({CHANNEL_IDS[SEGMENT_END]})
PULSE_CHANNEL = frozenset({CHANNEL_IDS[PULSES]})
LATEST = 1.0  # s by which a stamp may come later than the sample that it belongs to
MARKER_CHANNEL = frozenset({CHANNEL_IDS[MARK]})
MARKERS_LEAD_NS = 2 * NANOSECONDS  # by which a marker may be earlier than the results that share its chunk
RESULT_CHANNELS = frozenset({CHANNEL_IDS[FEATURES], CHANNEL_IDS[ORDER_FRAME]})


class RunReader:
    """A recorded run. It may be used from several threads; each iterator by one.

    A file that was cut short (its writer killed, the disk full, still being written) opens as far as it goes: its last
    segment then ends with `EndReason.CUT`.

    Parameters
    ----------
    path : Path
        The file.

    Raises
    ------
    NotFoundError
        Where there is no such file.
    DamagedError
        Where it is empty, not MCAP, or cut before the first samples.
    UnknownFormatError
        Where it is no run or of a format version that is not known here.
    StorageError
        Where it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._container = Container(path)
        try:
            self.header: RunHeader = self._read_header()
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
    def segment_ends(self) -> tuple[SegmentEnd, ...]:
        """How each segment ended, in order."""
        return self._ends

    @property
    def n_samples(self) -> int:
        """Samples per channel in all segments."""
        return sum(end.samples for end in self._ends)

    @property
    def duration(self) -> float:
        """Sample time of all segments, s."""
        return self.n_samples / self.header.acquisition.rate

    @property
    def is_complete(self) -> bool:
        """Whether the run was finished properly: every segment has its end, and the file its own."""
        return self._is_complete

    @property
    def is_gap_free(self) -> bool:
        """Whether the run was finished properly and is one segment without a loss."""
        return self._is_complete and len(self._ends) == 1 and self._ends[0].is_gap_free

    @property
    def skipped_samples(self) -> int:
        """Samples per channel that the live analysis skipped; the results in the file lack them, the samples do not."""
        return self._skipped_samples

    @property
    def delivery(self) -> DeliveryStatistics:
        """How the samples came from the device; nothing is known of that where the run was not finished."""
        return self._delivery

    def segment_started_ns(self, segment: int) -> int:
        """Return when a segment began by sample time, ns since 1970; ValueError where there is none of this number."""
        if segment not in self._starts_ns:
            raise ValueError(f"segment: {segment}, expected one of {sorted(self._starts_ns)}")
        return self._starts_ns[segment]

    def items(self) -> Iterator[SourceItem]:
        """Yield blocks as recorded, each segment followed by its end.

        Where the file is damaged inside a segment, the rest of that segment is left out, and its end says so.
        """
        sequence = Sequence({end.segment: end for end in self._ends})
        join = PulseMerger(self.header.acquisition)
        for message in self._messages(SAMPLE_CHANNEL | END_CHANNEL | PULSE_CHANNEL):
            if message.channel in SAMPLE_CHANNEL:
                with suppress(ValueError):  # a message that does not say what it should is as good as lost
                    yield from sequence.block(join.block(self._block(message.data)))
            elif message.channel in PULSE_CHANNEL:
                with suppress(ValueError):
                    join.pulses(message.data)
            elif message.channel in END_CHANNEL:
                with suppress(ValueError):
                    yield from sequence.segment_end(decode_segment_end(message.data))
        yield from sequence.finish()

    def samples(self, segment: int, first: int, stop: int) -> NDArray[np.int16]:
        """Return the codes of a stretch of a segment.

        Parameters
        ----------
        segment : int
            The segment.
        first, stop : int
            First sample, and one past the last, in the segment.

        Returns
        -------
        ndarray of int16, shape (n_channels, stop - first)
            Converter codes.

        Raises
        ------
        ValueError
            Where there are no such samples.
        DamagedError
            Where the file is damaged there.
        """
        ends = {end.segment: end for end in self._ends}
        if segment not in ends:
            raise ValueError(f"segment: {segment}, expected one of {sorted(ends)}")
        if not 0 <= first <= stop <= ends[segment].samples:
            raise ValueError(f"samples: {first} to {stop}, expected within 0 to {ends[segment].samples}")
        codes = np.empty((len(self.header.acquisition.channels), stop - first), dtype=np.int16)
        filled = first
        for block in self._blocks_from(segment, first):
            if block.first_sample > filled or filled >= stop:
                break
            upto = min(block.end, stop)
            codes[:, filled - first : upto - first] = block.codes[
                :, filled - block.first_sample : upto - block.first_sample
            ]
            filled = upto
        if filled < stop:
            raise DamagedError(f"{self.path}: segment {segment} is damaged after sample {filled}")
        return codes

    def ticks(self, segment: int, first: int, stop: int) -> NDArray[np.int64]:
        """Return when the tacho's edges came in a stretch of a segment, as a counter stamped them.

        Parameters
        ----------
        segment, first, stop : int
            As in `samples`.

        Returns
        -------
        ndarray of int64, shape (n_pulses,)
            Ticks of the counter's timebase since the segment's first sample, rising; those in damaged places are left
            out.
        """
        acquisition = self.header.acquisition
        parts = [np.empty(0, np.int64)]
        if segment in self._starts_ns:
            time_ns = self._starts_ns[segment] + sample_time_ns(first, acquisition.rate)
            first_place = self._container.chunks.last_before(PULSE_CHANNEL, time_ns)
            for message in self._messages(PULSE_CHANNEL, first_place):
                if message.channel in PULSE_CHANNEL:
                    with suppress(ValueError):
                        found = parse_message(rig_pb2.Pulses(), message.data)
                        if (found.segment, found.first_sample) >= (segment, stop + LATEST * acquisition.rate):
                            break
                        if found.segment == segment:
                            parts.append(np.array(found.ticks, dtype=np.int64))
        ticks = np.concatenate(parts)
        low, high = first * acquisition.ticks_per_sample, stop * acquisition.ticks_per_sample
        return ticks[(ticks >= low) & (ticks < high)]

    def markers(self) -> tuple[Marker, ...]:
        """Return the moments that were named while the run was recorded; those in damaged places are left out."""
        markers = []
        for message in self._messages(MARKER_CHANNEL):
            if message.channel in MARKER_CHANNEL:
                with suppress(ValueError):
                    markers.append(decode_marker(message.data))
        return tuple(sorted(markers, key=lambda marker: (marker.segment, marker.sample)))

    def snapshots(self) -> Iterator[Snapshot]:
        """Yield the snapshots as recorded, with an empty trace; those in damaged places are left out."""
        return self._snapshots(0)

    def _snapshots(self, first_place: int) -> Iterator[Snapshot]:
        frame: rig_pb2.OrderFrame | None = None
        for message in self._messages(RESULT_CHANNELS, first_place):
            with suppress(ValueError):  # a result that cannot be read can be computed again
                if message.channel == CHANNEL_IDS[ORDER_FRAME]:
                    frame = parse_message(rig_pb2.OrderFrame(), message.data)
                elif message.channel == CHANNEL_IDS[FEATURES]:
                    features = parse_message(rig_pb2.Features(), message.data)
                    same = frame is not None and (frame.segment, frame.sample) == (features.segment, features.sample)
                    yield decode_snapshot(features, frame if same else None)

    def snapshot(self, segment: int, sample: int) -> Snapshot | None:
        """Return the snapshot at a sample as recorded, without reading those before; None where there is none.

        Parameters
        ----------
        segment, sample : int
            As in the snapshot itself.
        """
        if segment not in self._starts_ns:
            return None
        time_ns = self._starts_ns[segment] + sample_time_ns(sample, self.header.acquisition.rate)
        first = self._container.chunks.last_before(RESULT_CHANNELS, time_ns - MARKERS_LEAD_NS)
        for snapshot in self._snapshots(first):
            if (snapshot.segment, snapshot.sample) == (segment, sample):
                return snapshot
            if (snapshot.segment, snapshot.sample) > (segment, sample):
                break
        return None

    def close(self) -> None:
        """Close the file; harmless when closed already."""
        self._container.close()

    def _read_header(self) -> RunHeader:
        return read_header(self._container)

    def _read_ends(self) -> None:
        document = self._end_document()
        self._is_complete = bool(document.get("complete", False))
        self._skipped_samples = int(document.get("skipped_samples", 0))
        self._delivery = DeliveryStatistics(
            _clock_error(document), document.get("largest_backlog_s"), self.header.acquisition.buffer_time
        )
        if self._is_complete:
            self._ends = tuple(segment_end_from_json(end) for end in document["segments"])
        else:
            self._ends = self._survey()
        self._starts_ns: dict[int, int] = {}
        start_ns = self.header.started_ns
        for end in self._ends:
            self._starts_ns[end.segment] = start_ns
            start_ns += sample_time_ns(end.samples + end.lost, self.header.acquisition.rate)

    def _end_document(self) -> dict[str, Any]:
        """Return what the run came to, or nothing where it was not finished or that record is damaged."""
        entries = self._container.metadata(END_RECORD)
        if not entries or not self._container.is_finished:
            return {}
        try:
            return decode_metadata(self.path, END_RECORD, entries[-1])
        except DamagedError:
            return {}

    def _survey(self) -> tuple[SegmentEnd, ...]:
        """Find how far a file goes that was not finished."""
        ends = {}
        for message in self._messages(END_CHANNEL):
            if message.channel in END_CHANNEL:
                with suppress(ValueError):
                    end = decode_segment_end(message.data)
                    ends[end.segment] = end
        for place in reversed(self._container.chunks):
            if place.may_hold(SAMPLE_CHANNEL) and (span := self._last_span(place)) is not None:
                segment, samples = span
                if segment not in ends:
                    ends[segment] = cut_end(segment, samples)
                break
        if not ends:
            raise DamagedError(f"{self.path}: cut short or damaged: it breaks off before the first samples")
        return tuple(ends[segment] for segment in sorted(ends))

    def _last_span(self, place: ChunkLocation) -> tuple[int, int] | None:
        """Return segment and end of the last block of a chunk, or None where there is none."""
        span = None
        with suppress(DamagedError, ValueError):
            for message in self._container.messages(place):
                if message.channel in SAMPLE_CHANNEL:
                    span = block_span(message.data)
        return span

    def _messages(self, channels: frozenset[int], first_place: int = 0) -> Iterator[StoredMessage]:
        """Yield the messages of the chunks that may hold some of these channels; damaged chunks are left out."""
        for place in self._container.chunks.starting_at(first_place):
            if place.may_hold(channels):
                with suppress(DamagedError):  # whoever looks for what was in it finds it missing
                    yield from self._container.messages(place)

    def _blocks_from(self, segment: int, sample: int) -> Iterator[SampleBlock]:
        """Yield the blocks of a segment from the one on that holds this sample."""
        time_ns = self._starts_ns[segment] + sample_time_ns(sample, self.header.acquisition.rate)
        first_place = self._container.chunks.last_before(SAMPLE_CHANNEL, time_ns)
        for message in self._messages(SAMPLE_CHANNEL, first_place):
            if message.channel in SAMPLE_CHANNEL:
                with suppress(ValueError):
                    block = self._block(message.data)
                    if block.segment > segment:
                        return
                    if block.segment == segment and block.end > sample:
                        yield block

    def _block(self, data: bytes) -> SampleBlock:
        block = decode_block(data)
        n_channels = len(self.header.acquisition.channels)
        if block.codes.shape[0] != n_channels:
            raise ValueError(f"block of {block.codes.shape[0]} channels, expected {n_channels}")
        return block


def segment_end_from_json(document: dict[str, Any]) -> SegmentEnd:
    """Return the end of a segment as the record of the run's end tells it."""
    return SegmentEnd(**(document | {"reason": EndReason(document["reason"])}))


def _clock_error(document: dict[str, Any]) -> ClockError | None:
    error, uncertainty = document.get("clock_error_ppm"), document.get("clock_uncertainty_ppm")
    return None if error is None or uncertainty is None else ClockError(error * PPM, uncertainty * PPM)

"""Writing run files: block by block while a run is recorded, or a complete run from samples that exist already."""

import json
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mcap.records import Channel, Message, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding

from analysis.live.analyser import Analyser
from analysis.signals.blocks import DeliveryMonitor, EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from analysis.signals.units import PPM
from recordings.errors import StorageError
from recordings.mcap.chunk_writer import AppendOnlyFile, ChunkWriter
from recordings.mcap.header import to_json
from recordings.mcap.layout import (
    CALIBRATION_RECORD,
    CHANNEL_IDS,
    CONFIG_ATTACHMENT,
    END_RECORD,
    PROFILE,
    PULSES,
    RUN_RECORD,
    SAMPLES,
    SEGMENT_END,
    TOPICS,
    encode_metadata,
    sample_time_ns,
)
from recordings.mcap.messages import PulseEncoder, encode_block, encode_segment_end, message_definitions
from recordings.mcap.results import EncodedResult, Marker, encode_marker, encode_snapshot

CHUNK_BYTES = 1 << 20
FLUSH_INTERVAL = 0.2
"""Maximum seconds of samples in memory, including the block that the device is still acquiring.

A killed process loses these and what arrived while it waited for the processor: a quarter second at most, or one block
if blocks are longer.
"""
RESULT_INTERVAL = 2.0
"""Seconds of samples whose results are collected into one chunk, separate from samples: results are read alone."""


class RunWriter:
    """Writer of a run's file while the run is recorded.

    Blocks, segment ends and `close` must come from one thread; results may come from any thread at the same time.

    Parameters
    ----------
    path : Path
        File to create; it must not exist, its folder must.
    header : RunHeader
        Header of the run, written first.

    Raises
    ------
    StorageError
        If the file exists already or cannot be created.
    """

    def __init__(self, path: Path, header: RunHeader) -> None:
        self.path = path
        self._header = header
        self._rate = header.acquisition.rate
        self._results: deque[EncodedResult] = deque()
        self._ends: list[SegmentEnd] = []
        self._delivery = DeliveryMonitor(header.acquisition)
        self._pulses = PulseEncoder(header.acquisition)
        self._starts_ns = {0: header.started_ns}
        self._segment = 0
        self._next_sample = 0
        self._written_samples = 0  # of the open segment
        self._written_pulses = 0  # of the run
        self._since_flush = 0
        self._since_results = 0
        self._sequence = 0
        self._chunk: list[Message] = []
        self._chunk_bytes = 0
        self._failure = ""
        self._closed = False
        self._file = AppendOnlyFile(path)
        with self._writing():
            self._mcap = ChunkWriter(self._file, PROFILE, header.program)
            self._begin()

    @property
    def size(self) -> int:
        """Bytes written; the file itself may be larger, since disk space is allocated ahead."""
        return self._file.length

    def write_block(self, block: SampleBlock) -> None:
        """Write a block.

        Parameters
        ----------
        block : SampleBlock
            The samples that follow the last block without a gap.

        Raises
        ------
        StorageError
            If it cannot be written, or a write failed before; what was written before stays readable.
        ValueError
            If the block is out of sequence or has another number of channels.
        """
        with self._writing():
            self._check(block)
            log_time = self._starts_ns[self._segment] + sample_time_ns(block.first_sample, self._rate)
            pulses = self._pulses.encode(block)
            if pulses is not None:
                self._add(_message(PULSES, log_time, pulses))
            self._add(_message(SAMPLES, log_time, encode_block(block), self._sequence))
            self._sequence += 1
            self._next_sample = block.end
            self._delivery.add_block(block)
            self._since_flush += block.n_samples
            self._since_results += block.n_samples
            if self._since_flush + block.n_samples > FLUSH_INTERVAL * self._rate or self._chunk_bytes >= CHUNK_BYTES:
                self._flush()
                if self._since_results >= RESULT_INTERVAL * self._rate:
                    self._flush_results()

    def write_segment_end(self, end: SegmentEnd) -> None:
        """Write the end of a segment; no effect after a failed write.

        Raises
        ------
        StorageError
            If it cannot be written.
        ValueError
            If it is not the end of the segment being written.
        """
        if self._failure:
            return
        if end.segment != self._segment or end.samples != self._next_sample:
            raise ValueError(
                f"end of segment {end.segment} after {end.samples} samples, expected segment {self._segment} "
                f"after {self._next_sample}"
            )
        start_ns = self._starts_ns[end.segment]
        log_time = start_ns + sample_time_ns(end.samples, self._rate)
        self._add(_message(SEGMENT_END, log_time, encode_segment_end(end), end.segment))
        with self._writing():
            self._flush()
            self._ends.append(end)
            self._segment += 1
            self._next_sample = self._written_samples = 0
            self._starts_ns[self._segment] = start_ns + sample_time_ns(end.samples + end.lost, self._rate)
            self._flush_results()

    def add_result(self, result: EncodedResult) -> None:
        """Queue a result, from any thread; it is written with later samples, at the latest by `close`.

        After `close` or a failed write results are dropped. ValueError if the topic is not one of a run's.
        """
        if result.topic not in CHANNEL_IDS:
            raise ValueError(f"topic: {result.topic!r}, expected one of {', '.join(CHANNEL_IDS)}")
        self._results.append(result)

    def write_metadata(self, name: str, document: Mapping[str, Any]) -> None:
        """Write a JSON document as a metadata record, such as the origin of imported samples; from the writing thread.

        Raises
        ------
        StorageError
            If it cannot be written; what was written before stays readable.
        """
        with self._writing():
            self._mcap.add_metadata(name, encode_metadata(document))
        self._file.commit()

    def close(self, skipped_samples: int = 0) -> None:
        """Write the end record and finish the file; no effect if closed already or after a failed write.

        Parameters
        ----------
        skipped_samples : int
            Samples per channel that the live analysis skipped (they are in the file).

        Raises
        ------
        StorageError
            If it cannot be written; what was written before stays readable.
        """
        if self._closed:
            return
        with self._writing():
            self._flush()
            self._flush_results()
            self._finish(skipped_samples)
        self._closed = True

    def discard(self) -> None:
        """Close and remove the file, when an imported or recovered run could not be written completely."""
        if not self._failure:
            self._failure = f"{self.path}: has been discarded"
            self._file.roll_back()
        self._closed = True
        self.path.unlink(missing_ok=True)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Finish the file if a write fails; StorageError then, and at once after an earlier failure."""
        if self._failure:
            raise StorageError(self._failure)
        try:
            yield
        except OSError as error:
            raise self._fail(error) from error

    def _begin(self) -> None:
        header = self._header
        channels = header.acquisition.channels
        self._mcap.add_metadata(RUN_RECORD, encode_metadata(to_json(header)))
        self._mcap.add_metadata(
            CALIBRATION_RECORD,
            {c.name: json.dumps(to_json(c.calibration)) for c in channels if c.calibration is not None},
        )
        self._mcap.add_attachment(CONFIG_ATTACHMENT, "application/toml", header.started_ns, header.config_toml.encode())
        definitions, names = message_definitions(), ",".join(channel.name for channel in channels)
        channel_metadata = {SAMPLES: {"rate_hz": repr(self._rate), "channels": names}}
        if header.acquisition.tacho.counter is not None:
            channel_metadata[PULSES] = {"timebase_hz": repr(header.acquisition.tacho.counter.timebase)}
        for topic, message in TOPICS.items():
            number = CHANNEL_IDS[topic]
            self._mcap.add_channel(
                Channel(number, topic, MessageEncoding.Protobuf, channel_metadata.get(topic, {}), number),
                Schema(number, definitions, SchemaEncoding.Protobuf, f"rig.{message}"),
            )
        self._mcap.add_metadata(RUN_RECORD, encode_metadata(to_json(header)))  # again: without it nothing can be read
        self._file.commit()

    def _add(self, message: Message) -> None:
        self._chunk.append(message)
        self._chunk_bytes += len(message.data)

    def _check(self, block: SampleBlock) -> None:
        n_channels = len(self._header.acquisition.channels)
        if block.codes.shape[0] != n_channels:
            raise ValueError(f"block of {block.codes.shape[0]} channels, expected {n_channels}")
        if (block.segment, block.first_sample) != (self._segment, self._next_sample):
            raise ValueError(
                f"block of segment {block.segment} from sample {block.first_sample}, expected segment {self._segment} "
                f"from sample {self._next_sample}"
            )

    def _flush(self) -> None:
        """Write the collected samples to the operating system."""
        self._mcap.add_chunk(self._chunk)
        self._written_samples, self._written_pulses = self._next_sample, self._pulses.count
        self._file.commit()
        self._chunk = []
        self._chunk_bytes = 0
        self._since_flush = 0

    def _flush_results(self) -> None:
        """Write the collected results to the operating system."""
        self._since_results = 0
        self._mcap.add_chunk(self._queued_results())
        self._file.commit()

    def _queued_results(self) -> Iterator[Message]:
        while self._results:
            result = self._results.popleft()
            start_ns = self._starts_ns.get(result.segment, self._starts_ns[self._segment])
            log_time = result.log_time_ns + start_ns - self._starts_ns[0]
            yield _message(result.topic, log_time, result.data)

    def _end_record(self, skipped_samples: int) -> dict[str, object]:
        delivery = self._delivery.statistics()
        clock = delivery.clock
        return {
            "complete": self._next_sample == 0,  # no segment left open
            "gap_free": len(self._ends) == 1 and self._ends[0].is_gap_free,
            "samples": sum(end.samples for end in self._ends) + self._next_sample,
            "skipped_samples": skipped_samples,
            "pulses": self._written_pulses,
            "clock_error_ppm": None if clock is None else clock.error / PPM,
            "clock_uncertainty_ppm": None if clock is None else clock.uncertainty / PPM,
            "largest_backlog_s": delivery.backlog,
            "segments": [asdict(end) for end in self._ends],
        }

    def _finish(self, skipped_samples: int) -> None:
        """Write the end record and the index; disk space for both is reserved."""
        self._mcap.add_metadata(END_RECORD, encode_metadata(self._end_record(skipped_samples)), is_tail=True)
        self._mcap.finish()
        self._file.close()

    def _fail(self, error: OSError) -> StorageError:
        """Finish the file with its present content, or roll it back; close it, and return the error to raise."""
        self._failure = f"{self.path}: cannot be written: {error.strerror or error}"
        self._closed = True
        try:
            self._finish_early()
        except OSError:
            self._file.roll_back()
        return StorageError(self._failure)

    def _finish_early(self) -> None:
        """Finish the file after a failed write; results of the last samples may be missing, so all count as skipped."""
        if self._written_samples:
            lost = self._next_sample - self._written_samples
            end = SegmentEnd(
                self._segment,
                self._written_samples,
                EndReason.RECORDER,
                lost,
                lost_is_exact=False,
                detail=self._failure,
            )
            log_time = self._starts_ns[self._segment] + sample_time_ns(end.samples, self._rate)
            message = _message(SEGMENT_END, log_time, encode_segment_end(end), end.segment)
            self._mcap.add_chunk([message], is_tail=True)
            self._ends.append(end)
        self._next_sample = self._written_samples = 0
        if not self._ends:
            raise OSError(self._failure)  # nothing was recorded
        self._finish(sum(end.samples for end in self._ends))


def _message(topic: str, log_time: int, data: bytes, sequence: int = 0) -> Message:
    """Return a message whose publish time is its log time: the run's own time, not the host's clock."""
    return Message(CHANNEL_IDS[topic], log_time, data, log_time, sequence)


def write_run(
    path: Path,
    header: RunHeader,
    items: Iterable[SourceItem],
    metadata: Mapping[str, Mapping[str, Any]],
    markers: Iterable[Marker] = (),
) -> None:
    """Write a complete run with the results of its analysis; if that fails, the file is removed.

    Parameters
    ----------
    path : Path
        File to create; it must not exist, its folder must.
    header : RunHeader
        Header of the run.
    items : iterable of SampleBlock and SegmentEnd
        Its samples, in order; every segment has its end.
    metadata : mapping of str to mapping
        Further metadata records by name, read after the last item.
    markers : iterable of Marker
        Markers, read after the last item.

    Raises
    ------
    StorageError
        If the file cannot be written.
    RecordingError
        If the items cannot be read.
    """
    writer = RunWriter(path, header)
    try:
        analyser = Analyser(header.acquisition, header.settings)
        for item in items:
            if isinstance(item, SampleBlock):
                writer.write_block(item)
                _write_snapshots(writer, header, analyser.add_block(item))
            else:
                _write_snapshots(writer, header, analyser.end_segment(item))
                writer.write_segment_end(item)
        for marker in markers:
            writer.add_result(encode_marker(marker, header))
        for name, document in metadata.items():
            writer.write_metadata(name, document)
        writer.close()
    except BaseException:
        writer.discard()
        raise


def _write_snapshots(writer: RunWriter, header: RunHeader, snapshots: list[Snapshot]) -> None:
    for snapshot in snapshots:
        for result in encode_snapshot(snapshot, header):
            writer.add_result(result)

"""Writing a run's file as the run goes.

A whole run written at once from samples that are there already, with the results of their analysis.
"""

import json
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from mcap.records import Channel, Message, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding

from analysis.live.analyser import Analyser
from analysis.live.delivery import PPM, DeliveryMonitor
from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import StorageError
from recordings.mcap.chunk_writer import AppendedFile, ChunkedFile
from recordings.mcap.header import calibration_to_json, header_to_json
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
from recordings.mcap.markers import Marker, encode_marker
from recordings.mcap.messages import encode_block, encode_segment_end, message_definitions
from recordings.mcap.pulses import PulseEncoder
from recordings.mcap.results import EncodedResult, encode_snapshot

CHUNK_BYTES = 1 << 20
FLUSH_INTERVAL = 0.2
"""Seconds of samples that may be in the writer's hands, the block that is under way from the device among them.

A killed process loses these and what came while it was waiting for the processor: a quarter second at most, or a block
where blocks are longer.
"""
RESULT_INTERVAL = 2.0
"""Results are gathered for so many seconds of samples into chunks of their own: they are read without the samples."""


class RunWriter:
    """A run's file being written; a sink of blocks.

    Only one thread may hand over blocks, segment ends and `close`; results may come from any other at the same time.

    Parameters
    ----------
    path : Path
        File to be created; it must not exist, its folder must.
    header : RunHeader
        What is known of the run; written first.

    Raises
    ------
    StorageError
        Where the file exists already or cannot be created.
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
        self._kept_samples = 0  # of the open segment, in the file
        self._kept_pulses = 0  # of the run, in the file
        self._since_flush = 0
        self._since_results = 0
        self._sequence = 0
        self._chunk: list[Message] = []
        self._chunk_bytes = 0
        self._failure = ""
        self._closed = False
        self._file = AppendedFile(path)
        try:
            self._mcap = ChunkedFile(self._file, PROFILE, header.program)
            self._begin()
        except OSError as error:
            raise self._fail(error) from error

    @property
    def size(self) -> int:
        """Bytes written; the file itself may be larger, for room is taken ahead."""
        return self._file.length

    def block(self, block: SampleBlock) -> None:
        """Write a block.

        Parameters
        ----------
        block : SampleBlock
            It must follow the one before without a gap.

        Raises
        ------
        StorageError
            Where it cannot be written, now or since an earlier failure; what was written before stays readable.
        ValueError
            Where the block does not follow or has another number of channels.
        """
        if self._failure:
            raise StorageError(self._failure)
        self._check(block)
        log_time = self._starts_ns[self._segment] + sample_time_ns(block.first_sample, self._rate)
        pulses = self._pulses.message(block)
        if pulses is not None:
            self._add(_message(PULSES, log_time, pulses))
        self._add(_message(SAMPLES, log_time, encode_block(block), self._sequence))
        self._sequence += 1
        self._next_sample = block.end
        self._delivery.add_block(block)
        self._since_flush += block.n_samples
        self._since_results += block.n_samples
        try:
            if self._since_flush + block.n_samples > FLUSH_INTERVAL * self._rate or self._chunk_bytes >= CHUNK_BYTES:
                self._flush()
                if self._since_results >= RESULT_INTERVAL * self._rate:
                    self._flush_results()
        except OSError as error:
            raise self._fail(error) from error

    def segment_end(self, end: SegmentEnd) -> None:
        """Write the end of a segment; nothing happens after a failure.

        Raises
        ------
        StorageError
            Where it cannot be written.
        ValueError
            Where it is not the end of the segment being written.
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
        try:
            self._flush()
            self._ends.append(end)
            self._segment += 1
            self._next_sample = self._kept_samples = 0
            self._starts_ns[self._segment] = start_ns + sample_time_ns(end.samples + end.lost, self._rate)
            self._flush_results()
        except OSError as error:
            raise self._fail(error) from error

    def result(self, result: EncodedResult) -> None:
        """Take a result, from any thread; it is written with the samples that come, at the latest on `close`.

        What comes after `close` or after a failure is forgotten. ValueError where the topic is none of a run's.
        """
        if result.topic not in CHANNEL_IDS:
            raise ValueError(f"topic: {result.topic!r}, expected one of {', '.join(CHANNEL_IDS)}")
        self._results.append(result)

    def record(self, name: str, document: Mapping[str, Any]) -> None:
        """Write a document that says more of the run, as where its samples came from; from the thread that closes.

        Raises
        ------
        StorageError
            Where it cannot be written; what was written before stays readable.
        """
        if self._failure:
            raise StorageError(self._failure)
        try:
            self._mcap.add_metadata(name, encode_metadata(document))
        except OSError as error:
            raise self._fail(error) from error
        self._file.settle()

    def close(self, skipped_samples: int = 0) -> None:
        """Write what the run came to and finish the file; harmless when closed already or after a failure.

        Parameters
        ----------
        skipped_samples : int
            Samples per channel that the live analysis skipped (they are in the file).

        Raises
        ------
        StorageError
            Where it cannot be written; what was written before stays readable.
        """
        if self._closed:
            return
        try:
            self._flush()
            self._flush_results()
            self._finish(skipped_samples)
        except OSError as error:
            raise self._fail(error) from error
        self._closed = True

    def abandon(self) -> None:
        """Let go of the file and remove it, where a run that was not recorded live could not be written whole."""
        if not self._failure:
            self._failure = f"{self.path}: has been abandoned"
            self._file.cut_back()
        self._closed = True
        self.path.unlink(missing_ok=True)

    def _begin(self) -> None:
        header = self._header
        channels = header.acquisition.channels
        self._mcap.add_metadata(RUN_RECORD, encode_metadata(header_to_json(header)))
        self._mcap.add_metadata(
            CALIBRATION_RECORD,
            {c.name: json.dumps(calibration_to_json(c.calibration)) for c in channels if c.calibration is not None},
        )
        self._mcap.add_attachment(CONFIG_ATTACHMENT, "application/toml", header.started_ns, header.config_toml.encode())
        data, names = message_definitions(), ",".join(channel.name for channel in channels)
        about = {SAMPLES: {"rate_hz": repr(self._rate), "channels": names}}
        if header.acquisition.tacho.counter is not None:
            about[PULSES] = {"timebase_hz": repr(header.acquisition.tacho.counter.timebase)}
        for topic, message in TOPICS.items():
            number = CHANNEL_IDS[topic]
            self._mcap.add_channel(
                Channel(number, topic, MessageEncoding.Protobuf, about.get(topic, {}), number),
                Schema(number, data, SchemaEncoding.Protobuf, f"rig.{message}"),
            )
        self._mcap.add_metadata(
            RUN_RECORD, encode_metadata(header_to_json(header))
        )  # again: without it nothing can be read
        self._file.settle()

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
        """Hand the samples that have been gathered to the operating system."""
        self._mcap.add_chunk(self._chunk)
        self._kept_samples, self._kept_pulses = self._next_sample, self._pulses.told
        self._file.settle()
        self._chunk = []
        self._chunk_bytes = 0
        self._since_flush = 0

    def _flush_results(self) -> None:
        """Hand the results that have been gathered to the operating system."""
        self._since_results = 0
        self._mcap.add_chunk(self._taken_results())
        self._file.settle()

    def _taken_results(self) -> Iterator[Message]:
        while self._results:
            result = self._results.popleft()
            start_ns = self._starts_ns.get(result.segment, self._starts_ns[self._segment])
            log_time = result.log_time_ns + start_ns - self._starts_ns[0]
            yield _message(result.topic, log_time, result.data)

    def _end_document(self, skipped_samples: int) -> dict[str, object]:
        delivery = self._delivery.statistics()
        clock = delivery.clock
        return {
            "complete": self._next_sample == 0,  # no segment left open
            "gap_free": len(self._ends) == 1 and self._ends[0].is_gap_free,
            "samples": sum(end.samples for end in self._ends) + self._next_sample,
            "skipped_samples": skipped_samples,
            "pulses": self._kept_pulses,
            "clock_error_ppm": None if clock is None else clock.error / PPM,
            "clock_uncertainty_ppm": None if clock is None else clock.uncertainty / PPM,
            "largest_backlog_s": delivery.backlog,
            "segments": [
                {
                    "segment": end.segment,
                    "samples": end.samples,
                    "reason": end.reason.value,
                    "lost": end.lost,
                    "lost_is_exact": end.lost_is_exact,
                    "detail": end.detail,
                }
                for end in self._ends
            ],
        }

    def _finish(self, skipped_samples: int) -> None:
        """Write what the run came to and the index; the room for both has been kept."""
        self._mcap.add_metadata(END_RECORD, encode_metadata(self._end_document(skipped_samples)), is_tail=True)
        self._mcap.finish()
        self._file.close()

    def _fail(self, error: OSError) -> StorageError:
        """Finish the file with what is in it, or cut it back to what is whole; let go of it, and say what happened."""
        self._failure = f"{self.path}: cannot be written: {error.strerror or error}"
        self._closed = True
        try:
            self._finish_early()
        except OSError:
            self._file.cut_back()
        return StorageError(self._failure)

    def _finish_early(self) -> None:
        """Finish the file after a failure; results of the last samples may be missing: all are to be made anew."""
        if self._kept_samples:
            lost = self._next_sample - self._kept_samples
            end = SegmentEnd(
                self._segment, self._kept_samples, EndReason.RECORDER, lost, lost_is_exact=False, detail=self._failure
            )
            log_time = self._starts_ns[self._segment] + sample_time_ns(end.samples, self._rate)
            message = _message(SEGMENT_END, log_time, encode_segment_end(end), end.segment)
            self._mcap.add_chunk([message], is_tail=True)
            self._ends.append(end)
        self._next_sample = self._kept_samples = 0
        if not self._ends:
            raise OSError(self._failure)  # nothing was recorded
        self._finish(sum(end.samples for end in self._ends))


def _message(topic: str, log_time: int, data: bytes, sequence: int = 0) -> Message:
    """Return a message published when it was logged: by the run's own time, not by the host's clock."""
    return Message(CHANNEL_IDS[topic], log_time, data, log_time, sequence)


def write_run(
    path: Path,
    header: RunHeader,
    items: Iterable[SourceItem],
    remarks: Mapping[str, Mapping[str, Any]],
    markers: Iterable[Marker] = (),
) -> None:
    """Write a run; nothing is left of it where that fails.

    Parameters
    ----------
    path : Path
        File to be created; it must not exist, its folder must.
    header : RunHeader
        Of the run.
    items : iterable of SampleBlock and SegmentEnd
        Its samples, in order; every segment has its end.
    remarks : mapping of str to mapping
        Further records by name, written when all samples have been taken.

    markers : iterable of Marker
        Named moments, taken when all samples have been.

    Raises
    ------
    StorageError
        Where it cannot be written.
    RecordingError
        Where the items cannot be read on.
    """
    writer = RunWriter(path, header)
    try:
        analyser = Analyser(header.acquisition, header.settings)
        for item in items:
            if isinstance(item, SampleBlock):
                writer.block(item)
                _keep(writer, header, analyser.add_block(item))
            else:
                _keep(writer, header, analyser.end_segment(item))
                writer.segment_end(item)
        for marker in markers:
            writer.result(encode_marker(marker, header))
        for name, document in remarks.items():
            writer.record(name, document)
        writer.close()
    except BaseException:
        writer.abandon()
        raise


def _keep(writer: RunWriter, header: RunHeader, snapshots: list[Snapshot]) -> None:
    for snapshot in snapshots:
        for result in encode_snapshot(snapshot, header):
            writer.result(result)

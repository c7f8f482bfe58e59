"""Recording one run into several files: parts at a size or duration limit, and one file for each trigger event."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from recordings.mcap.layout import MARKER, sample_time_ns
from recordings.mcap.results import EncodedResult, decode_marker, encode_marker
from recordings.mcap.writer import RunWriter


@dataclass(frozen=True, slots=True)
class PartLimits:
    """Limits at which the recording continues in a new file.

    Parameters
    ----------
    samples : int or None
        Samples per channel; None for no limit.
    size : int or None
        Bytes of the file; None for no limit.
    is_rearmed : bool
        Whether the trigger is armed again: each finished segment is an event and ends its file.
    """

    samples: int | None = None
    size: int | None = None
    is_rearmed: bool = False


def part_id(event: str, part: int) -> str:
    """Return the id of a part of an event; the first part has the event's id."""
    return event if part == 1 else f"{event}-part{part}"


def event_id(run: str, event: int) -> str:
    """Return the id of an event of a run; the first event has the run's id."""
    return run if event == 1 else f"{run}-event{event}"


def file_ids(path: Path) -> Iterator[str]:
    """Yield the ids of all files of a run, given the first: its events, each with its parts."""
    for event in count(1):
        for part in count(1):
            name = part_id(event_id(path.stem, event), part)
            if path.with_name(f"{name}{path.suffix}").exists():
                yield name
            elif part == 1:
                return
            else:
                break


class PartWriter:
    """Writer of a run as `RunWriter`, which continues in a new file when a part is full or another event begins.

    No sample is lost between parts. Every file is a run of its own: its header has its start, its note names the run
    and the part or event. The last segment of a part ends with the name of the next part, whose first sample follows
    immediately. Between events, `skip_samples` counts the samples that are not recorded.

    Live results of a run in several files are not written, since they count through the whole run; each file records
    them as skipped, and they are computed again from the samples. Markers are written to the file of their time; a
    marker between two events goes to the beginning of the next.

    Blocks, segment ends and `close` must come from one thread; results may come from any.

    Parameters
    ----------
    path : Path
        The first file.
    header : RunHeader
        Header of the run.
    limits : PartLimits
        Limits of a file.

    Attributes
    ----------
    files : int
        Number of files so far.

    Raises
    ------
    StorageError
        If a file exists already or cannot be created; from the constructor and from `write_block`.
    """

    def __init__(self, path: Path, header: RunHeader, limits: PartLimits) -> None:
        self._path = path
        self._header = header
        self._limits = limits
        self._writer = RunWriter(path, header)
        self._lock = threading.Lock()
        self.files = self._event = self._part = 1
        self._event_ended = False
        self._pending_markers: list[EncodedResult] = []  # added since the event ended
        self._segment, self._first = 0, 0  # of the run, at the start of the current file, or of the next one
        self._before_ns = 0  # sample time before the current file
        self._elapsed_ns = 0  # sample time of the current file's ended segments and of skipped samples
        self._samples = 0  # in the current file

    def skip_samples(self, samples: int) -> None:
        """Count samples per channel before the next block that are not recorded."""
        self._elapsed_ns += sample_time_ns(samples, self._header.acquisition.rate)

    def write_block(self, block: SampleBlock) -> None:
        """Write a block, to a new file if the current one is full or its event has ended."""
        if self._event_ended:
            self._begin_event()
        elif self._samples and self._is_full():
            self._begin_part(block)
        is_first_segment = block.segment == self._segment  # of the file; it may have begun in an earlier file
        first = block.first_sample - self._first if is_first_segment else block.first_sample
        ticks_per_sample = self._header.acquisition.ticks_per_sample
        self._writer.write_block(block.relocated(block.segment - self._segment, first, ticks_per_sample))
        self._samples += block.n_samples

    def write_segment_end(self, end: SegmentEnd) -> None:
        """Write a segment end; as `RunWriter.write_segment_end`."""
        if self._event_ended:
            self._begin_event()
        samples = end.samples - self._first if end.segment == self._segment else end.samples
        self._writer.write_segment_end(replace(end, segment=end.segment - self._segment, samples=samples))
        self._elapsed_ns += sample_time_ns(samples + end.lost, self._header.acquisition.rate)
        if self._limits.is_rearmed and end.reason is EndReason.FINISHED:
            with self._lock:
                self._event_ended = True
                self._segment, self._first = end.segment + 1, 0
            self._writer.close(self._samples)

    def add_result(self, result: EncodedResult) -> None:
        """Queue a result, from any thread; as `RunWriter.add_result`."""
        with self._lock:
            if self._event_ended:
                if result.topic == MARKER:
                    self._pending_markers.append(result)
            elif self.files == 1:
                self._writer.add_result(result)
            elif result.topic == MARKER:
                self._writer.add_result(self._moved_marker(result))

    def close(self, skipped_samples: int = 0) -> None:
        """Finish the last file; as `RunWriter.close`."""
        if self._event_ended:
            if not self._pending_markers:
                return
            self._begin_event()
            self._writer.write_segment_end(
                SegmentEnd(0, 0, EndReason.STOPPED, detail="markers added while no event was recorded")
            )
        self._writer.close(skipped_samples if self.files == 1 else self._samples)

    def _moved_marker(self, result: EncodedResult) -> EncodedResult:
        """Return a marker with its segment and sample in the current file."""
        marker = decode_marker(result.data)
        first = self._first if marker.segment == self._segment else 0
        moved = replace(marker, segment=max(marker.segment - self._segment, 0), sample=max(marker.sample - first, 0))
        return encode_marker(moved, self._header)

    def _is_full(self) -> bool:
        counts = ((self._limits.samples, self._samples), (self._limits.size, self._writer.size))
        return any(limit is not None and count >= limit for limit, count in counts)

    def _begin_part(self, block: SampleBlock) -> None:
        """Finish the current part, and begin the next with this block."""
        event = event_id(self._header.run, self._event)
        name = part_id(event, self._part + 1)
        first = self._first if block.segment == self._segment else 0
        if block.first_sample:
            end = SegmentEnd(
                block.segment - self._segment,
                block.first_sample - first,
                EndReason.FINISHED,
                detail=f"continues in {name} with the next sample",
            )
            self._writer.write_segment_end(end)
            self._elapsed_ns += sample_time_ns(end.samples, self._header.acquisition.rate)
        self._writer.close(self._samples)
        self._part += 1
        self._begin(name, f"part {self._part} of {event}", (block.segment, block.first_sample))

    def _begin_event(self) -> None:
        """Begin the next event with the next segment of the run."""
        self._event, self._part = self._event + 1, 1
        run = self._header.run
        self._begin(event_id(run, self._event), f"event {self._event} of {run}", (self._segment, 0))

    def _begin(self, name: str, note: str, start: tuple[int, int]) -> None:
        """Begin a file at a segment and sample of the run."""
        self._before_ns += self._elapsed_ns
        header = replace(
            self._header,
            run=name,
            started_ns=self._header.started_ns + self._before_ns,
            note=f"{self._header.note} ({note})" if self._header.note else note,
        )
        writer = RunWriter(self._path.with_name(f"{name}{self._path.suffix}"), header)
        with self._lock:
            self._writer = writer
            self.files += 1
            self._event_ended = False
            self._segment, self._first = start
            pending, self._pending_markers = self._pending_markers, []
            for marker in pending:
                self._writer.add_result(self._moved_marker(marker))
        self._samples = self._elapsed_ns = 0

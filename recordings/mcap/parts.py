"""A run that is written into several files, one after the other, without losing a sample between them."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from recordings.mcap.layout import MARK, sample_time_ns
from recordings.mcap.markers import decode_marker, encode_marker
from recordings.mcap.results import EncodedResult
from recordings.mcap.writer import RunWriter


@dataclass(frozen=True, slots=True)
class PartLimits:
    """When a file ends and the run goes on in a further one; None and False for never.

    Parameters
    ----------
    samples : int or None
        Samples per channel.
    size : int or None
        Bytes of its file.
    is_rearmed : bool
        Whether a segment that finished ends the file at once, and what comes then is another event.
    """

    samples: int | None = None
    size: int | None = None
    is_rearmed: bool = False


def part_id(event: str, part: int) -> str:
    """Return the id of a part of an event: the event's own for the first."""
    return event if part == 1 else f"{event}-part{part}"


def event_id(run: str, event: int) -> str:
    """Return the id of an event of a run: the run's own for the first."""
    return run if event == 1 else f"{run}-event{event}"


def file_ids(path: Path) -> Iterator[str]:
    """Yield the ids of the files of a run, whose first is given: its events, each with its parts."""
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
    """Writes a run as `RunWriter` does, and goes on in a further file when a part is full or another event begins.

    Every file is a run by itself: its header says when it began, its note what it is of which run. A part's last
    segment ends with the name of the part in which it goes on, whose first sample is the next one; between events
    samples pass that nobody asked for, and `pass_over` counts them. The live results of a run in several files are not
    kept (each says that they were skipped): they count through the whole run, and are computed again from the samples.
    Marks are kept, where they belong; one that is made between two events lies at the beginning of the next.

    One thread hands over blocks, ends and `close`; results may come from any other.

    Parameters
    ----------
    path : Path
        The first file.
    header : RunHeader
        Of the run.
    limits : PartLimits
        When a file ends.

    Raises
    ------
    StorageError
        Where a file exists already or cannot be created, from the constructor and from `block`.
    """

    def __init__(self, path: Path, header: RunHeader, limits: PartLimits) -> None:
        self._path = path
        self._header = header
        self._limits = limits
        self._writer = RunWriter(path, header)
        self._lock = threading.Lock()
        self._files = self._event = self._part = 1
        self._is_over = False  # the present event
        self._held: list[EncodedResult] = []  # marks made since
        self._segment, self._first = 0, 0  # of the run, where the present file began, or the next will
        self._before_ns = 0  # sample time before the present file
        self._elapsed_ns = 0  # of the present file's ended segments, and of what was let pass
        self._samples = 0  # in the present file

    @property
    def files(self) -> int:
        """Number of files so far."""
        return self._files

    def skip_samples(self, samples: int) -> None:
        """Count samples per channel that pass before the next block, and that nobody asked for."""
        self._elapsed_ns += sample_time_ns(samples, self._header.acquisition.rate)

    def block(self, block: SampleBlock) -> None:
        """Write a block, into the next file where the present one is full or over; as `RunWriter.block`."""
        if self._is_over:
            self._begin_event()
        elif self._samples and self._is_full():
            self._go_on(block)
        own = block.segment == self._segment
        first = block.first_sample - self._first if own else block.first_sample
        ticks_per_sample = self._header.acquisition.ticks_per_sample
        self._writer.block(block.relocated(block.segment - self._segment, first, ticks_per_sample))
        self._samples += block.n_samples

    def segment_end(self, end: SegmentEnd) -> None:
        """Write the end of a segment; as `RunWriter.segment_end`."""
        if self._is_over:
            self._begin_event()
        samples = end.samples - self._first if end.segment == self._segment else end.samples
        self._writer.segment_end(replace(end, segment=end.segment - self._segment, samples=samples))
        self._elapsed_ns += sample_time_ns(samples + end.lost, self._header.acquisition.rate)
        if self._limits.is_rearmed and end.reason is EndReason.FINISHED:
            with self._lock:
                self._is_over = True
                self._segment, self._first = end.segment + 1, 0
            self._writer.close(self._samples)

    def result(self, result: EncodedResult) -> None:
        """Take a result, from any thread; as `RunWriter.result`."""
        with self._lock:
            if self._is_over:
                if result.topic == MARK:
                    self._held.append(result)
            elif self._files == 1:
                self._writer.result(result)
            elif result.topic == MARK:
                self._writer.result(self._moved(result))

    def close(self, skipped_samples: int = 0) -> None:
        """Finish the last file; as `RunWriter.close`."""
        if self._is_over:
            if not self._held:
                return
            self._begin_event()
            self._writer.segment_end(SegmentEnd(0, 0, EndReason.STOPPED, detail="marked while no event was recorded"))
        self._writer.close(skipped_samples if self._files == 1 else self._samples)

    def _moved(self, result: EncodedResult) -> EncodedResult:
        """Return a marker with its place in the present file."""
        marker = decode_marker(result.data)
        first = self._first if marker.segment == self._segment else 0
        moved = replace(marker, segment=max(marker.segment - self._segment, 0), sample=max(marker.sample - first, 0))
        return encode_marker(moved, self._header)

    def _is_full(self) -> bool:
        limits = self._limits
        if limits.samples is not None and self._samples >= limits.samples:
            return True
        return limits.size is not None and self._writer.size >= limits.size

    def _go_on(self, block: SampleBlock) -> None:
        """Finish the present part and begin the next with this block."""
        event = event_id(self._header.run, self._event)
        name = part_id(event, self._part + 1)
        began = self._first if block.segment == self._segment else 0
        if block.first_sample:
            end = SegmentEnd(
                block.segment - self._segment,
                block.first_sample - began,
                EndReason.FINISHED,
                detail=f"goes on in {name} with the next sample",
            )
            self._writer.segment_end(end)
            self._elapsed_ns += sample_time_ns(end.samples, self._header.acquisition.rate)
        self._writer.close(self._samples)
        self._part += 1
        self._begin(name, f"part {self._part} of {event}", (block.segment, block.first_sample))

    def _begin_event(self) -> None:
        """Begin the next event with the next segment of the run."""
        self._event, self._part = self._event + 1, 1
        run = self._header.run
        self._begin(event_id(run, self._event), f"event {self._event} of {run}", (self._segment, 0))

    def _begin(self, name: str, note: str, place: tuple[int, int]) -> None:
        """Begin a file with a segment and sample of the run."""
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
            self._files += 1
            self._is_over = False
            self._segment, self._first = place
            held, self._held = self._held, []
            for marker in held:
                self._writer.result(self._moved(marker))
        self._samples = self._elapsed_ns = 0

"""A run that is written into several files, one after the other, without losing a sample between them."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from analysis.run import RunHeader
from analysis.samples import EndReason, SampleBlock, SegmentEnd
from recordings.layout import MARK, sample_time_ns
from recordings.marks import decode_mark, encode_mark
from recordings.results import EncodedResult
from recordings.writer import RunWriter


@dataclass(frozen=True, slots=True)
class PartLimits:
    """When a part is full; None for never.

    Parameters
    ----------
    samples : int or None
        Samples per channel.
    size : int or None
        Bytes of its file.
    """

    samples: int | None = None
    size: int | None = None


def part_name(run: str, part: int) -> str:
    """Return the id of a part of a run: the run's own for the first."""
    return run if part == 1 else f"{run}-part{part}"


def part_names(path: Path) -> Iterator[str]:
    """Yield the ids of the parts of a run, whose first part's file is given: its own, and those beside it."""
    yield path.stem
    for part in count(2):
        name = part_name(path.stem, part)
        if not path.with_name(f"{name}{path.suffix}").exists():
            return
        yield name


class PartWriter:
    """Writes a run as `RunWriter` does, and goes on in a further file when a part is full.

    Every part is a run by itself: its header says when it began, its note which part it is, its last segment ends with
    the name of the part in which it goes on, whose first sample is the next one. The live results of a run in several
    parts are not kept (each part says that they were skipped): they count through the whole run, and are computed again
    from the samples. Marks are kept, where they belong.

    One thread hands over blocks, ends and `close`; results may come from any other.

    Parameters
    ----------
    path : Path
        The first part's file.
    header : RunHeader
        Of the run.
    limits : PartLimits
        When a part is full.

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
        self._part = 1
        self._segment, self._first = 0, 0  # of the run, where the present part began
        self._before_ns = 0  # sample time of the parts before
        self._elapsed_ns = 0  # of the present part's ended segments
        self._samples = 0  # in the present part

    @property
    def parts(self) -> int:
        """Number of files so far."""
        return self._part

    def block(self, block: SampleBlock) -> None:
        """Write a block, into the next part where the present one is full; as `RunWriter.block`."""
        if self._samples and self._is_full():
            self._go_on(block)
        own = block.segment == self._segment
        first = block.first_sample - self._first if own else block.first_sample
        self._writer.block(replace(block, segment=block.segment - self._segment, first_sample=first))
        self._samples += block.n_samples

    def segment_end(self, end: SegmentEnd) -> None:
        """Write the end of a segment; as `RunWriter.segment_end`."""
        samples = end.samples - self._first if end.segment == self._segment else end.samples
        self._writer.segment_end(replace(end, segment=end.segment - self._segment, samples=samples))
        self._elapsed_ns += sample_time_ns(samples + end.lost, self._header.acquisition.rate)

    def result(self, result: EncodedResult) -> None:
        """Take a result, from any thread; as `RunWriter.result`."""
        with self._lock:
            if self._part == 1:
                self._writer.result(result)
            elif result.topic == MARK:
                mark = decode_mark(result.data)
                first = self._first if mark.segment == self._segment else 0
                moved = replace(mark, segment=max(mark.segment - self._segment, 0), sample=max(mark.sample - first, 0))
                self._writer.result(encode_mark(moved, self._header))

    def close(self, skipped_samples: int = 0) -> None:
        """Finish the last part; as `RunWriter.close`."""
        self._writer.close(skipped_samples if self._part == 1 else self._samples)

    def _is_full(self) -> bool:
        limits = self._limits
        if limits.samples is not None and self._samples >= limits.samples:
            return True
        return limits.size is not None and self._writer.size >= limits.size

    def _go_on(self, block: SampleBlock) -> None:
        """Finish the present part and begin the next with this block."""
        rate = self._header.acquisition.rate
        name = part_name(self._header.run, self._part + 1)
        began = self._first if block.segment == self._segment else 0
        if block.first_sample:
            end = SegmentEnd(
                block.segment - self._segment,
                block.first_sample - began,
                EndReason.FINISHED,
                detail=f"goes on in {name} with the next sample",
            )
            self._writer.segment_end(end)
            self._elapsed_ns += sample_time_ns(end.samples, rate)
        self._writer.close(self._samples)
        self._before_ns += self._elapsed_ns
        note = f"part {self._part + 1} of {self._header.run}"
        header = replace(
            self._header,
            run=name,
            started_ns=self._header.started_ns + self._before_ns,
            note=f"{self._header.note} ({note})" if self._header.note else note,
        )
        writer = RunWriter(self._path.with_name(f"{name}{self._path.suffix}"), header)
        with self._lock:
            self._writer = writer
            self._part += 1
            self._segment, self._first = block.segment, block.first_sample
        self._samples = self._elapsed_ns = 0

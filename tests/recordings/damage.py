"""Examination of damaged files: reader, verification and recovery must give right samples or one clear error."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from recordings.errors import DamagedError, RecordingError
from recordings.integrity.recover import recover
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.container import Container
from recordings.mcap.layout import CHANNEL_IDS, SAMPLES
from recordings.mcap.messages import decode_block
from recordings.mcap.reader import RunReader
from recordings.mcap.salvage import search_chunks

CodesOf = Callable[..., NDArray[np.int16]]
Spans = set[tuple[int, int, int]]


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of an examination: samples read, samples recovered, whether the file opens."""

    read: int
    recovered: int
    opens: bool


def examine(path: Path, copy: Path, codes_of: CodesOf) -> Outcome:
    """Read, verify and recover a damaged file; all intact samples must be recovered, with the right values."""
    copy.unlink(missing_ok=True)
    intact = intact_blocks(path, codes_of)
    try:
        verification = verify(path)
        assert verification.verdict is Verdict.DAMAGED
        assert verification.faults
        n_read = _read(path, codes_of)
    except RecordingError as error:
        check_names_file(error, path)
        n_read = 0
    try:
        recovery = recover(path, copy)
    except RecordingError as error:
        check_names_file(error, path)
        check_no_copy(copy, intact)
        return Outcome(n_read, 0, opens=False)
    assert verify(copy).verdict is Verdict.INTACT
    with RunReader(copy) as reader:
        for segment in recovery.segments:
            codes = reader.samples(segment.segment, 0, segment.stop - segment.first)
            np.testing.assert_array_equal(codes, codes_of(segment.from_segment, segment.first, segment.stop))
        assert reader.n_samples == recovery.samples
        assert reader.is_complete
    for number, first, stop in intact:
        assert any(
            segment.from_segment == number and segment.first <= first and stop <= segment.stop
            for segment in recovery.segments
        ), f"samples {first} to {stop} of segment {number} are intact and were not recovered"
    assert recovery.samples == sum(stop - first for _, first, stop in intact)
    return Outcome(n_read, recovery.samples, opens=True)


def check_names_file(error: RecordingError, path: Path) -> None:
    """Check that an error names the file."""
    assert str(error).startswith(f"{path}: ")


def check_no_copy(copy: Path, intact: Spans) -> None:
    """Check that a failed recovery had no intact samples, and left no file."""
    assert not copy.exists()
    assert not intact


def intact_blocks(path: Path, codes_of: CodesOf) -> Spans:
    """Return (segment, first sample, end) of the blocks in intact chunks, found without an index."""
    spans: Spans = set()
    try:
        container = Container(path)
    except RecordingError:
        return spans
    for chunk in search_chunks(container):
        try:
            messages = list(container.messages(chunk))
        except DamagedError:
            continue
        for message in messages:
            if message.channel == CHANNEL_IDS[SAMPLES]:
                block = decode_block(message.data)
                np.testing.assert_array_equal(block.codes, codes_of(block.segment, block.first_sample, block.end))
                spans.add((block.segment, block.first_sample, block.end))
    container.close()
    return spans


def _read(path: Path, codes_of: CodesOf) -> int:
    n_samples = 0
    with RunReader(path) as reader:
        for item in reader.items():
            if isinstance(item, SampleBlock):
                np.testing.assert_array_equal(item.codes, codes_of(item.segment, item.first_sample, item.end))
                n_samples += item.n_samples
    return n_samples

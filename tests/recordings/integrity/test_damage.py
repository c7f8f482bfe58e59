"""Reading damaged files gives fewer samples or a RecordingError, never wrong samples or another exception."""

import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import DamagedError, RecordingError
from recordings.mcap.chunk_writer import encode_records
from recordings.mcap.container import RECORD, Container
from recordings.mcap.reader import RunReader
from recordings.mcap.results import encode_snapshot
from recordings.mcap.salvage import SequenceFilter
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
CodesOf = Callable[..., NDArray[np.int16]]
BLOCK, N_BLOCKS = 400, 30


@pytest.fixture
def run(tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: Callable[..., Snapshot]) -> Path:
    """Return the small file of a run of two segments with results."""
    writer = RunWriter(tmp_path / "run.mcap", header)
    for segment in range(2):
        for k in range(N_BLOCKS):
            writer.write_block(make_block(segment, k * BLOCK, BLOCK))
            if k % 10 == 9:
                for result in encode_snapshot(make_snapshot(segment, (k + 1) * BLOCK), header):
                    writer.add_result(result)
        writer.write_segment_end(
            SegmentEnd(segment, N_BLOCKS * BLOCK, EndReason.STOPPED if segment else EndReason.OVERRUN)
        )
    writer.close()
    return writer.path


@pytest.fixture
def check(header: RunHeader, codes_of: CodesOf) -> Callable[[Path], int]:
    """Return a function that reads a file, checks every sample, and returns their number."""

    def read(path: Path) -> int:
        n_samples, segment, expected = 0, -1, 0
        with RunReader(path) as reader:
            assert reader.header == header
            for item in reader.items():
                if isinstance(item, SampleBlock):
                    if item.segment != segment:
                        assert expected == 0, "a segment began before the one before it had ended"
                        segment = item.segment
                    assert item.first_sample == expected
                    np.testing.assert_array_equal(item.codes, codes_of(item.segment, expected, item.end))
                    expected = item.end
                    n_samples += item.n_samples
                else:
                    assert item.samples == expected
                    expected = 0
            assert expected == 0, "the last segment has no end"
            for snapshot in reader.snapshots():
                assert snapshot.sample % (10 * BLOCK) == 0
        return n_samples

    return read


ALL = 2 * N_BLOCKS * BLOCK


def test_a_cut_file_gives_the_samples_before_the_cut(run: Path, tmp_path: Path, check: Callable[[Path], int]) -> None:
    data = run.read_bytes()
    cut = tmp_path / "cut.mcap"
    read = []
    for length in range(0, len(data), max(len(data) // 250, 1)):
        cut.write_bytes(data[:length])
        try:
            read.append(check(cut))
            with RunReader(cut) as reader:
                assert not reader.is_complete
                assert reader.n_samples == read[-1]
        except DamagedError:
            read.append(0)
    assert read == sorted(read)
    assert read[-1] == ALL
    assert len(set(read)) > 5


def test_a_flipped_bit_never_gives_wrong_samples(run: Path, tmp_path: Path, check: Callable[[Path], int]) -> None:
    data = bytearray(run.read_bytes())
    random = np.random.default_rng(42)
    flipped = tmp_path / "flipped.mcap"
    read = []
    for position in random.choice(len(data), 250, replace=False):
        original = data[position]
        data[position] ^= 1 << int(random.integers(8))
        flipped.write_bytes(data)
        data[position] = original
        try:
            read.append(check(flipped))
        except RecordingError:
            read.append(0)
    assert max(read) == ALL
    assert any(0 < n < ALL for n in read)
    assert np.mean(np.array(read) > 0) > 0.9


def cut_in_the_last_samples(path: Path) -> bytes:
    """Return the bytes of a file up to the middle of its last sample chunk."""
    container = Container(path)
    last = [chunk for chunk in container.chunks if chunk.may_contain(frozenset({1}))][-1]
    container.close()
    return path.read_bytes()[: last.offset + last.length // 2]


def test_a_flipped_bit_in_a_cut_file_never_gives_wrong_samples(
    run: Path, tmp_path: Path, check: Callable[[Path], int]
) -> None:
    data = bytearray(cut_in_the_last_samples(run))
    random = np.random.default_rng(43)
    flipped = tmp_path / "flipped.mcap"
    unread = 0
    for position in random.choice(len(data), 200, replace=False):
        original = data[position]
        data[position] = int(random.integers(256))
        flipped.write_bytes(data)
        data[position] = original
        if position < len(MCAP0_MAGIC):
            with pytest.raises(DamagedError, match=r"flipped\.mcap: is not an MCAP file"):
                check(flipped)
            continue
        try:
            assert check(flipped) < ALL
        except DamagedError:  # the records before the first samples do not lead to them any more
            unread += 1
    assert unread < 10


def damage_chunk(path: Path, number: int) -> None:
    """Change a byte inside one chunk of a finished file."""
    container = Container(path)
    chunk = container.chunks[number]
    container.close()
    data = bytearray(path.read_bytes())
    data[chunk.offset + chunk.length // 2] ^= 0x55
    path.write_bytes(data)


def test_a_damaged_chunk_ends_the_segment_and_counts_the_rest_as_lost(run: Path, check: Callable[[Path], int]) -> None:
    damage_chunk(run, 1)
    assert 0 < check(run) < ALL
    with RunReader(run) as reader:
        ends = [item for item in reader.items() if isinstance(item, SegmentEnd)]
        assert reader.is_complete
        assert reader.segment_ends[0].samples == N_BLOCKS * BLOCK
        with pytest.raises(DamagedError, match=f"segment 0 is damaged after sample {ends[0].samples}"):
            reader.samples(0, 0, N_BLOCKS * BLOCK)
        assert reader.samples(0, 0, ends[0].samples).shape[1] == ends[0].samples
    assert ends[0].reason is EndReason.CUT
    assert ends[0].samples + ends[0].lost == N_BLOCKS * BLOCK
    assert ends[0].lost_is_exact
    assert not ends[0].is_gap_free
    assert ends[1] == SegmentEnd(1, N_BLOCKS * BLOCK, EndReason.STOPPED)


def test_a_cut_run_ends_with_reason_cut_and_is_not_gap_free(run: Path) -> None:
    container = Container(run)
    second = container.chunks[1]
    container.close()
    run.write_bytes(run.read_bytes()[: second.offset + second.length])
    with RunReader(run) as reader:
        end = reader.segment_ends[-1]
        assert (end.reason, end.lost, end.lost_is_exact) == (EndReason.CUT, 0, False)
        assert not reader.is_gap_free


def test_samples_of_a_cut_run_are_read_to_its_end(run: Path, codes_of: CodesOf) -> None:
    run.write_bytes(cut_in_the_last_samples(run))
    with RunReader(run) as reader:
        end = reader.segment_ends[-1]
        first = end.samples // 2
        np.testing.assert_array_equal(
            reader.samples(end.segment, first, end.samples), codes_of(end.segment, first, end.samples)
        )


def test_a_run_is_readable_while_it_is_being_written(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock, codes_of: CodesOf
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    for k in range(20):
        writer.write_block(make_block(0, k * 2000, 2000))
    with RunReader(writer.path) as reader:
        assert 40_000 - reader.n_samples <= 0.25 * header.acquisition.rate
        np.testing.assert_array_equal(reader.samples(0, 100, 30_000), codes_of(0, 100, 30_000))
    writer.write_segment_end(SegmentEnd(0, 40_000, EndReason.STOPPED))
    writer.close()
    with RunReader(writer.path) as reader:
        assert reader.is_complete
        assert reader.n_samples == 40_000


def chunk_of(data: bytes, *, compression: str = "") -> bytes:
    """Return a chunk record of this data with a matching checksum."""
    return encode_records(Chunk(compression, data, 1, 0, zlib.crc32(data), len(data)))


INVALID_RECORDS = {
    "too short for a length": chunk_of(b"\x05"),
    "a length beyond the chunk": chunk_of(RECORD.pack(Opcode.MESSAGE, 1000) + b"short"),
    "a short message": chunk_of(RECORD.pack(Opcode.MESSAGE, 5) + b"short"),
    "no block": chunk_of(RECORD.pack(Opcode.MESSAGE, 27) + b"\x01\0" + bytes(20) + b"\xff" * 5),
    "no segment end": chunk_of(RECORD.pack(Opcode.MESSAGE, 27) + b"\x02\0" + bytes(20) + b"\xff" * 5),
    "no features": chunk_of(RECORD.pack(Opcode.MESSAGE, 27) + b"\x03\0" + bytes(20) + b"\xff" * 5),
    "unknown compression": chunk_of(b"", compression="lz4"),
    "not zstd": chunk_of(b"not zstd", compression="zstd"),
    "a short chunk": RECORD.pack(Opcode.CHUNK, 5) + b"short",
    "an empty chunk": RECORD.pack(Opcode.CHUNK, 0),
    "short metadata": RECORD.pack(Opcode.METADATA, 5) + b"short",
    "allocated zeros": bytes(100_000),
    "a new record": RECORD.pack(0x7F, 3) + b"new",
}


@pytest.mark.parametrize("kind", INVALID_RECORDS)
def test_invalid_records_are_ignored(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock, check: Callable[[Path], int], kind: str
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    for k in range(4):
        writer.write_block(make_block(0, k * 2000, 2000))
    forged = tmp_path / "forged.mcap"
    forged.write_bytes(writer.path.read_bytes() + INVALID_RECORDS[kind])
    writer.close()
    assert check(forged) == 8000


def test_duplicate_and_late_blocks_are_dropped(make_block: MakeBlock) -> None:
    ends = {0: SegmentEnd(0, 100, EndReason.OVERRUN), 1: SegmentEnd(1, 100, EndReason.STOPPED)}
    sequence = SequenceFilter(ends)
    first, second = make_block(0, 0, 100), make_block(1, 0, 100)
    assert [*sequence.add(first), *sequence.add(ends[0])] == [first, ends[0]]
    assert [*sequence.add(first), *sequence.add(ends[0])] == []
    assert list(sequence.add(second)) == [second]
    assert [*sequence.add(first), *sequence.add(ends[0])] == []
    assert list(sequence.finish()) == [ends[1]]
    assert list(sequence.finish()) == []


def test_a_segment_without_its_beginning_has_an_empty_end(make_block: MakeBlock) -> None:
    sequence = SequenceFilter({})
    assert list(sequence.add(make_block(0, 100, 100))) == []
    (end,) = sequence.finish()
    assert end == SegmentEnd(0, 0, EndReason.CUT, 0, lost_is_exact=False, detail="the recording breaks off here")

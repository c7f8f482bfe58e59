"""The writer never overwrites a file, loses at most a quarter second when killed, and reports its errors."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import StorageError
from recordings.mcap.header import to_json
from recordings.mcap.reader import RunReader
from recordings.mcap.results import EncodedResult, encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
MakeSnapshot = Callable[..., Snapshot]
ROOT = Path(__file__).resolve().parents[3]
IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def test_existing_file_is_not_overwritten(tmp_path: Path, header: RunHeader) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(StorageError, match=r"run\.mcap: exists already"):
        RunWriter(path, header)
    assert path.read_bytes() == b"precious"


def test_missing_folder_is_reported(tmp_path: Path, header: RunHeader) -> None:
    with pytest.raises(StorageError, match=r"there is no folder .*nowhere"):
        RunWriter(tmp_path / "nowhere" / "run.mcap", header)


def test_file_instead_of_the_folder_is_reported(tmp_path: Path, header: RunHeader) -> None:
    (tmp_path / "data").write_text("")
    with pytest.raises(StorageError, match=r"data/run\.mcap|data\\run\.mcap"):
        RunWriter(tmp_path / "data" / "run.mcap", header)


@pytest.fixture
def read_only_folder(tmp_path: Path) -> Iterator[Path]:
    """Yield a read-only folder; for root, who ignores permissions, a file system mounted read-only."""
    if sys.platform == "win32":
        pytest.skip("Windows writes into read-only folders")
    folder = tmp_path / "data"
    folder.mkdir(mode=0o500)
    if IS_ROOT:
        command = ["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", str(folder)]
        mounted = subprocess.run(command, capture_output=True, text=True, check=False)
        if mounted.returncode != 0:
            pytest.skip(f"a read-only file system cannot be mounted here: {mounted.stderr.strip()}")
    yield folder
    if IS_ROOT:
        subprocess.run(["umount", str(folder)], check=True)


def test_read_only_folder_is_reported(read_only_folder: Path, header: RunHeader) -> None:
    message = r"run\.mcap: cannot be created: (Permission denied|Read-only file system)"
    with pytest.raises(StorageError, match=message):
        RunWriter(read_only_folder / "run.mcap", header)


def test_block_out_of_sequence_is_an_error(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 100))
    with pytest.raises(ValueError, match="segment 0 from sample 200, expected segment 0 from sample 100"):
        writer.write_block(make_block(0, 200, 100))
    with pytest.raises(ValueError, match="segment 1 from sample 0"):
        writer.write_block(make_block(1, 0, 100))
    with pytest.raises(ValueError, match="block of 2 channels, expected 3"):
        writer.write_block(make_block(0, 100, 100, n_channels=2))
    with pytest.raises(ValueError, match="end of segment 0 after 300 samples, expected segment 0 after 100"):
        writer.write_segment_end(SegmentEnd(0, 300, EndReason.STOPPED))
    writer.close()


def test_result_of_an_unknown_topic_is_an_error(tmp_path: Path, header: RunHeader) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    with pytest.raises(ValueError, match="topic: '/weather'"):
        writer.add_result(EncodedResult("/weather", 0, b""))
    writer.close()


def test_result_of_an_unknown_segment_does_not_stop_the_recording(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: MakeSnapshot
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    for result in encode_snapshot(make_snapshot(7, 2000), header):
        writer.add_result(result)
    writer.write_block(make_block(0, 0, 2000))
    writer.write_segment_end(SegmentEnd(0, 2000, EndReason.STOPPED))
    writer.close()
    with RunReader(writer.path) as reader:
        assert [snapshot.segment for snapshot in reader.snapshots()] == [7]
        assert reader.is_complete


def test_closing_twice_has_no_effect(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 100))
    writer.write_segment_end(SegmentEnd(0, 100, EndReason.STOPPED))
    writer.close(skipped_samples=7)
    size = writer.path.stat().st_size
    writer.close()
    assert writer.path.stat().st_size == size
    with RunReader(writer.path) as reader:
        assert reader.skipped_samples == 7


def test_file_has_largest_backlog_and_buffer_size(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    card = replace(header, acquisition=replace(header.acquisition, buffer=160_000))
    writer = RunWriter(tmp_path / "run.mcap", card)
    for first, backlog in ((0, 40), (100, 3000), (200, 0)):
        writer.write_block(replace(make_block(0, first, 100), backlog=backlog))
    writer.write_segment_end(SegmentEnd(0, 300, EndReason.STOPPED))
    writer.close()
    with RunReader(writer.path) as reader:
        assert reader.header == card
        assert reader.delivery.backlog == 3000 / card.acquisition.rate
        assert reader.delivery.buffer == 160_000 / card.acquisition.rate


def test_run_closed_within_a_segment_is_incomplete(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 100))
    writer.close()
    with RunReader(writer.path) as reader:
        assert not reader.is_complete
        assert reader.segment_ends[0].reason is EndReason.CUT
        assert reader.n_samples == 100


def test_results_from_another_thread_are_all_written_in_order(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: MakeSnapshot
) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)

    def analyse() -> None:
        for k in range(1, 201):
            for result in encode_snapshot(make_snapshot(0, 2000 * k), header):
                writer.add_result(result)

    thread = threading.Thread(target=analyse)
    thread.start()
    for k in range(200):
        writer.write_block(make_block(0, 2000 * k, 2000))
    thread.join()
    writer.write_segment_end(SegmentEnd(0, 400_000, EndReason.STOPPED))
    writer.close()
    with RunReader(writer.path) as reader:
        assert [snapshot.sample for snapshot in reader.snapshots()] == [2000 * k for k in range(1, 201)]
        assert reader.samples(0, 0, 400_000).shape == (3, 400_000)


WRITE_FOREVER = """
    import sys
    from pathlib import Path
    import numpy as np
    from analysis.signals.blocks import SampleBlock
    from recordings.mcap.header import header_from_json
    from recordings.mcap.writer import RunWriter
    import json
    header = header_from_json(json.loads(sys.stdin.readline()))
    writer = RunWriter(Path(sys.argv[1]), header)
    first = 0
    while True:
        codes = np.arange(first, first + 2000, dtype=np.int64).astype(np.int16)
        block = SampleBlock(np.stack([codes, codes, codes]), 0, first, 0)
        writer.write_block(block)
        first = block.end
        print(first, flush=True)
        sys.stdin.readline()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX")
def test_killed_writer_loses_at_most_a_quarter_second(tmp_path: Path, header: RunHeader) -> None:
    path = tmp_path / "run.mcap"
    for n_blocks in (2, 9, 10, 11, 12):
        path.unlink(missing_ok=True)
        with subprocess.Popen(
            [sys.executable, "-c", textwrap.dedent(WRITE_FOREVER), str(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            cwd=ROOT,
        ) as writer:
            assert writer.stdin is not None
            assert writer.stdout is not None
            writer.stdin.write(json.dumps(to_json(header)).encode() + b"\n")
            for _ in range(n_blocks - 1):
                writer.stdin.write(b"\n")
            writer.stdin.flush()
            written = [int(writer.stdout.readline()) for _ in range(n_blocks)][-1]
            writer.send_signal(signal.SIGKILL)
        with RunReader(path) as reader:
            assert not reader.is_complete
            assert written - reader.n_samples <= 0.25 * header.acquisition.rate
            assert reader.segment_ends[0].reason is EndReason.CUT
            assert reader.samples(0, 0, reader.n_samples)[2, -1] == reader.n_samples % 65536 - 1


@contextmanager
def file_size_limit(n_bytes: int) -> Iterator[None]:
    """Limit the size of files of this process: a write beyond it fails as on a full disk."""
    import resource  # noqa: PLC0415  # it exists on POSIX only

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


needs_limits = pytest.mark.skipif(sys.platform == "win32", reason="limits of file size are POSIX")


@needs_limits
@pytest.mark.parametrize("limit", [100_000, 100_001, 133_333])
def test_full_disk_is_an_error_and_written_samples_stay_readable(
    tmp_path: Path, header: RunHeader, make_block: MakeBlock, codes_of: Callable[..., NDArray[np.int16]], limit: int
) -> None:
    path = tmp_path / "run.mcap"
    writer = RunWriter(path, header)
    n_given = 0

    def write_until_full() -> None:
        nonlocal n_given
        while True:
            writer.write_block(make_block(0, n_given, 2000))
            n_given += 2000

    with file_size_limit(limit), pytest.raises(StorageError) as first:
        write_until_full()
    assert str(first.value) == f"{path}: cannot be written: File too large"
    with pytest.raises(StorageError) as again:
        writer.write_block(make_block(0, n_given, 2000))
    assert str(again.value) == str(first.value)
    writer.write_segment_end(SegmentEnd(0, n_given, EndReason.RECORDER))
    writer.close()
    with RunReader(path) as reader:
        assert not reader.is_complete
        assert n_given - reader.n_samples <= 0.25 * header.acquisition.rate
        np.testing.assert_array_equal(reader.samples(0, 0, reader.n_samples), codes_of(0, 0, reader.n_samples))


@needs_limits
def test_disk_full_before_the_header_leaves_no_file(tmp_path: Path, header: RunHeader) -> None:
    path = tmp_path / "run.mcap"
    with file_size_limit(100), pytest.raises(StorageError, match="cannot be written: File too large"):
        RunWriter(path, header)
    assert not path.exists()


@needs_limits
def test_disk_full_at_a_segment_end_is_an_error(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 2000))
    with file_size_limit(10), pytest.raises(StorageError, match="File too large"):
        writer.write_segment_end(SegmentEnd(0, 2000, EndReason.STOPPED))


@needs_limits
def test_disk_full_on_close_loses_no_sample(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 2000))
    writer.write_segment_end(SegmentEnd(0, 2000, EndReason.STOPPED))
    with file_size_limit(10), pytest.raises(StorageError, match="File too large"):
        writer.close()
    with RunReader(writer.path) as reader:
        assert reader.segment_ends == (SegmentEnd(0, 2000, EndReason.STOPPED),)
        assert not reader.is_complete
    writer.discard()
    assert not writer.path.exists()


def test_memory_stays_flat_during_a_long_run(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    psutil = pytest.importorskip("psutil")
    process = psutil.Process()
    writer = RunWriter(tmp_path / "run.mcap", header)
    blocks = [make_block(0, 0, 2000)]
    sizes = []
    for k in range(6000):  # ten minutes
        writer.write_block(SampleBlock(blocks[0].codes, 0, 2000 * k, 0))
        if k in (1000, 5999):
            sizes.append(process.memory_info().rss)
    writer.write_segment_end(SegmentEnd(0, 12_000_000, EndReason.FINISHED))
    writer.close()
    assert sizes[1] - sizes[0] < 10_000_000
    with RunReader(writer.path) as reader:
        before = process.memory_info().rss
        assert sum(item.n_samples for item in reader.items() if isinstance(item, SampleBlock)) == 12_000_000
        assert process.memory_info().rss - before < 20_000_000


def test_log_times_are_run_start_plus_sample_time(tmp_path: Path, header: RunHeader, make_block: MakeBlock) -> None:
    writer = RunWriter(tmp_path / "run.mcap", header)
    writer.write_block(make_block(0, 0, 3000))
    writer.write_segment_end(SegmentEnd(0, 3000, EndReason.OVERRUN, lost=1000))
    writer.write_block(make_block(1, 0, 3000))
    writer.write_segment_end(SegmentEnd(1, 3000, EndReason.STOPPED))
    writer.close()
    with writer.path.open("rb") as file:
        times = [message.log_time - header.started_ns for _, _, message in make_reader(file).iter_messages()]
    assert times == [0, 150_000_000, 200_000_000, 350_000_000]

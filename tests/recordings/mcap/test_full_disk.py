"""A run on a disk that becomes full is finished with its present content, and the error is reported."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.errors import StorageError
from recordings.integrity.verify import Verdict, verify
from recordings.mcap.reader import RunReader
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter

MakeBlock = Callable[..., SampleBlock]
CodesOf = Callable[..., NDArray[np.int16]]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a file system of 2 MB and return its folder."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if sys.platform == "win32" or os.geteuid() != 0 or shutil.which("mount") is None:
        pytest.skip("mounting a small file system needs root on Linux")
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)], capture_output=True, text=True, check=False
    )
    if mounted.returncode != 0:
        pytest.skip(f"a small file system cannot be mounted here: {mounted.stderr.strip()}")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def write_until_full(
    writer: RunWriter, header: RunHeader, make_block: MakeBlock, make_snapshot: Callable[..., Snapshot], first: int = 0
) -> tuple[int, str]:
    """Write blocks until the disk is full; return the number of samples given to the writer, and its error."""
    while True:
        try:
            writer.write_block(make_block(0, first, 2000))
        except StorageError as error:
            return first + 2000, str(error)
        first += 2000
        for result in encode_snapshot(make_snapshot(0, first), header):
            writer.add_result(result)


def test_run_on_a_full_disk_is_finished(
    small_disk: Path,
    header: RunHeader,
    make_block: MakeBlock,
    make_snapshot: Callable[..., Snapshot],
    codes_of: CodesOf,
) -> None:
    path = small_disk / "run.mcap"
    writer = RunWriter(path, header)
    n_given, message = write_until_full(writer, header, make_block, make_snapshot)
    assert message == f"{path}: cannot be written: No space left on device"
    assert verify(path).verdict is Verdict.INTACT
    with RunReader(path) as reader:
        assert reader.is_complete
        (end,) = reader.segment_ends
        assert (end.reason, end.detail, end.lost_is_exact) == (EndReason.RECORDER, message, False)
        assert end.samples + end.lost == n_given
        assert end.lost <= 0.25 * header.acquisition.rate
        assert not reader.is_gap_free
        assert reader.skipped_samples == end.samples
        np.testing.assert_array_equal(reader.samples(0, 0, end.samples), codes_of(0, 0, end.samples))
    assert path.stat().st_size > 1_500_000


def test_disk_full_from_the_start_is_an_error_and_leaves_no_file(small_disk: Path, header: RunHeader) -> None:
    (small_disk / "ballast").write_bytes(bytes(shutil.disk_usage(small_disk).free))
    with pytest.raises(StorageError, match=r"run\.mcap: cannot be written: No space left on device"):
        RunWriter(small_disk / "run.mcap", header)
    assert not (small_disk / "run.mcap").exists()


def test_run_is_finished_though_other_processes_fill_the_disk(
    small_disk: Path,
    header: RunHeader,
    make_block: MakeBlock,
    make_snapshot: Callable[..., Snapshot],
    codes_of: CodesOf,
) -> None:
    writer = RunWriter(small_disk / "run.mcap", header)
    first = 0
    for _ in range(20):
        writer.write_block(make_block(0, first, 2000))
        first += 2000
    (small_disk / "ballast").write_bytes(bytes(shutil.disk_usage(small_disk).free))
    _, message = write_until_full(writer, header, make_block, make_snapshot, first)
    assert "No space left on device" in message
    assert verify(writer.path).verdict is Verdict.INTACT
    with RunReader(writer.path) as reader:
        assert reader.is_complete
        np.testing.assert_array_equal(reader.samples(0, 0, reader.n_samples), codes_of(0, 0, reader.n_samples))

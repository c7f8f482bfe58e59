"""CPU time of writing and reading a run at 3 × 200 kS/s."""

import shutil
import statistics
import time
from pathlib import Path

import numpy as np
import pytest

from analysis.signals.blocks import SampleBlock
from recordings.mcap.reader import RunReader
from tests.benchmarks.recorded_samples import BLOCK, N_PARTS, RATE, bench_blocks, write_run

SECONDS = 60
PASSES = 5
HOUR = 3600
HOUR_BYTES = 2_000_000_000
N_READS = 40

pytestmark = pytest.mark.benchmark


def test_writing_and_reading_take_a_small_part_of_a_core(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    blocks = list(bench_blocks(SECONDS))
    megabytes = sum(block.codes.nbytes for block in blocks) / 1e6
    started = time.process_time()
    write_run(path, blocks)
    writing = time.process_time() - started
    readings = []
    for _ in range(PASSES):
        started = time.process_time()
        with RunReader(path) as reader:
            read = sum(item.n_samples for item in reader.items() if isinstance(item, SampleBlock))
        readings.append(time.process_time() - started)
        assert read == SECONDS * RATE
    reading = min(readings)  # the slower passes waited for caches
    size = path.stat().st_size / 1e6
    per_million = writing / (3 * SECONDS * RATE / 1e6)
    print(
        f"writing {megabytes / writing:.0f} MB of samples a second of CPU time: {per_million:.2%} of a core at 1 MS/s"
    )
    print(f"reading {megabytes / reading:.0f} MB of samples a second of CPU time, every checksum verified")
    print(f"file {size / megabytes:.2f} of the samples")
    assert per_million < 0.02
    assert megabytes / reading > 500
    assert size < 0.45 * megabytes


def test_any_second_of_an_hour_is_read_within_50_milliseconds(tmp_path: Path) -> None:
    if shutil.disk_usage(tmp_path).free < 2 * HOUR_BYTES:
        pytest.skip("an hour of samples needs 2 GB twice over")
    path = tmp_path / "hour.mcap"
    write_run(path, bench_blocks(HOUR))
    second = np.concatenate([block.codes for block in bench_blocks(1)], axis=1)
    assert second.shape[1] == N_PARTS * BLOCK == RATE
    random = np.random.default_rng(3)
    opened, reused, cpu = [], [], []
    try:
        for first in random.integers(0, int((HOUR - 1) * RATE), N_READS).tolist():
            started, cpu_started = time.perf_counter(), time.process_time()
            with RunReader(path) as reader:
                codes = reader.samples(0, first, first + int(RATE))
                opened.append(time.perf_counter() - started)
                cpu.append(time.process_time() - cpu_started)
                elsewhere = (first + int(1800 * RATE)) % int((HOUR - 1) * RATE)
                started = time.perf_counter()
                reader.samples(0, elsewhere, elsewhere + int(RATE))
                reused.append(time.perf_counter() - started)
            np.testing.assert_array_equal(codes, np.roll(second, -first, axis=1))
        print(f"an hour of 3 × 200 kS/s, {path.stat().st_size / 1e9:.2f} GB; one second of it, file opened for it:")
        print(f"  median {1e3 * statistics.median(opened):.0f} ms, worst {1e3 * max(opened):.0f} ms, ", end="")
        print(
            f"of CPU {1e3 * statistics.median(cpu):.0f} ms; from an open file {1e3 * statistics.median(reused):.1f} ms"
        )
    finally:
        path.unlink()
    assert statistics.median(opened) < 0.05
    assert statistics.median(reused) < 0.01

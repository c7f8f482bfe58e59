"""What recording and reading cost beside the samples they carry, at 3 × 200 kS/s."""

import math
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from analysis.run import Acquisition, AnalysisSettings, Channel, Device, Limits, Role, RunHeader, Tacho
from analysis.samples import EndReason, SampleBlock, SegmentEnd
from recordings.reader import RunReader
from recordings.writer import RunWriter

RATE = 200_000.0
SECONDS = 20
BLOCK = 20_000

pytestmark = pytest.mark.benchmark


@pytest.fixture
def header() -> RunHeader:
    roles = (Role.PROBE_X, Role.PROBE_Y, Role.TACHO)
    channels = tuple(
        Channel(role.value, role, f"ai{k}", -10.0, 10.0, (0.0, 10 / 32768)) for k, role in enumerate(roles)
    )
    acquisition = Acquisition(Device("simulated", "", "", "", simulated=True), RATE, 1e6, channels, Tacho(2.5, 1.0))
    limits = Limits(80e-6, 95e-6, 100e-6, 2000 * math.pi / 3)
    return RunHeader("run", "rig", 10**18, acquisition, AnalysisSettings(), limits, "", "rig")


def bench_blocks() -> Iterator[SampleBlock]:
    """Yield two sines at 9000 r/min with noise of 6 codes, and a tacho."""
    random = np.random.default_rng(0)
    turn = 150.0 * np.arange(10 * BLOCK) / RATE
    rows = [3000 + 2500 * np.sin(2 * np.pi * turn), 3000 + 2500 * np.cos(2 * np.pi * turn), 16_000.0 * (turn % 1 < 0.5)]
    codes = np.round(np.stack(rows) + 6 * random.standard_normal((3, 10 * BLOCK))).astype(np.int16)
    parts = [np.ascontiguousarray(codes[:, k * BLOCK : (k + 1) * BLOCK]) for k in range(10)]
    for k in range(int(SECONDS * RATE) // BLOCK):
        yield SampleBlock(parts[k % 10], 0, k * BLOCK, 0)


def test_writing_and_reading_take_a_small_part_of_a_core(tmp_path: Path, header: RunHeader) -> None:
    blocks = list(bench_blocks())
    megabytes = sum(block.codes.nbytes for block in blocks) / 1e6
    writer = RunWriter(tmp_path / "run.mcap", header)
    begun = time.process_time()
    for block in blocks:
        writer.block(block)
    writer.segment_end(SegmentEnd(0, int(SECONDS * RATE), EndReason.FINISHED))
    writer.close()
    writing = time.process_time() - begun
    begun = time.process_time()
    with RunReader(writer.path) as reader:
        read = sum(item.n_samples for item in reader.items() if isinstance(item, SampleBlock))
    reading = time.process_time() - begun
    size = writer.path.stat().st_size / 1e6
    print(f"writing {writing / SECONDS:.2%} of a core, {megabytes / writing:.0f} MB/s of CPU time")
    print(f"reading {reading / SECONDS:.2%} of a core, {megabytes / reading:.0f} MB/s of CPU time")
    print(f"file {size / megabytes:.2f} of the samples")
    assert read == SECONDS * RATE
    assert writing < 0.05 * SECONDS
    assert reading < 0.05 * SECONDS
    assert size < 0.45 * megabytes

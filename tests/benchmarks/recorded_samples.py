"""Samples that the benchmarks of recordings write: two probes and a tacho at 3 × 200 kS/s."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import Acquisition, AnalysisSettings, Channel, Device, Limits, Role, RunHeader, Tacho
from recordings.mcap.writer import RunWriter

RATE = 200_000.0
BLOCK = 20_000
N_PARTS = 10


def bench_header() -> RunHeader:
    """Return the header of a run with two probes and a tacho."""
    roles = (Role.PROBE_X, Role.PROBE_Y, Role.TACHO)
    channels = tuple(
        Channel(role.value, role, f"ai{k}", -10.0, 10.0, (0.0, 10 / 32768)) for k, role in enumerate(roles)
    )
    acquisition = Acquisition(Device("simulated", "", "", "", simulated=True), RATE, 1e6, channels, Tacho(2.5, 1.0))
    limits = Limits(80e-6, 95e-6, 100e-6, 2000 * math.pi / 3)
    return RunHeader("run", "rig", 10**18, acquisition, AnalysisSettings(), limits, "", "rig")


def bench_blocks(seconds: int) -> Iterator[SampleBlock]:
    """Yield two sines at 9000 r/min with noise of 6 codes, and a tacho; one second repeated."""
    random = np.random.default_rng(0)
    turn = 150.0 * np.arange(N_PARTS * BLOCK) / RATE
    rows = [3000 + 2500 * np.sin(2 * np.pi * turn), 3000 + 2500 * np.cos(2 * np.pi * turn), 16_000.0 * (turn % 1 < 0.5)]
    codes = np.round(np.stack(rows) + 6 * random.standard_normal((3, N_PARTS * BLOCK))).astype(np.int16)
    parts = [np.ascontiguousarray(codes[:, k * BLOCK : (k + 1) * BLOCK]) for k in range(N_PARTS)]
    for k in range(int(seconds * RATE) // BLOCK):
        yield SampleBlock(parts[k % N_PARTS], 0, k * BLOCK, 0)


def write_run(path: Path, blocks: Iterator[SampleBlock] | list[SampleBlock]) -> None:
    """Write blocks as a finished run."""
    writer = RunWriter(path, bench_header())
    n_samples = 0
    for block in blocks:
        writer.write_block(block)
        n_samples = block.end
    writer.write_segment_end(SegmentEnd(0, n_samples, EndReason.FINISHED))
    writer.close()

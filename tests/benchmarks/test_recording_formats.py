"""Speed and size of a run compared with the same samples in a plain file, TDMS, HDF5 and MDF.

All write blocks of 0.1 s and read int16 of all channels. Of these only HDF5 with Fletcher's checksum and the run
detect a flipped bit.
"""

import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import SampleBlock
from recordings.mcap.reader import RunReader
from tests.benchmarks.recorded_samples import BLOCK, RATE, bench_blocks, write_run

SECONDS = 30
N_SAMPLES = int(SECONDS * RATE)
NAMES = ("x", "y", "tacho")
PASSES = 3

Codes = NDArray[np.int16]
Blocks = list[SampleBlock]

pytestmark = pytest.mark.benchmark


@dataclass(frozen=True, slots=True)
class SampleFormat:
    """A file format for samples: writes blocks, reads samples from one index to another."""

    write: Callable[[Path, Blocks], None]
    read: Callable[[Path, int, int], Codes]
    suffix: str = ""


def write_plain(path: Path, blocks: Blocks) -> None:
    with path.open("wb") as file:
        for block in blocks:
            file.write(block.codes.tobytes())


def read_plain(path: Path, first: int, stop: int) -> Codes:
    block_codes, before = len(NAMES) * BLOCK, first // BLOCK
    n_blocks = -(-stop // BLOCK) - before
    values = np.fromfile(path, dtype=np.int16, offset=2 * block_codes * before, count=block_codes * n_blocks)
    rows = values.reshape(n_blocks, len(NAMES), BLOCK).transpose(1, 0, 2).reshape(len(NAMES), -1)
    return rows[:, first - before * BLOCK : stop - before * BLOCK]


def write_tdms(path: Path, blocks: Blocks) -> None:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        for block in blocks:
            rows = zip(NAMES, block.codes, strict=True)
            writer.write_segment([nptdms.ChannelObject("run", name, row) for name, row in rows])


def read_tdms(path: Path, first: int, stop: int) -> Codes:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsFile.open(path) as file:
        return np.stack([file["run"][name][first:stop] for name in NAMES])


def hdf5(**filters: Any) -> SampleFormat:
    """Return HDF5 with chunks of one block of one channel."""
    h5py = pytest.importorskip("h5py")

    def write(path: Path, blocks: Blocks) -> None:
        with h5py.File(path, "w") as file:
            shape, chunks = (len(NAMES), 0), (1, BLOCK)
            data = file.create_dataset("codes", shape, "<i2", maxshape=(len(NAMES), None), chunks=chunks, **filters)
            for block in blocks:
                data.resize(block.end, axis=1)
                data[:, block.first_sample : block.end] = block.codes

    def read(path: Path, first: int, stop: int) -> Codes:
        with h5py.File(path, "r") as file:
            codes: Codes = file["codes"][:, first:stop]
        return codes

    return SampleFormat(write, read)


def mdf(compression: int) -> SampleFormat:
    """Return MDF 4, written when the library saves the file; compression 2 is transposed and deflated."""
    asammdf: Any = pytest.importorskip("asammdf")

    def write(path: Path, blocks: Blocks) -> None:
        with asammdf.MDF(version="4.10") as file:
            for k, block in enumerate(blocks):
                times = np.arange(block.first_sample, block.end) / RATE
                if k:
                    file.extend(0, [(times, None), *((row, None) for row in block.codes)])
                else:
                    rows = zip(NAMES, block.codes, strict=True)
                    file.append([asammdf.Signal(row, times, name=name) for name, row in rows])
            file.save(path, overwrite=True, compression=compression)

    def read(path: Path, first: int, stop: int) -> Codes:
        with asammdf.MDF(path) as file:
            rows = [file.get(name, record_offset=first, record_count=stop - first, raw=True).samples for name in NAMES]
        return np.stack(rows)

    return SampleFormat(write, read, suffix=".mf4")  # the library appends it in any case


def read_run(path: Path, first: int, stop: int) -> Codes:
    with RunReader(path) as reader:
        return reader.samples(0, first, stop)


FORMATS: dict[str, Callable[[], SampleFormat]] = {
    "plain file": lambda: SampleFormat(write_plain, read_plain),
    "run (MCAP)": lambda: SampleFormat(write_run, read_run),
    "TDMS, nptdms": lambda: SampleFormat(write_tdms, read_tdms),
    "HDF5, h5py": hdf5,
    "HDF5 shuffle gzip": lambda: hdf5(shuffle=True, compression="gzip", compression_opts=1),
    "HDF5 ... Fletcher": lambda: hdf5(shuffle=True, compression="gzip", compression_opts=1, fletcher32=True),
    "HDF5 shuffle lzf": lambda: hdf5(shuffle=True, compression="lzf"),
    "MDF, asammdf": lambda: mdf(0),
    "MDF transp. deflate": lambda: mdf(2),
}


@dataclass(frozen=True, slots=True)
class Cost:
    """CPU time of writing all, reading all, and opening the file to read one second, s; size, bytes."""

    write: float
    read: float
    second: float
    size: int


def measured(sample_format: SampleFormat, path: Path, blocks: Blocks, expected: Codes) -> Cost:
    """Return the best of a few passes; asserts that the samples are read as written."""
    writing, reading, seeking = [], [], []
    for _ in range(PASSES):
        path.unlink(missing_ok=True)
        started = time.process_time()
        sample_format.write(path, blocks)
        writing.append(time.process_time() - started)
        started = time.process_time()
        codes = sample_format.read(path, 0, N_SAMPLES)
        reading.append(time.process_time() - started)
        np.testing.assert_array_equal(codes, expected)
        for first in (N_SAMPLES // 2, N_SAMPLES // 3, 123_457):
            started = time.process_time()
            codes = sample_format.read(path, first, first + int(RATE))
            seeking.append(time.process_time() - started)
            np.testing.assert_array_equal(codes, expected[:, first : first + int(RATE)])
    return Cost(min(writing), min(reading), min(seeking), path.stat().st_size)


def test_run_costs_less_than_formats_with_equal_protection(tmp_path: Path) -> None:
    if shutil.disk_usage(tmp_path).free < 1_000_000_000:
        pytest.skip("needs 1 GB of disk")
    blocks = list(bench_blocks(SECONDS))
    expected = np.concatenate([block.codes for block in blocks], axis=1)
    costs = {}
    for number, (name, make) in enumerate(FORMATS.items()):
        try:
            sample_format = make()
        except pytest.skip.Exception as missing:
            print(f"{name}: left out, {missing}")
            continue
        path = tmp_path / f"samples-{number}{sample_format.suffix}"
        costs[name] = measured(sample_format, path, blocks, expected)
        path.unlink()
    print(f"\n{expected.nbytes / 1e6:.0f} MB of samples; MB of samples a second of CPU time, times the plain file's:")
    print(f"{'':20} {'write':>13} {'read':>13} {'one second':>15} {'size':>6}")
    plain = costs["plain file"]
    for name, cost in costs.items():
        write, read = (expected.nbytes / 1e6 / seconds for seconds in (cost.write, cost.read))
        print(
            f"{name:20} {write:6.0f} {cost.write / plain.write:5.1f}x {read:6.0f} {cost.read / plain.read:5.1f}x "
            f"{1e3 * cost.second:6.1f} ms {cost.second / plain.second:4.0f}x {cost.size / expected.nbytes:6.2f}"
        )
    run = costs["run (MCAP)"]
    checked = costs["HDF5 ... Fletcher"]
    assert run.size < checked.size
    assert run.write < checked.write
    assert run.read < checked.read
    assert all(run.size < cost.size for name, cost in costs.items() if name != "run (MCAP)")

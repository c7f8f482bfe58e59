"""Files cut at any byte and with any byte changed: no traceback, no wrong sample, every intact chunk recovered."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from recordings.mcap.results import encode_snapshot
from recordings.mcap.writer import RunWriter
from tests.recordings.damage import examine

MakeBlock = Callable[..., SampleBlock]
CodesOf = Callable[..., NDArray[np.int16]]
BLOCK, N_BLOCKS = 400, 30
ALL = 2 * N_BLOCKS * BLOCK


@pytest.fixture
def data(tmp_path: Path, header: RunHeader, make_block: MakeBlock, make_snapshot: Callable[..., Snapshot]) -> bytearray:
    """Return the bytes of a run of two segments with results."""
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
    return bytearray(writer.path.read_bytes())


@pytest.mark.parametrize(
    ("n_cases", "seed"), [(12, 1), pytest.param(500, 2, marks=pytest.mark.campaign)], ids=["few", "full"]
)
def test_a_file_cut_at_a_random_byte_gives_all_samples_before_the_cut(
    tmp_path: Path, data: bytearray, codes_of: CodesOf, n_cases: int, seed: int
) -> None:
    cut = tmp_path / "cut.mcap"
    outcomes = []
    for length in np.sort(np.random.default_rng(seed).integers(0, len(data), n_cases)):
        cut.write_bytes(data[:length])
        outcomes.append(examine(cut, tmp_path / "copy.mcap", codes_of))
    read, recovered = [outcome.read for outcome in outcomes], [outcome.recovered for outcome in outcomes]
    print(f"{n_cases} cuts: {sum(o.opens for o in outcomes)} recovered, {sum(recovered)} samples right, 0 wrong")
    assert read == recovered == sorted(read)
    assert recovered[-1] > ALL / 2


@pytest.mark.parametrize(
    ("n_cases", "seed"), [(12, 3), pytest.param(100, 4, marks=pytest.mark.campaign)], ids=["few", "full"]
)
def test_a_changed_byte_costs_at_most_its_chunk(
    tmp_path: Path, data: bytearray, codes_of: CodesOf, n_cases: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    flipped = tmp_path / "flipped.mcap"
    outcomes = []
    for position in random.choice(len(data), n_cases, replace=False):
        changed = bytearray(data)
        changed[position] ^= int(random.integers(1, 256))
        flipped.write_bytes(changed)
        outcomes.append(examine(flipped, tmp_path / "copy.mcap", codes_of))
    recovered = [outcome.recovered for outcome in outcomes]
    print(
        f"{n_cases} changed bytes: {sum(o.opens for o in outcomes)} recovered, {sum(recovered)} samples right, 0 wrong"
    )
    assert all(outcome.opens for outcome in outcomes)
    assert min(recovered) >= ALL * 3 / 4
    assert max(recovered) == ALL


@pytest.mark.parametrize(
    ("n_cases", "seed"), [(8, 5), pytest.param(100, 6, marks=pytest.mark.campaign)], ids=["few", "full"]
)
def test_a_changed_byte_in_a_cut_file_is_recovered_from(
    tmp_path: Path, data: bytearray, codes_of: CodesOf, n_cases: int, seed: int
) -> None:
    random = np.random.default_rng(seed)
    flipped = tmp_path / "flipped.mcap"
    outcomes = []
    for length in random.integers(len(data) // 2, len(data), n_cases):
        changed = data[:length]
        changed[int(random.integers(8, length))] ^= int(random.integers(1, 256))
        flipped.write_bytes(changed)
        outcomes.append(examine(flipped, tmp_path / "copy.mcap", codes_of))
    print(f"{n_cases} cut and changed: {sum(o.opens for o in outcomes)} recovered")
    assert all(outcome.opens for outcome in outcomes)

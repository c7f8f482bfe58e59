"""The ring buffer between recorder and live analysis."""

import threading

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from daq.session.recording.ring import BlockRing, RingReader


def block(first: int, n: int, *, segment: int = 0) -> SampleBlock:
    codes = (np.arange(first, first + n) % 30000).astype(np.int16)
    return SampleBlock(np.stack([codes, -codes, codes // 2]), segment, first, 17, backlog=3)


def blocks_of(reader: RingReader) -> list[SampleBlock]:
    return [item for item in reader.available() if isinstance(item, SampleBlock)]


@pytest.fixture
def ring() -> BlockRing:
    return BlockRing.create(n_channels=3, capacity=100, n_slots=8)


def test_ring_in_the_same_memory_yields_the_items_put(ring: BlockRing) -> None:
    other = BlockRing(ring.memory)
    ring.put(block(0, 100))
    ring.put(SegmentEnd(0, 100, EndReason.OVERRUN, lost=7, lost_is_exact=False, detail="buffer ran over"))
    got, end = RingReader(other).available()
    assert isinstance(got, SampleBlock)
    np.testing.assert_array_equal(got.codes, block(0, 100).codes)
    assert (got.segment, got.first_sample, got.host_time_ns, got.backlog) == (0, 0, 17, 3)
    assert end == SegmentEnd(0, 100, EndReason.OVERRUN, lost=7, lost_is_exact=False, detail="buffer ran over")


def test_ring_splits_blocks_longer_than_a_slot(ring: BlockRing) -> None:
    reader = RingReader(ring)
    ring.put(block(0, 250))
    parts = blocks_of(reader)
    assert [p.first_sample for p in parts] == [0, 100, 200]
    np.testing.assert_array_equal(np.hstack([p.codes for p in parts]), block(0, 250).codes)
    assert reader.skipped == 0


def test_reader_that_falls_behind_counts_all_skipped_samples(ring: BlockRing) -> None:
    reader = RingReader(ring)
    for k in range(30):
        ring.put(block(100 * k, 100))
    seen = sum(item.n_samples for item in blocks_of(reader))
    assert seen > 0
    assert seen + reader.skipped == 3000


def test_reader_counts_samples_skipped_before_a_segment_end(ring: BlockRing) -> None:
    reader = RingReader(ring)
    for k in range(6):
        ring.put(block(100 * k, 100))
    assert sum(item.n_samples for item in blocks_of(reader)) == 600
    for k in range(20):
        ring.put(block(600 + 100 * k, 100))
    for segment in range(7):
        ring.put(SegmentEnd(segment, 2600 if segment == 0 else 0, EndReason.OVERRUN))
    assert all(isinstance(item, SegmentEnd) for item in reader.available())
    assert reader.skipped == 2000


def test_reader_never_sees_a_torn_block_of_a_fast_writer(ring: BlockRing) -> None:
    reader = RingReader(ring)

    def write() -> None:
        for k in range(4000):
            ring.put(block(100 * k, 100))
        ring.finish()

    writer = threading.Thread(target=write)
    writer.start()
    seen = 0
    while not (ring.is_closed and reader.lag == 0):
        for item in blocks_of(reader):
            np.testing.assert_array_equal(item.codes, block(item.first_sample, item.n_samples).codes)
            seen += item.n_samples
    writer.join(10)
    assert seen + reader.skipped == 400_000


def test_ring_refuses_blocks_with_another_number_of_channels(ring: BlockRing) -> None:
    with pytest.raises(ValueError, match="block of 2 channels: the ring holds 3"):
        ring.put(SampleBlock(np.zeros((2, 5), dtype=np.int16), 0, 0, 0))

"""Runs with counter timestamps of the tacho: through ring, file, trigger and parts, bit for bit."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from analysis.resampling.angular_record import angular_record_from_codes
from analysis.signals.blocks import SampleBlock, SourceItem
from analysis.signals.snapshot import CounterState, TachoState
from analysis.signals.units import RPM
from daq.config.schema import TriggerSection
from daq.drivers.factory import open_source
from daq.drivers.replay import ReplaySource
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.triggered import TriggerStart, apply_trigger
from daq.session.recording.recorded_run import RecordedRun
from daq.session.recording.ring import BlockRing, RingReader
from recordings.integrity.recover import recover
from recordings.integrity.verify import verify
from recordings.mcap.parts import PartLimits, PartWriter, file_ids
from recordings.mcap.reader import RunReader
from tests.daq.support.counted_bench import (
    RISING,
    RigFactory,
    analysed,
    counted,
    encoded_snapshots,
    header_of,
    items_of,
    recorded,
    ticks_of,
)
from tests.daq.support.reblocking import reblocked
from tests.daq.support.recording import NoModel, recording_request

SPEED = 6123.4567  # r/min, with a non-integer number of ticks per turn
STEADY = {
    "profile": [{"time_s": 0.0, "speed_rpm": SPEED}, {"time_s": 4.0, "speed_rpm": SPEED}],
    "speed_fluctuation": 0.0,
    "tacho_jitter_us": 0.0,
}


@pytest.fixture(name="counted")
def counted_rigs(rig: RigFactory) -> RigFactory:
    return partial(counted, rig)


def delay_stamps(items: Iterable[SourceItem]) -> list[SourceItem]:
    """Move every stamp to the block after its own, like a card with a late counter."""
    changed: list[SourceItem] = []
    waiting = np.empty(0, np.int64)
    for item in items:
        if isinstance(item, SampleBlock) and item.ticks is not None:
            changed.append(replace(item, ticks=waiting))
            waiting = item.ticks
        else:
            changed.append(item)
    return changed


def remove_stamps(items: list[SourceItem], block: int) -> list[SourceItem]:
    """Remove the stamps from a block on, like a counter that fails."""
    return [
        replace(item, ticks=None) if k >= block and isinstance(item, SampleBlock) else item
        for k, item in enumerate(items)
    ]


def test_speed_of_a_steady_run_is_right_to_a_millionth(counted: RigFactory, tmp_path: Path) -> None:
    path = recorded(counted(simulation=STEADY), tmp_path)
    with RunReader(path) as reader:
        speeds = np.array([snapshot.speed for snapshot in reader.snapshots()])
        settled = speeds[np.isfinite(speeds)]
        assert settled.size > 30
        np.testing.assert_allclose(settled, SPEED * RPM, rtol=1e-6)
        acquisition = reader.header.acquisition
        assert acquisition.tacho.counter is not None
        stamped = reader.ticks(0, 0, reader.n_samples) / acquisition.tacho.counter.timebase
        record = angular_record_from_codes(acquisition, reader.samples(0, 0, reader.n_samples), pulse_times=stamped)
    np.testing.assert_allclose(record.speeds, SPEED * RPM, rtol=1e-6)


def test_phase_from_the_counter_equals_that_from_the_samples(counted: RigFactory, tmp_path: Path) -> None:
    last = {}
    for reference in ("counter", "samples"):
        rig = counted(reference)
        last[reference] = [s for s in analysed(header_of(rig, tmp_path), items_of(rig)) if s.frame is not None][-1]
    one, other = last["counter"].frame, last["samples"].frame
    assert one is not None
    assert other is not None
    np.testing.assert_allclose(one.vectors[0], other.vectors[0], rtol=2e-3)
    assert abs(last["counter"].speed / last["samples"].speed - 1) < 1e-4


def test_counter_and_samples_agree(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    snapshot = analysed(header_of(rig, tmp_path), items_of(rig))[-1]
    assert snapshot.counter is not None
    assert snapshot.counter.state is CounterState.AGREES
    assert snapshot.counter.compared > 300
    assert abs(snapshot.counter.mean_difference) < 1e-6
    assert snapshot.counter.largest_difference < 0.25 / 20_000  # a quarter of the sample interval


@pytest.mark.parametrize("reference", ["counter", "samples"])
def test_stamps_are_read_back_from_the_file_bit_for_bit(counted: RigFactory, tmp_path: Path, reference: str) -> None:
    rig = counted(reference)
    items = items_of(rig)
    path = recorded(rig, tmp_path, items)
    source = ReplaySource(path, None)
    again = list(source.blocks())
    source.close()
    assert source.acquisition.tacho.counter == rig.tacho.counter
    assert source.acquisition.tacho.reference == reference
    for one, other in zip(items, again, strict=True):
        if isinstance(one, SampleBlock):
            assert isinstance(other, SampleBlock)
            assert one.ticks is not None
            np.testing.assert_array_equal(one.ticks, other.ticks)
    checked = verify(path)
    assert (checked.findings, checked.pulses) == ((), ticks_of(items).size)


@pytest.mark.parametrize("block", [11, 777, 5_001])
def test_results_do_not_depend_on_the_block_size(counted: RigFactory, tmp_path: Path, block: int) -> None:
    path = recorded(counted(simulation={"profile": RISING["profile"], "sensor_noise_um": 0.5}), tmp_path)
    with RunReader(path) as reader:
        header, live = reader.header, encoded_snapshots(reader.header, reader.snapshots())
    source = ReplaySource(path, None)
    assert encoded_snapshots(header, analysed(header, reblocked(source, block))) == live
    source.close()


@pytest.mark.parametrize("block", [None, 500, 1_777])
def test_results_with_a_late_counter_do_not_depend_on_the_block_size(
    counted: RigFactory, tmp_path: Path, block: int | None
) -> None:
    rig = counted()
    path = recorded(rig, tmp_path, delay_stamps(items_of(rig)))
    with RunReader(path) as reader:
        header, live = reader.header, encoded_snapshots(reader.header, reader.snapshots())
        snapshots = list(reader.snapshots())[10:]
    assert all(snapshot.tacho.state is TachoState.GOOD and snapshot.frame is not None for snapshot in snapshots)
    source = ReplaySource(path, None)
    assert encoded_snapshots(header, analysed(header, reblocked(source, block))) == live
    source.close()


@pytest.mark.parametrize("block", [None, 1_777])
def test_speed_comes_from_the_samples_after_the_counter_fails(
    counted: RigFactory, tmp_path: Path, block: int | None
) -> None:
    rig = counted()
    path = recorded(rig, tmp_path, remove_stamps(items_of(rig), 20))
    with RunReader(path) as reader:
        header, snapshots = reader.header, list(reader.snapshots())
    assert all(snapshot.tacho.state is TachoState.GOOD for snapshot in snapshots[10:])
    states = [snapshot.counter.state for snapshot in snapshots if snapshot.counter is not None]
    assert states == [CounterState.AGREES] * 20 + [CounterState.FAILED] * 20
    (finding,) = verify(path).findings
    assert "the tacho's counter failed" in finding.what
    assert not finding.is_fault
    source = ReplaySource(path, None)
    assert encoded_snapshots(header, analysed(header, reblocked(source, block))) == encoded_snapshots(header, snapshots)
    source.close()


def test_ring_carries_more_stamps_than_a_slot_holds() -> None:
    ring = BlockRing.create(3, 1_000, 16)
    codes = np.arange(9_000, dtype=np.int16).reshape(3, 3_000)
    many = np.arange(1_300, dtype=np.int64) * 50 + 7
    sent = [
        SampleBlock(codes, 0, 0, 1, 0, many),
        SampleBlock(codes, 0, 3_000, 2, 0, many[:0] + 1),
        SampleBlock(codes, 0, 6_000, 3, 0, None),
    ]
    reader = RingReader(ring)
    for block in sent:
        ring.put(block)
    got = list(reader.available())
    np.testing.assert_array_equal(ticks_of(got), many)
    blocks = [item for item in got if isinstance(item, SampleBlock)]
    np.testing.assert_array_equal(np.concatenate([block.codes for block in blocks], axis=1), np.tile(codes, 3))
    assert all((block.ticks is None) == (block.first_sample >= 6_000) for block in blocks)
    assert all(block.first_sample == 0 for block in blocks if block.ticks is not None and block.ticks.size)


def test_replay_of_a_recorded_run_gives_the_live_results(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    run = RecordedRun(recording_request(rig, tmp_path), NoModel())
    assert run.wait(60.0)
    assert run.close().ends[0].is_gap_free
    truth = ticks_of(items_of(rig))
    with RunReader(run.path) as reader:
        assert reader.skipped_samples == 0
        np.testing.assert_array_equal(ticks_of(reader.items()), truth)
        live = encoded_snapshots(reader.header, reader.snapshots())
        assert encoded_snapshots(reader.header, analysed(reader.header, reader.items())) == live
    assert verify(run.path).pulses == truth.size


class SkippedSampleCounter:
    """Counts the samples that a trigger skips."""

    def __init__(self) -> None:
        self.samples = 0

    def on_waiting(self, event: int, speed: float) -> None: ...

    def on_skipped(self, samples: int) -> None:
        self.samples += samples

    def on_start(self, start: TriggerStart) -> None: ...


def test_stamps_of_a_triggered_run_count_from_its_first_sample(counted: RigFactory) -> None:
    rig, watch = counted(), SkippedSampleCounter()
    section = TriggerSection(start="speed > 5000", stop="speed > 7000", pre_s=0.3, hold_s=0.1)
    source = apply_trigger(open_source(rig), section, watch)
    items = []
    for item in source.blocks():
        items.append(item)
        if len(items) == 1:
            begin = watch.samples
    source.close()
    samples = sum(item.n_samples for item in items if isinstance(item, SampleBlock))
    assert begin > 10_000
    np.testing.assert_array_equal(ticks_of(items), SimulatedCard(rig).ticks(begin, begin + samples, begin))


def test_stamps_of_a_part_count_from_its_first_sample(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    header = header_of(rig, tmp_path)
    path = tmp_path / f"{header.run}.mcap"
    writer = PartWriter(path, header, PartLimits(samples=30_000))
    for item in items_of(rig):
        if isinstance(item, SampleBlock):
            writer.write_block(item)
        else:
            writer.write_segment_end(item)
    writer.close()
    card, begin = SimulatedCard(rig), 0
    for name in file_ids(path):
        part = path.with_name(f"{name}.mcap")
        assert verify(part).is_intact
        with RunReader(part) as reader:
            np.testing.assert_array_equal(ticks_of(reader.items()), card.ticks(begin, begin + reader.n_samples, begin))
            begin += reader.n_samples
    assert begin == card.n_samples


def test_recovered_copy_has_the_stamps_of_its_samples(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    path = recorded(rig, tmp_path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    copy = tmp_path / "copy.mcap"
    recovered = recover(path, copy)
    assert verify(copy).is_intact
    with RunReader(copy) as reader:
        assert 0 < reader.n_samples == recovered.samples < 80_000
        ticks = reader.ticks(0, 0, reader.n_samples)
        np.testing.assert_array_equal(ticks, ticks_of(reader.items()))
        limit = reader.n_samples * reader.header.acquisition.ticks_per_sample
    truth = ticks_of(items_of(rig))
    np.testing.assert_array_equal(ticks, truth[truth < limit])


def test_recovered_stretches_have_the_stamps_of_their_samples(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    path = recorded(rig, tmp_path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 8] = bytes(8)
    path.write_bytes(data)
    assert not verify(path).is_intact
    copy = tmp_path / "copy.mcap"
    first, second = recover(path, copy).segments
    assert verify(copy).is_intact
    truth = ticks_of(items_of(rig))
    with RunReader(copy) as reader:
        per_sample = reader.header.acquisition.ticks_per_sample
        for stretch in (first, second):
            low, high = stretch.first * per_sample, stretch.stop * per_sample
            expected = truth[(truth >= low) & (truth < high)] - round(low)
            np.testing.assert_array_equal(reader.ticks(stretch.segment, 0, stretch.stop - stretch.first), expected)


def test_stamps_of_a_time_range_are_those_inside_it(counted: RigFactory, tmp_path: Path) -> None:
    rig = counted()
    path = recorded(rig, tmp_path)
    truth = ticks_of(items_of(rig))
    with RunReader(path) as reader:
        per_sample = reader.header.acquisition.ticks_per_sample
        for first, stop in ((0, 80_000), (12_345, 12_999), (50_000, 70_001), (60_000, 60_000)):
            expected = truth[(truth >= first * per_sample) & (truth < stop * per_sample)]
            np.testing.assert_array_equal(reader.ticks(0, first, stop), expected)

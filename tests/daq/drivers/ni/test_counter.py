"""Stamps of the tacho's edges by the card's counter: exact values, wraps, pauses and faults."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.config.devices import DEVICES
from daq.config.schema import CounterSection
from daq.drivers.ni import NiSource, open_ni_source
from daq.drivers.ni.source import CounterUnwrapper
from daq.drivers.simulation.card import SimulatedCard
from daq.errors import DeviceFault
from tests.daq.support.device_server import DeviceServer, serving
from tests.daq.support.ni_bench import bench, ends_of, refused, take
from tests.daq.support.ni_driver import NiDriver

COUNTER = CounterSection(reference="counter")
READ = "ReadCounterU32Ex"
COUNTER_WRAP = DEVICES["USB-6251"].counter_wrap


@pytest.fixture
def server() -> Iterator[DeviceServer]:
    with serving(NiDriver(lambda: SimulatedCard(bench(counter=COUNTER)))) as running:
        yield running


@pytest.fixture
def card(server: DeviceServer) -> Iterator[NiSource]:
    source = open_ni_source(bench(server.target, counter=COUNTER))
    yield source
    source.close()


def ticks_of(items: list[SourceItem], segment: int = 0) -> NDArray[np.int64]:
    blocks = [item for item in items if isinstance(item, SampleBlock) and item.segment == segment]
    return np.concatenate([np.empty(0, np.int64), *(block.ticks for block in blocks if block.ticks is not None)])


def test_stamps_are_the_true_edge_times_in_whole_ticks(card: NiSource) -> None:
    items = take(card, 20)
    n = ends_of(items)[0].samples
    np.testing.assert_array_equal(ticks_of(items), SimulatedCard(bench(counter=COUNTER)).ticks(0, n))
    assert ticks_of(items).size > 40
    assert card.acquisition.tacho.counter is not None
    assert card.acquisition.tacho.reference == "counter"


def test_each_stamp_comes_with_the_block_that_contains_its_edge(card: NiSource) -> None:
    per_sample = card.acquisition.ticks_per_sample
    for item in take(card, 10):
        if isinstance(item, SampleBlock):
            assert item.ticks is not None
            assert ((item.ticks >= item.first_sample * per_sample) & (item.ticks < item.end * per_sample)).all()


def test_counter_is_started_before_the_samples_and_waits_for_them(card: NiSource, server: DeviceServer) -> None:
    take(card, 2)
    counter, inputs = (server.log.index(call) for call in ("CreateCICountEdgesChan", "CreateAIVoltageChan"))
    assert inputs < counter
    starts = [k for k, call in enumerate(server.log) if call == "StartTask"]
    assert len(starts) == 2
    assert server.log.index("ReadBinaryI16") > starts[1]


def test_no_task_is_left_after_a_run_with_a_counter(card: NiSource, server: DeviceServer) -> None:
    assert sorted(server.tasks) == ["rig-Dev1", "rig-Dev1-counter"]
    take(card, 2)
    assert server.tasks == []


def test_counter_is_unwrapped_through_three_wraps_and_pauses_longer_than_one() -> None:
    corners = (
        (0, 600),
        (30, 600),
        (30.1, 0),
        (100, 0),
        (101, 900),
        (235, 900),
    )  # at rest for 70 s; a wrap: 53.7 s
    slow = bench(counter=COUNTER, rate=500.0, profile=corners)
    with serving(NiDriver(lambda: SimulatedCard(slow))) as server:
        rig = bench(server.target, counter=COUNTER, rate=500.0, profile=corners)
        config = rig.config.model_copy(update={"timing": rig.config.timing.model_copy(update={"block_s": 0.8})})
        source = open_ni_source(type(rig)(rig.path, config, rig.calibrations))
        items = take(source, 290)
        source.close()
    ticks = ticks_of(items)
    np.testing.assert_array_equal(ticks, SimulatedCard(slow).ticks(0, ends_of(items)[0].samples))
    assert ticks[-1] > 4 * COUNTER_WRAP
    assert np.diff(ticks).max() > COUNTER_WRAP
    assert ends_of(items)[0].detail == ""


@pytest.mark.parametrize("code", [-200279, -200141, -200545])
def test_counter_failure_loses_stamps_but_no_sample(card: NiSource, server: DeviceServer, code: int) -> None:
    server.faults[READ].extend([0, 0, 0, code])
    items = take(card, 8)
    blocks = [item for item in items if isinstance(item, SampleBlock)]
    (end,) = ends_of(items)
    assert (end.reason, end.samples, end.is_gap_free) == (EndReason.STOPPED, 8 * 1499, True)
    assert [block.ticks is None for block in blocks] == [False] * 3 + [True] * 5
    assert f"the tacho's counter ctr0 gave no timestamps from sample {4 * 1499} on" in end.detail
    assert f"the driver's text of {code}" in end.detail
    assert server.tasks == []


def test_counter_buffer_overflow_loses_no_sample(server: DeviceServer) -> None:
    card = open_ni_source(bench(server.target, counter=COUNTER))
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 2:
            (task,) = (task for task in server.rpcs.tasks.values() if task.counter is not None)
            assert task.counter is not None
            task.counter.latched += range(task.counter.latched[-1] + 1, task.counter.latched[-1] + task.buffer + 2)
        if len(items) == 6:
            card.stop()
    card.close()
    (end,) = ends_of(items)
    assert (end.samples, end.is_gap_free) == (6 * 1499, True)
    assert "the buffer was overwritten" in end.detail


def test_overrun_of_the_samples_restarts_the_count(card: NiSource, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, 0, 0, -200279])
    items = take(card, 8)
    first, second = ends_of(items)
    assert (first.reason, second.detail) == (EndReason.OVERRUN, "")
    truth = SimulatedCard(bench(counter=COUNTER))
    for end in (first, second):
        np.testing.assert_array_equal(ticks_of(items, end.segment), truth.ticks(0, end.samples))


def test_counter_that_failed_works_again_in_the_next_segment(card: NiSource, server: DeviceServer) -> None:
    server.faults[READ].extend([0, -200279])
    server.faults["ReadBinaryI16"].extend([0, 0, 0, -200279])
    items = take(card, 8)
    first, second = ends_of(items)
    assert "gave no timestamps from sample 2998 on" in first.detail
    assert second.detail == ""
    assert ticks_of(items, 1).size > 0


def test_last_block_has_its_stamps_if_reading_the_backlog_fails(card: NiSource, server: DeviceServer) -> None:
    server.faults["GetReadAttributeUInt32"].extend([0, 0, -200545])
    items = list(card.blocks())
    (end,) = ends_of(items)
    assert end.samples == 3 * 1499
    assert "gave no timestamps" not in end.detail
    np.testing.assert_array_equal(ticks_of(items), SimulatedCard(bench(counter=COUNTER)).ticks(0, end.samples))


def test_counter_that_does_not_start_loses_no_sample(card: NiSource, server: DeviceServer) -> None:
    server.faults["StartTask"].append(-200545)
    items = take(card, 3)
    (end,) = ends_of(items)
    assert (end.samples, end.is_gap_free) == (3 * 1499, True)
    assert "gave no timestamps from sample 0 on" in end.detail
    assert all(item.ticks is None for item in items if isinstance(item, SampleBlock))


def test_counter_of_another_clock_is_detected(card: NiSource, server: DeviceServer) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 3:
            (task,) = (task for task in server.rpcs.tasks.values() if task.counter is not None)
            assert task.counter is not None
            task.counter.latched.append(task.counter.latched[-1] + 10 * 80_000_000)
        if len(items) == 6:
            card.stop()
    (end,) = ends_of(items)
    assert "another clock or did not start with them" in end.detail
    assert end.is_gap_free


def test_busy_counter_is_reported_and_nothing_stays_reserved(server: DeviceServer) -> None:
    server.driver.counter_held_elsewhere = True
    error = refused(bench(server.target, counter=COUNTER))
    assert error.fault is DeviceFault.BUSY
    assert server.tasks == []


@pytest.mark.parametrize("code", [-89120, -200077, -200220])
def test_counter_that_cannot_be_set_up_leaves_nothing_reserved(server: DeviceServer, code: int) -> None:
    server.faults["CreateCICountEdgesChan"].append(code)
    assert str(code) in str(refused(bench(server.target, counter=COUNTER)))
    assert server.tasks == []


def test_frozen_server_ends_a_run_with_counter_and_both_tasks_are_cleared(card: NiSource, server: DeviceServer) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 3:
            server.freeze()
    (end,) = ends_of(items)
    assert (end.reason, end.samples) == (EndReason.DEVICE_ERROR, 3 * 1499)
    card.close()
    server.thaw()
    again = open_ni_source(bench(server.target, counter=COUNTER))
    assert isinstance(take(again, 1)[-1], SegmentEnd)
    again.close()
    assert server.tasks == []


def test_unwrapped_counts_rise_through_every_wrap() -> None:
    rng = np.random.default_rng(7)
    truth = np.cumsum(rng.integers(1, COUNTER_WRAP, 200))
    unwrapping = CounterUnwrapper(COUNTER_WRAP)
    for part in np.array_split(truth, 23):
        np.testing.assert_array_equal(unwrapping.ticks((part % COUNTER_WRAP).astype(np.uint32)), part)


def test_counts_after_a_pause_of_many_wraps_match_the_samples() -> None:
    unwrapping = CounterUnwrapper(COUNTER_WRAP)
    assert unwrapping.ticks(np.array([17], np.uint32)).tolist() == [17]
    for wraps in (1, 2, 5, 1000):
        tick = wraps * COUNTER_WRAP + 5
        unwrapping.no_edge_before(tick - 1000)
        assert unwrapping.ticks(np.array([5], np.uint32)).tolist() == [tick]
    assert math.isclose(COUNTER_WRAP / 80e6, 53.687, abs_tol=1e-3)

"""Blocks of the NI source, and stopping and closing it."""

import threading
import time

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Role
from daq.drivers.ni import NiSource, open_ni_source
from daq.drivers.simulation.card import SimulatedCard
from tests.daq.support.device_server import DeviceServer
from tests.daq.support.ni_bench import CALIBRATION, RATE, bench, codes_of, ends_of, take


def test_codes_equal_those_of_the_card_bit_for_bit(card: NiSource) -> None:
    items = take(card, 20)
    assert [type(item) for item in items] == [SampleBlock] * 20 + [SegmentEnd]
    got = codes_of(items)
    np.testing.assert_array_equal(got, SimulatedCard(bench()).next_codes(got.shape[1]))
    assert got.dtype == np.int16
    assert ends_of(items) == [SegmentEnd(0, got.shape[1], EndReason.STOPPED)]


def test_blocks_have_one_size_and_are_contiguous(card: NiSource) -> None:
    before = time.time_ns()
    blocks = [item for item in take(card, 10) if isinstance(item, SampleBlock)]
    size = round(card.acquisition.rate * 0.05)
    assert [block.first_sample for block in blocks] == list(range(0, 10 * size, size))
    assert all(block.codes.shape == (3, size) and block.codes.flags.c_contiguous for block in blocks)
    assert all(before <= block.host_time_ns <= time.time_ns() for block in blocks)
    assert all(np.shares_memory(block.codes, other.codes) == (block is other) for block in blocks for other in blocks)


def test_reopened_card_counts_from_zero_and_gives_the_same_codes(card: NiSource, server: DeviceServer) -> None:
    first = take(card, 3)
    card.close()
    second = open_ni_source(bench(server.target))
    again = take(second, 3)
    second.close()
    assert isinstance(again[0], SampleBlock)
    assert (again[0].segment, again[0].first_sample) == (0, 0)
    np.testing.assert_array_equal(codes_of(first), codes_of(again))


def test_acquisition_has_the_coerced_settings_of_the_device(card: NiSource, server: DeviceServer) -> None:
    got, played = card.acquisition, server.driver.acquisition
    assert got.rate == played.rate != RATE
    assert got.convert_rate == played.convert_rate
    assert got.buffer == 4 * RATE
    assert [channel.scaling for channel in got.channels] == [channel.scaling for channel in played.channels]
    assert [(c.range_low, c.range_high) for c in got.channels] == [(-10, 10), (-10, 10), (-5, 5)]
    assert [(c.name, c.role, c.physical) for c in got.channels] == [
        ("x", Role.PROBE_X, "ai0"),
        ("y", Role.PROBE_Y, "ai1"),
        ("tacho", Role.TACHO, "ai2"),
    ]
    assert got.channels[1].angle == pytest.approx(np.pi / 2)
    assert [c.calibration for c in got.channels] == [CALIBRATION, CALIBRATION, None]
    assert (got.device.backend, got.device.product, got.device.serial) == ("nidaqmx", "USB-6251", "1A2B3C")
    assert got.device.driver == f"NI-DAQmx 24.5.1 at device server {server.target}"
    assert got.device.simulated


def test_channels_have_the_configured_terminals_and_buffer(server: DeviceServer) -> None:
    source = open_ni_source(bench(server.target))
    (task,) = server.rpcs.tasks.values()
    source.close()
    assert [channel.terminal for channel in task.channels] == [10106, 10106, 10083]
    assert task.buffer == 4 * RATE
    assert task.continuous


def test_block_needs_one_read_and_one_backlog_call(card: NiSource, server: DeviceServer) -> None:
    server.log.clear()
    take(card, 5)
    assert server.log == [
        "StartTask",
        *["ReadBinaryI16", "GetReadAttributeUInt32"] * 5,
        "GetReadAttributeUInt64",
        "ClearTask",
    ]


def test_backlog_is_the_number_of_unread_samples(server: DeviceServer) -> None:
    server.driver.real_time = True
    source = open_ni_source(bench(server.target))
    stream = source.blocks()
    next(stream)
    server.driver.ahead = 5000
    block = next(stream)
    source.close()
    assert isinstance(block, SampleBlock)
    assert block.backlog >= 3000


# Stopping and closing


def test_stop_from_another_thread_ends_within_a_block_with_every_sample_read(server: DeviceServer) -> None:
    server.driver.real_time = True
    source = open_ni_source(bench(server.target))
    stop_times: list[int] = []

    def stop() -> None:
        time.sleep(0.02)  # in the middle of a block
        stop_times.append(time.time_ns())
        source.stop()

    items: list[SourceItem] = []
    for item in source.blocks():
        items.append(item)
        if len(items) == 3:
            threading.Thread(target=stop).start()
    source.close()
    late = [item for item in items if isinstance(item, SampleBlock) and item.host_time_ns > stop_times[0]]
    assert len(late) <= 1
    got = codes_of(items)
    np.testing.assert_array_equal(got, SimulatedCard(bench()).next_codes(got.shape[1]))
    assert ends_of(items) == [SegmentEnd(0, got.shape[1], EndReason.STOPPED)]
    assert server.tasks == []


def test_stop_before_the_start_gives_an_empty_segment(card: NiSource) -> None:
    card.stop()
    assert list(card.blocks()) == [SegmentEnd(0, 0, EndReason.STOPPED)]


def test_close_may_be_called_twice_and_before_reading(card: NiSource, server: DeviceServer) -> None:
    card.close()
    card.close()
    assert server.tasks == []
    assert server.log.count("ClearTask") == 1


def test_close_from_another_thread_waits_for_the_read_and_ends_the_blocks(server: DeviceServer) -> None:
    server.driver.real_time = True
    source = open_ni_source(bench(server.target))
    closing = threading.Thread(target=source.close)
    items: list[SourceItem] = []
    for item in source.blocks():
        items.append(item)
        if len(items) == 2:
            closing.start()
    closing.join()
    (end,) = ends_of(items)
    assert end.reason is EndReason.STOPPED
    assert end.samples == codes_of(items).shape[1] >= 2 * 1499
    assert server.tasks == []


def test_abandoned_iterator_releases_the_card(card: NiSource, server: DeviceServer) -> None:
    stream = card.blocks()
    next(stream)
    del stream
    assert server.tasks == []


def test_blocks_may_be_called_once(card: NiSource) -> None:
    take(card, 1)
    with pytest.raises(RuntimeError, match="second time"):
        card.blocks()

"""Faults during a run: each ends a segment with its reason and its loss."""

import math
import time

import numpy as np
import pytest

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.drivers.ni import NiSource, open_ni_source
from daq.drivers.ni.card import NiCard
from daq.drivers.simulation.card import SimulatedCard
from tests.daq.support.device_server import DeviceServer
from tests.daq.support.ni_bench import bench, codes_of, ends_of, take


@pytest.mark.parametrize("code", [-200279, -200222, -200361, -200010, -200019, -200714])
def test_overrun_ends_the_segment_with_code_and_text_and_starts_the_next(
    card: NiSource, server: DeviceServer, code: int
) -> None:
    server.faults["ReadBinaryI16"].extend([0, 0, code])
    items = take(card, 5)
    first, second = ends_of(items)
    size = round(card.acquisition.rate * 0.05)
    assert (first.segment, first.samples, first.reason) == (0, 2 * size, EndReason.OVERRUN)
    assert not first.lost_is_exact
    assert f"the driver's text of {code}" in first.detail
    assert (second.segment, second.samples, second.reason) == (1, 3 * size, EndReason.STOPPED)
    restarted = [item for item in items if isinstance(item, SampleBlock) and item.segment == 1]
    assert [block.first_sample for block in restarted] == [0, size, 2 * size]


def test_card_that_does_not_start_gives_an_empty_segment_and_is_released(card: NiSource, server: DeviceServer) -> None:
    server.faults["StartTask"].append(-50103)
    (end,) = list(card.blocks())
    assert isinstance(end, SegmentEnd)
    assert (end.segment, end.samples, end.reason) == (0, 0, EndReason.DEVICE_ERROR)
    assert "another program holds the card" in end.detail
    assert server.tasks == []


def test_overrun_reports_the_minimum_number_of_lost_samples(card: NiSource, server: DeviceServer) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 2:
            server.driver.stall(130_000)  # the buffer holds 120,000
        if isinstance(item, SegmentEnd):
            card.stop()
    first = ends_of(items)[0]
    assert first.reason is EndReason.OVERRUN
    assert first.lost == 130_000 + 1499  # plus the block that was due
    assert not first.lost_is_exact
    assert not first.is_gap_free


def test_overrun_with_unknown_loss_is_still_a_gap(card: NiSource, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279])
    server.faults["GetReadAttributeUInt64"].append(-200279)
    first = ends_of(take(card, 2))[0]
    assert first.lost == 0
    assert not first.is_gap_free


def test_repeated_overruns_end_the_run(card: NiSource, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279] * 20)
    items = list(card.blocks())
    assert [end.segment for end in ends_of(items)] == [0, 1, 2, 3, 4, 5]
    assert server.tasks == []


def test_failed_start_after_an_overrun_ends_the_run(card: NiSource, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279])
    server.faults["StartTask"].extend([0, -200545])
    first, second = ends_of(list(card.blocks()))
    assert (first.reason, second.reason) == (EndReason.OVERRUN, EndReason.DEVICE_ERROR)
    assert (second.segment, second.samples) == (1, 0)
    assert server.tasks == []


def test_failed_stop_after_an_overrun_ends_the_run(card: NiSource, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279])
    server.faults["StopTask"].append(-88710)
    del server.driver.devices["Dev1"]
    first, second = ends_of(list(card.blocks()))
    assert (first.reason, second.reason) == (EndReason.OVERRUN, EndReason.UNPLUGGED)
    assert server.tasks == []


@pytest.mark.parametrize("code", [-88710, -88709, -201003, -200220, -50405, -200284])
def test_card_that_is_no_longer_listed_is_unplugged(card: NiSource, server: DeviceServer, code: int) -> None:
    del server.driver.devices["Dev1"]
    server.faults["ReadBinaryI16"].extend([0, code])
    (end,) = ends_of(list(card.blocks()))
    assert end.reason is EndReason.UNPLUGGED
    assert end.detail.startswith("the card is disconnected: ")
    assert str(code) in end.detail
    assert server.tasks == []


def test_listed_card_that_fails_its_self_test_is_unplugged(card: NiSource, server: DeviceServer) -> None:
    server.driver.passes_self_test = False
    server.faults["ReadBinaryI16"].extend([0, -88710])
    assert ends_of(list(card.blocks()))[0].reason is EndReason.UNPLUGGED


def test_card_plugged_in_again_at_once_is_still_reported_as_unplugged(card: NiSource, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -201003])
    assert ends_of(list(card.blocks()))[0].reason is EndReason.UNPLUGGED


@pytest.mark.parametrize("code", [-88710, -50103, -200077, -200545, -299_999])
def test_other_faults_of_a_connected_card_are_device_errors(card: NiSource, server: DeviceServer, code: int) -> None:
    server.faults["ReadBinaryI16"].extend([0, 0, 0, code])
    items = list(card.blocks())
    (end,) = ends_of(items)
    assert end.reason is EndReason.DEVICE_ERROR
    assert end.samples == codes_of(items).shape[1] > 0
    assert f"the driver's text of {code}" in end.detail
    assert f"(driver code {code})" in end.detail
    assert not end.is_gap_free
    assert server.tasks == []


def test_samples_before_a_time_out_are_delivered_and_reading_continues(card: NiSource, server: DeviceServer) -> None:
    server.driver.late.extend([1499, 700, 1499])
    items = take(card, 4)
    blocks = [item for item in items if isinstance(item, SampleBlock)]
    assert [block.n_samples for block in blocks] == [1499, 700, 1499, 1499]
    np.testing.assert_array_equal(codes_of(items), SimulatedCard(bench()).next_codes(1499 * 3 + 700))
    assert ends_of(items) == [SegmentEnd(0, 1499 * 3 + 700, EndReason.STOPPED)]


def test_card_without_any_samples_is_a_device_error(card: NiSource, server: DeviceServer) -> None:
    server.driver.late.extend([1499, 0])
    (end,) = ends_of(list(card.blocks()))
    assert (end.reason, end.samples) == (EndReason.DEVICE_ERROR, 1499)
    assert "no samples arrived in time" in end.detail


def test_block_is_delivered_if_reading_the_backlog_fails(card: NiSource, server: DeviceServer) -> None:
    server.faults["GetReadAttributeUInt32"].extend([0, -200545])
    items = list(card.blocks())
    assert codes_of(items).shape[1] == ends_of(items)[0].samples == 2 * 1499
    assert ends_of(items)[0].reason is EndReason.DEVICE_ERROR


def test_killed_server_ends_the_segment_and_close_does_not_fail(card: NiSource, server: DeviceServer) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 3:
            server.kill()
    (end,) = ends_of(items)
    assert (end.reason, end.samples, end.is_gap_free) == (EndReason.DEVICE_ERROR, 3 * 1499, False)
    assert f"device server {server.target} cannot be reached" in end.detail
    card.close()


def test_frozen_server_ends_the_segment_by_the_deadline_and_its_task_is_cleared_after_the_thaw(
    server: DeviceServer,
) -> None:
    patient = bench(server.target, deadline_s=2.0)  # s: longer than a busy machine delays a call
    card = open_ni_source(patient)
    items: list[SourceItem] = []
    frozen_at = math.inf
    for item in card.blocks():
        items.append(item)
        if len(items) == 3:
            server.freeze()
            frozen_at = time.monotonic()
    (end,) = ends_of(items)
    assert time.monotonic() - frozen_at < 30
    assert (end.reason, end.samples) == (EndReason.DEVICE_ERROR, 3 * 1499)
    assert "did not respond within its deadline" in end.detail
    card.close()
    server.thaw()
    again = open_ni_source(patient)
    assert ends_of(take(again, 1))[0].reason is EndReason.STOPPED
    again.close()
    assert server.tasks == []


def test_sample_count_that_differs_from_the_drivers_is_reported(card: NiSource, server: DeviceServer) -> None:
    server.driver.miscount = 17
    (end,) = ends_of(take(card, 2))
    assert (end.reason, end.lost, end.lost_is_exact) == (EndReason.OVERRUN, 17, True)
    assert "the driver counts 3015 delivered samples, but 2998 were received" in end.detail


def test_counts_are_compared_every_second_and_a_difference_ends_the_segment(
    card: NiSource, server: DeviceServer
) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 25:  # of 0.05 s: after the first comparison
            server.driver.miscount = 17
        if isinstance(item, SegmentEnd):
            server.driver.miscount = 0
        if len(items) == 60:
            card.stop()
    lost, stopped = ends_of(items)
    assert (lost.reason, lost.samples, lost.lost) == (EndReason.OVERRUN, 42 * 1499, 17)
    assert "the driver counts" in lost.detail
    assert (stopped.segment, stopped.reason, stopped.samples) == (1, EndReason.STOPPED, 17 * 1499)


def test_constant_count_offset_is_reported_only_at_the_stop(card: NiSource, server: DeviceServer) -> None:
    server.driver.miscount = 17
    (end,) = ends_of(take(card, 80))
    assert (end.reason, end.samples, end.lost) == (EndReason.OVERRUN, 80 * 1499, 17)


def test_driver_count_below_ours_is_a_device_error(card: NiSource, server: DeviceServer) -> None:
    server.driver.miscount = -17
    (end,) = ends_of(take(card, 2))
    assert (end.reason, end.is_gap_free) == (EndReason.DEVICE_ERROR, False)


def test_unreadable_driver_count_is_reported(card: NiSource, server: DeviceServer) -> None:
    server.faults["GetReadAttributeUInt64"].append(-200545)
    (end,) = ends_of(take(card, 2))
    assert end.reason is EndReason.STOPPED
    assert "could not be read" in end.detail


def test_closed_card_is_not_reported_as_unplugged(server: DeviceServer) -> None:
    card = NiCard(bench(server.target))
    card.close()
    assert card.is_present()

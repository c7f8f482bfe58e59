"""Reconnecting to a disconnected card; the run continues in the next segment."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from analysis.signals.blocks import EndReason, SampleBlock, SourceItem
from daq.config.rig import Rig
from daq.config.schema import SessionSection
from daq.drivers.factory import open_source
from daq.drivers.simulation.card import SimulatedCard
from daq.drivers.source import Source
from tests.daq.support.device_server import DeviceServer, serving
from tests.daq.support.ni_bench import bench, codes_of, ends_of
from tests.daq.support.ni_driver import NiDriver

BLOCK = 1499


def reconnecting_rig(target: str, *, restarts: int = 5, reconnect: float = 5.0) -> Rig:
    rig = bench(target)
    session = SessionSection(restarts_per_minute=restarts, reconnect_s=reconnect, retry_s=0.2)
    return replace(rig, config=rig.config.model_copy(update={"session": session}))


@contextmanager
def opened(rig: Rig) -> Iterator[Source]:
    source = open_source(rig)
    try:
        yield source
    finally:
        source.close()


def take(source: Source, blocks: int) -> list[SourceItem]:
    items: list[SourceItem] = []
    for item in source.blocks():
        items.append(item)
        if sum(isinstance(each, SampleBlock) for each in items) == blocks:
            source.stop()
    return items


def blocks_of(items: list[SourceItem], segment: int) -> list[SourceItem]:
    return [item for item in items if isinstance(item, SampleBlock) and item.segment == segment]


def test_card_plugged_in_again_continues_in_the_next_segment(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target)) as source:
        device = server.driver.devices.pop("Dev1")
        server.faults["ReadBinaryI16"].extend([0, 0, -88710])
        threading.Timer(0.8, lambda: server.driver.devices.update(Dev1=device)).start()
        items = take(source, 5)
    lost, stopped = ends_of(items)
    assert (lost.segment, lost.samples, lost.reason) == (0, 2 * BLOCK, EndReason.UNPLUGGED)
    assert "(driver code -88710)" in lost.detail
    assert not lost.is_gap_free
    assert (stopped.segment, stopped.samples, stopped.reason) == (1, 3 * BLOCK, EndReason.STOPPED)
    again = codes_of(blocks_of(items, 1))
    np.testing.assert_array_equal(again, SimulatedCard(bench()).next_codes(3 * BLOCK))
    assert server.tasks == []


def test_card_that_does_not_come_back_ends_the_run_with_the_reason(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target, reconnect=0.5)) as source:
        del server.driver.devices["Dev1"]
        server.faults["ReadBinaryI16"].extend([0, -201003])
        lost, gone = ends_of(list(source.blocks()))
    assert lost.reason is EndReason.UNPLUGGED
    assert (gone.segment, gone.samples, gone.reason) == (1, 0, EndReason.UNPLUGGED)
    assert gone.detail.startswith("the device did not come back within 0.5 s (session.reconnect_s): no USB-6251")
    assert server.tasks == []


def test_reconnect_time_of_zero_ends_the_run_at_once(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target, reconnect=0.0)) as source:
        server.faults["ReadBinaryI16"].extend([0, -201003])
        (end,) = ends_of(list(source.blocks()))
    assert end.reason is EndReason.UNPLUGGED
    assert server.tasks == []


def test_first_fault_ends_the_run_if_no_new_segment_is_allowed(server: DeviceServer) -> None:
    for code in (-201003, -200279):
        with opened(reconnecting_rig(server.target, restarts=0)) as source:
            server.faults["ReadBinaryI16"].extend([0, code])
            (end,) = ends_of(list(source.blocks()))
        assert end.detail.endswith("the run ends here: every fault ends the run (session.restarts_per_minute)")


def test_restart_limit_counts_all_faults_together(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target, restarts=3)) as source:
        server.faults["ReadBinaryI16"].extend([0, -200279, 0, -201003] * 4)
        ends = ends_of(list(source.blocks()))
    assert [end.segment for end in ends] == [0, 1, 2, 3]
    assert "the run ends here: 3 new segments in a minute" in ends[-1].detail
    assert server.tasks == []


def test_card_held_by_another_program_ends_the_run(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target)) as source:
        server.faults["ReadBinaryI16"].extend([0, -201003])
        server.driver.held_elsewhere = True
        _, busy = ends_of(list(source.blocks()))
    assert (busy.segment, busy.samples, busy.reason) == (1, 0, EndReason.DEVICE_ERROR)
    assert "another program holds the card" in busy.detail
    assert server.tasks == []


def test_another_card_is_not_recorded_under_the_runs_header(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target)) as source:
        server.faults["ReadBinaryI16"].extend([0, -201003])
        server.driver.devices["Dev1"] = ("USB-6251", 0xABC)
        _, other = ends_of(list(source.blocks()))
    assert "another card was connected, USB-6251 ABC instead of USB-6251 1A2B3C" in other.detail
    assert server.tasks == []


def test_server_that_freezes_and_thaws_continues_in_the_next_segment(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target)) as source:
        items: list[SourceItem] = []
        for item in source.blocks():
            items.append(item)
            if len(items) == 2:
                server.freeze()
                threading.Timer(2.5, server.thaw).start()
            if len(items) == 5:
                source.stop()
    frozen, stopped = ends_of(items)
    assert (frozen.samples, frozen.reason, frozen.lost_is_exact) == (2 * BLOCK, EndReason.DEVICE_ERROR, False)
    assert (stopped.segment, stopped.samples, stopped.reason) == (1, 2 * BLOCK, EndReason.STOPPED)
    assert server.tasks == []


def test_restarted_server_continues_in_the_next_segment(driver: NiDriver) -> None:
    with serving(driver) as first:
        source = open_source(reconnecting_rig(first.target))
        items: list[SourceItem] = []
        for item in source.blocks():
            items.append(item)
            if len(items) == 2:
                first.kill()
                port = int(first.target.rpartition(":")[2])
                second = DeviceServer(NiDriver(lambda: SimulatedCard(bench())), port=port)
            if len(items) == 5:
                source.stop()
        source.close()
    gone, stopped = ends_of(items)
    assert (gone.samples, gone.reason) == (2 * BLOCK, EndReason.DEVICE_ERROR)
    assert (stopped.segment, stopped.samples, stopped.reason) == (1, 2 * BLOCK, EndReason.STOPPED)
    assert second.tasks == []
    second.kill()


def test_stop_ends_the_wait_at_once(server: DeviceServer) -> None:
    with opened(reconnecting_rig(server.target, reconnect=60.0)) as source:
        del server.driver.devices["Dev1"]
        server.faults["ReadBinaryI16"].extend([0, -201003])
        stopped_at = 0.0
        ends = []
        for item in source.blocks():
            if not isinstance(item, SampleBlock):
                ends.append(item)
                threading.Timer(0.4, source.stop).start()
                stopped_at = time.monotonic() + 0.4
        assert time.monotonic() - stopped_at < 1.0
    assert [end.reason for end in ends] == [EndReason.UNPLUGGED]
    assert server.tasks == []

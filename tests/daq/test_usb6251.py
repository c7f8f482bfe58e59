"""The driver of the card against a stand-in device server: the real nidaqmx, over a real wire."""

import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.run import Calibration, Role
from analysis.samples import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.config.rig import Rig
from daq.config.schema import (
    Backend,
    ChannelSection,
    DeviceSection,
    ProfilePoint,
    RigConfig,
    SimulationSection,
    TimingSection,
)
from daq.drivers.simulated_card import SimulatedCard
from daq.drivers.usb6251 import Usb6251, open_usb6251
from daq.errors import DeviceError, DeviceFault
from tests.daq.device_server import DeviceServer, serving
from tests.daq.ni_driver import NiDriver

RATE = 30_000.0  # coerced to 29,985 by the card's 20 MHz
CALIBRATION = Calibration((0.0, 1e-4), 0.0, 10.0)


def bench(target: str = "", *, rate: float = RATE, tacho_input: str = "ai2", **device: Any) -> Rig:
    config = RigConfig(
        device=DeviceSection.model_validate({"backend": Backend.NIDAQMX, "target": target, "deadline_s": 0.4} | device),
        timing=TimingSection(rate_hz=rate, block_s=0.05, buffer_s=4),
        channel=(
            ChannelSection(name="x", role=Role.PROBE_X, physical="ai0", range_v=10.0),
            ChannelSection(name="y", role=Role.PROBE_Y, physical="ai1", range_v=10.0, angle_deg=90),
            ChannelSection(name="tacho", role=Role.TACHO, physical=tacho_input, range_v=5.0, terminal="rse"),
        ),
        simulation=SimulationSection(
            profile=(ProfilePoint(time_s=0, speed_rpm=3000), ProfilePoint(time_s=8, speed_rpm=6000)),
        ),
    )
    return Rig(Path("rig.toml"), config, {"x": CALIBRATION, "y": CALIBRATION}, "")


@pytest.fixture
def driver() -> NiDriver:
    return NiDriver(lambda: SimulatedCard(bench()))


@pytest.fixture
def server(driver: NiDriver) -> Iterator[DeviceServer]:
    with serving(driver) as running:
        yield running


@pytest.fixture
def card(server: DeviceServer) -> Iterator[Usb6251]:
    source = open_usb6251(bench(server.target))
    yield source
    source.close()


def take(source: Usb6251, blocks: int) -> list[SourceItem]:
    """Read so many blocks, stop, and read on to the end."""
    items: list[SourceItem] = []
    for item in source.blocks():
        items.append(item)
        if sum(isinstance(item, SampleBlock) for item in items) == blocks:
            source.stop()
    return items


def codes_of(items: list[SourceItem]) -> NDArray[np.int16]:
    return np.concatenate([item.codes for item in items if isinstance(item, SampleBlock)], axis=1)


def ends_of(items: list[SourceItem]) -> list[SegmentEnd]:
    return [item for item in items if isinstance(item, SegmentEnd)]


def refused(rig: Rig) -> DeviceError:
    with pytest.raises(DeviceError) as caught:
        open_usb6251(rig)
    return caught.value


def test_codes_that_arrive_are_those_the_card_made_bit_for_bit(card: Usb6251) -> None:
    items = take(card, 20)
    assert [type(item) for item in items] == [SampleBlock] * 20 + [SegmentEnd]
    got = codes_of(items)
    np.testing.assert_array_equal(got, SimulatedCard(bench()).next_codes(got.shape[1]))
    assert got.dtype == np.int16
    assert ends_of(items) == [SegmentEnd(0, got.shape[1], EndReason.STOPPED)]


def test_blocks_are_of_one_size_contiguous_and_numbered_without_a_gap(card: Usb6251) -> None:
    before = time.time_ns()
    blocks = [item for item in take(card, 10) if isinstance(item, SampleBlock)]
    size = round(card.acquisition.rate * 0.05)
    assert [block.first_sample for block in blocks] == list(range(0, 10 * size, size))
    assert all(block.codes.shape == (3, size) and block.codes.flags.c_contiguous for block in blocks)
    assert all(before <= block.host_time_ns <= time.time_ns() for block in blocks)
    assert all(np.shares_memory(block.codes, other.codes) == (block is other) for block in blocks for other in blocks)


def test_card_opened_anew_counts_from_zero_and_gives_the_same_again(card: Usb6251, server: DeviceServer) -> None:
    first = take(card, 3)
    card.close()
    second = open_usb6251(bench(server.target))
    again = take(second, 3)
    second.close()
    assert isinstance(again[0], SampleBlock)
    assert (again[0].segment, again[0].first_sample) == (0, 0)
    np.testing.assert_array_equal(codes_of(first), codes_of(again))


def test_acquisition_is_read_back_from_the_device_as_it_was_coerced(card: Usb6251, server: DeviceServer) -> None:
    got, played = card.acquisition, server.driver.acquisition
    assert got.rate == played.rate != RATE
    assert got.convert_rate == played.convert_rate
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


def test_channels_keep_the_terminals_and_the_buffer_that_the_rig_asks_for(server: DeviceServer) -> None:
    source = open_usb6251(bench(server.target))
    (task,) = server.rpcs.tasks.values()
    source.close()
    assert [channel.terminal for channel in task.channels] == [10106, 10106, 10083]
    assert task.buffer == 4 * RATE
    assert task.continuous


def test_block_costs_one_read_and_one_question_for_the_backlog(card: Usb6251, server: DeviceServer) -> None:
    server.log.clear()
    take(card, 5)
    assert server.log == [
        "StartTask",
        *["ReadBinaryI16", "GetReadAttributeUInt32"] * 5,
        "GetReadAttributeUInt64",
        "ClearTask",
    ]


def test_backlog_tells_what_the_card_still_holds(server: DeviceServer) -> None:
    server.driver.real_time = True
    source = open_usb6251(bench(server.target))
    stream = source.blocks()
    next(stream)
    server.driver.ahead = 5000
    block = next(stream)
    source.close()
    assert isinstance(block, SampleBlock)
    assert block.backlog >= 3000


# Finding the card


def test_card_is_bound_by_its_serial_number_wherever_it_is_plugged(server: DeviceServer) -> None:
    server.driver.devices = {"Dev1": ("USB-6251", 0xABC), "Dev7": ("USB-6251", 0x1A2B3C)}
    source = open_usb6251(bench(server.target, name="Dev1", serial="0x01a2b3c"))
    (task,) = server.rpcs.tasks.values()
    source.close()
    assert [channel.physical for channel in task.channels] == ["Dev7/ai0", "Dev7/ai1", "Dev7/ai2"]


def test_card_is_bound_by_name_where_no_serial_number_is_given(server: DeviceServer) -> None:
    source = open_usb6251(bench(server.target, name="dev1"))
    source.close()
    assert source.acquisition.device.serial == "1A2B3C"


@pytest.mark.parametrize("device", [{"serial": "DEAD"}, {"name": "Dev9"}, {"name": "Dev2"}])
def test_missing_card_is_told_with_what_is_there(server: DeviceServer, device: dict[str, str]) -> None:
    error = refused(bench(server.target, **device))
    assert error.fault is DeviceFault.MISSING
    assert next(iter(device.values())) in str(error)
    assert "Dev1: USB-6251, serial number 1A2B3C, Dev2: PCI-6221, serial number BEEF" in str(error)
    assert server.tasks == []


def test_missing_card_is_told_where_none_is_there(server: DeviceServer) -> None:
    server.driver.devices = {}
    assert "there is no device" in str(refused(bench(server.target)))


# Failing to open


def test_card_held_by_another_program_is_busy(server: DeviceServer) -> None:
    server.driver.held_elsewhere = True
    error = refused(bench(server.target))
    assert (error.fault, error.code) == (DeviceFault.BUSY, -50103)
    assert "another program holds the card" in str(error)
    assert server.tasks == []


def test_rate_beyond_the_card_is_rejected_with_the_drivers_code(server: DeviceServer) -> None:
    error = refused(bench(server.target, rate=400_000.0))
    assert (error.fault, error.code) == (DeviceFault.REJECTED, -200077)


def test_input_that_the_card_has_not_is_rejected(server: DeviceServer) -> None:
    assert refused(bench(server.target, tacho_input="ai9")).fault is DeviceFault.REJECTED


def test_code_that_nobody_knows_keeps_its_number_and_text(server: DeviceServer) -> None:
    server.faults["TaskControl"].append(-299_999)
    error = refused(bench(server.target))
    assert (error.fault, error.code) == (DeviceFault.OTHER, -299_999)
    assert "the driver's text of -299999, over two lines" in str(error)


@pytest.mark.parametrize(
    "rpc",
    [
        "GetSystemInfoAttributeString",
        "GetDeviceAttributeString",
        "CreateTask",
        "GetTaskAttributeString",
        "CreateAIVoltageChan",
        "CfgSampClkTiming",
        "SetBufferAttributeUInt32",
        "TaskControl",
        "GetTimingAttributeDouble",
        "GetDeviceAttributeBool",
        "GetChanAttributeDouble",
        "GetChanAttributeDoubleArray",
    ],
)
def test_nothing_is_left_reserved_where_opening_fails(server: DeviceServer, rpc: str) -> None:
    server.faults[rpc].extend([0, -200077] if rpc == "CreateTask" else [-200077])
    assert refused(bench(server.target)).code == -200077
    assert server.tasks == []


def test_nothing_is_left_reserved_where_starting_fails(card: Usb6251, server: DeviceServer) -> None:
    server.faults["StartTask"].append(-50103)
    with pytest.raises(DeviceError) as caught:
        list(card.blocks())
    assert caught.value.fault is DeviceFault.BUSY
    assert server.tasks == []


def test_device_without_a_scaling_polynomial_is_refused(server: DeviceServer) -> None:
    server.driver.scaling = [()] * 3
    assert "scaling polynomial" in str(refused(bench(server.target)))
    assert server.tasks == []


def test_server_that_is_not_there_is_named_with_the_deadline() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        target = f"127.0.0.1:{free.getsockname()[1]}"
    error = refused(bench(target))
    assert (error.fault, error.code) == (DeviceFault.MISSING, 0)
    assert f"{target} cannot be reached (deadline 0.4 s)" in str(error)


def test_server_that_is_frozen_ends_the_opening_by_the_deadline(server: DeviceServer) -> None:
    server.freeze()
    began = time.monotonic()
    error = refused(bench(server.target))
    assert time.monotonic() - began < 4
    assert error.fault is DeviceFault.TIMEOUT
    assert f"{server.target} did not answer within its deadline of 0.4 s" in str(error)


def test_server_too_old_for_a_call_is_a_matter_of_the_driver(server: DeviceServer) -> None:
    server.unimplemented.add("CfgSampClkTiming")
    error = refused(bench(server.target))
    assert error.fault is DeviceFault.DRIVER
    assert "too old" in str(error)
    assert server.tasks == []


def test_local_card_without_the_ni_driver_says_what_to_install() -> None:
    error = refused(bench())
    assert (error.fault, error.code) == (DeviceFault.DRIVER, 0)
    assert "install NI-DAQmx from ni.com/downloads" in str(error)


def test_missing_package_says_which_extra_to_install() -> None:
    program = (
        "import sys; sys.modules['nidaqmx'] = None\n"
        "from daq.drivers.usb6251 import open_usb6251\n"
        "from daq.errors import DeviceError\n"
        "try: open_usb6251(None)\n"
        "except DeviceError as error: print(error.fault, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.startswith("driver the package nidaqmx is not installed")
    assert "rig-service[card]" in done.stdout


# What a client that died has left on the server


def test_acquisition_that_a_dead_client_left_is_cleared(server: DeviceServer) -> None:
    left = open_usb6251(bench(server.target))
    next(left.blocks())
    source = open_usb6251(bench(server.target))
    items = take(source, 2)
    source.close()
    assert ends_of(items)[0].reason is EndReason.STOPPED
    left.close()
    assert server.tasks == []


def test_acquisition_that_another_client_reads_is_left_alone(server: DeviceServer, driver: NiDriver) -> None:
    driver.real_time = True
    other = open_usb6251(bench(server.target))
    items: list[SourceItem] = []
    reading = threading.Thread(target=lambda: items.extend(other.blocks()))
    reading.start()
    error = refused(bench(server.target))
    other.stop()
    reading.join()
    other.close()
    assert error.fault is DeviceFault.BUSY
    assert "another recording is reading Dev1" in str(error)
    assert ends_of(items)[0].reason is EndReason.STOPPED


# Faults in the midst of a run


@pytest.mark.parametrize("code", [-200279, -200222, -200361, -200010, -200019, -200714])
def test_overrun_ends_the_segment_with_code_and_text_and_the_next_begins(
    card: Usb6251, server: DeviceServer, code: int
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


def test_overrun_tells_at_least_how_many_samples_were_lost(card: Usb6251, server: DeviceServer) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 2:
            server.driver.stall(130_000)  # the buffer holds 120,000
        if isinstance(item, SegmentEnd):
            card.stop()
    first = ends_of(items)[0]
    assert first.reason is EndReason.OVERRUN
    assert first.lost == 130_000 + 1499  # and the block that was due
    assert not first.lost_is_exact
    assert not first.is_gap_free


def test_overrun_without_an_answer_about_the_loss_is_still_a_gap(card: Usb6251, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279])
    server.faults["GetReadAttributeUInt64"].append(-200279)
    first = ends_of(take(card, 2))[0]
    assert first.lost == 0
    assert not first.is_gap_free


def test_overrun_again_and_again_ends_the_run(card: Usb6251, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279] * 20)
    items = list(card.blocks())
    assert [end.segment for end in ends_of(items)] == [0, 1, 2, 3, 4, 5]
    assert server.tasks == []


def test_overrun_after_which_the_card_does_not_start_ends_the_run_with_that(
    card: Usb6251, server: DeviceServer
) -> None:
    server.faults["ReadBinaryI16"].extend([0, -200279])
    server.faults["StartTask"].extend([0, -200545])
    first, second = ends_of(list(card.blocks()))
    assert (first.reason, second.reason) == (EndReason.OVERRUN, EndReason.DEVICE_ERROR)
    assert (second.segment, second.samples) == (1, 0)
    assert server.tasks == []


@pytest.mark.parametrize("code", [-88710, -88709, -201003, -200220, -50405, -200284])
def test_card_that_is_no_longer_listed_was_unplugged(card: Usb6251, server: DeviceServer, code: int) -> None:
    del server.driver.devices["Dev1"]
    server.faults["ReadBinaryI16"].extend([0, code])
    (end,) = ends_of(list(card.blocks()))
    assert end.reason is EndReason.UNPLUGGED
    assert str(code) in end.detail
    assert server.tasks == []


def test_card_that_is_listed_and_fails_its_test_was_unplugged(card: Usb6251, server: DeviceServer) -> None:
    server.driver.answers_tests = False
    server.faults["ReadBinaryI16"].extend([0, -88710])
    assert ends_of(list(card.blocks()))[0].reason is EndReason.UNPLUGGED


def test_card_plugged_in_again_at_once_was_unplugged_all_the_same(card: Usb6251, server: DeviceServer) -> None:
    server.faults["ReadBinaryI16"].extend([0, -201003])
    assert ends_of(list(card.blocks()))[0].reason is EndReason.UNPLUGGED


@pytest.mark.parametrize("code", [-88710, -50103, -200077, -200545, -299_999])
def test_other_faults_of_a_card_that_is_there_are_device_errors(card: Usb6251, server: DeviceServer, code: int) -> None:
    server.faults["ReadBinaryI16"].extend([0, 0, 0, code])
    items = list(card.blocks())
    (end,) = ends_of(items)
    assert end.reason is EndReason.DEVICE_ERROR
    assert end.samples == codes_of(items).shape[1] > 0
    assert f"the driver's text of {code}" in end.detail
    assert f"(driver code {code})" in end.detail
    assert not end.is_gap_free
    assert server.tasks == []


def test_samples_that_come_before_the_time_out_are_kept_and_reading_goes_on(
    card: Usb6251, server: DeviceServer
) -> None:
    server.driver.late.extend([1499, 700, 1499])
    items = take(card, 4)
    blocks = [item for item in items if isinstance(item, SampleBlock)]
    assert [block.n_samples for block in blocks] == [1499, 700, 1499, 1499]
    np.testing.assert_array_equal(codes_of(items), SimulatedCard(bench()).next_codes(1499 * 3 + 700))
    assert ends_of(items) == [SegmentEnd(0, 1499 * 3 + 700, EndReason.STOPPED)]


def test_card_that_gives_no_samples_at_all_is_a_device_error(card: Usb6251, server: DeviceServer) -> None:
    server.driver.late.extend([1499, 0])
    (end,) = ends_of(list(card.blocks()))
    assert (end.reason, end.samples) == (EndReason.DEVICE_ERROR, 1499)
    assert "no samples arrived in time" in end.detail


def test_block_is_delivered_where_only_the_question_for_the_backlog_fails(card: Usb6251, server: DeviceServer) -> None:
    server.faults["GetReadAttributeUInt32"].extend([0, -200545])
    items = list(card.blocks())
    assert codes_of(items).shape[1] == ends_of(items)[0].samples == 2 * 1499
    assert ends_of(items)[0].reason is EndReason.DEVICE_ERROR


def test_server_that_is_killed_ends_the_segment_and_closing_is_harmless(card: Usb6251, server: DeviceServer) -> None:
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 3:
            server.kill()
    (end,) = ends_of(items)
    assert (end.reason, end.samples, end.is_gap_free) == (EndReason.DEVICE_ERROR, 3 * 1499, False)
    assert f"device server {server.target} cannot be reached" in end.detail
    card.close()


def test_server_that_freezes_ends_the_segment_by_the_deadline_and_is_cleared_when_it_thaws(
    card: Usb6251, server: DeviceServer
) -> None:
    began = time.monotonic()
    items: list[SourceItem] = []
    for item in card.blocks():
        items.append(item)
        if len(items) == 3:
            server.freeze()
    (end,) = ends_of(items)
    assert time.monotonic() - began < 6
    assert (end.reason, end.samples) == (EndReason.DEVICE_ERROR, 3 * 1499)
    assert "did not answer within its deadline" in end.detail
    card.close()
    server.thaw()
    again = open_usb6251(bench(server.target))
    assert ends_of(take(again, 1))[0].reason is EndReason.STOPPED
    again.close()
    assert server.tasks == []


def test_count_that_differs_from_the_drivers_is_never_passed_over(card: Usb6251, server: DeviceServer) -> None:
    server.driver.miscount = 17
    (end,) = ends_of(take(card, 2))
    assert (end.reason, end.lost, end.lost_is_exact) == (EndReason.OVERRUN, 17, True)
    assert "the driver counts 3015 samples delivered, 2998 were taken" in end.detail


def test_count_below_ours_is_an_error_of_the_device(card: Usb6251, server: DeviceServer) -> None:
    server.driver.miscount = -17
    (end,) = ends_of(take(card, 2))
    assert (end.reason, end.is_gap_free) == (EndReason.DEVICE_ERROR, False)


def test_count_that_cannot_be_asked_is_said(card: Usb6251, server: DeviceServer) -> None:
    server.faults["GetReadAttributeUInt64"].append(-200545)
    (end,) = ends_of(take(card, 2))
    assert end.reason is EndReason.STOPPED
    assert "could not be asked" in end.detail


# Stopping and closing


def test_stop_from_another_thread_ends_within_a_block_with_every_sample_read(server: DeviceServer) -> None:
    server.driver.real_time = True
    source = open_usb6251(bench(server.target))
    asked: list[float] = []

    def ask() -> None:
        asked.append(time.monotonic())
        source.stop()

    threading.Timer(0.32, ask).start()
    items = list(source.blocks())
    took = time.monotonic() - asked[0]
    source.close()
    (end,) = ends_of(items)
    assert took < 0.5
    assert end == SegmentEnd(0, codes_of(items).shape[1], EndReason.STOPPED)
    assert end.samples >= 5 * 1499
    assert server.tasks == []


def test_stop_before_the_start_gives_an_empty_segment(card: Usb6251) -> None:
    card.stop()
    assert list(card.blocks()) == [SegmentEnd(0, 0, EndReason.STOPPED)]


def test_close_is_harmless_twice_and_before_reading(card: Usb6251, server: DeviceServer) -> None:
    card.close()
    card.close()
    assert server.tasks == []
    assert server.log.count("ClearTask") == 1


def test_close_from_another_thread_waits_for_the_read_and_ends_the_blocks(server: DeviceServer) -> None:
    server.driver.real_time = True
    source = open_usb6251(bench(server.target))
    threading.Timer(0.18, source.close).start()
    items = list(source.blocks())
    (end,) = ends_of(items)
    assert end.reason is EndReason.STOPPED
    assert end.samples == codes_of(items).shape[1] >= 2 * 1499
    assert "the card has been closed" in end.detail
    assert server.tasks == []


def test_blocks_that_are_left_unread_release_the_card(card: Usb6251, server: DeviceServer) -> None:
    stream = card.blocks()
    next(stream)
    del stream
    assert server.tasks == []


def test_blocks_are_iterated_once(card: Usb6251) -> None:
    take(card, 1)
    with pytest.raises(RuntimeError, match="second time"):
        card.blocks()

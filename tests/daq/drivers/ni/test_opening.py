"""Finding and reserving the card, and the errors if that fails."""

import socket
import subprocess
import sys
import threading
import time
from typing import Any

import grpc
import pytest

from analysis.signals.blocks import EndReason, SourceItem
from daq.drivers.ni import open_ni_source
from daq.errors import DeviceFault
from tests.daq.support.device_server import DeviceServer
from tests.daq.support.ni_bench import bench, ends_of, refused, take
from tests.daq.support.ni_driver import NiDriver

# Finding the card


def test_card_is_found_by_its_serial_number_at_any_port(server: DeviceServer) -> None:
    server.driver.devices = {"Dev1": ("USB-6251", 0xABC), "Dev7": ("USB-6251", 0x1A2B3C)}
    source = open_ni_source(bench(server.target, name="Dev1", serial="0x01a2b3c"))
    (task,) = server.rpcs.tasks.values()
    source.close()
    assert [channel.physical for channel in task.channels] == ["Dev7/ai0", "Dev7/ai1", "Dev7/ai2"]


def test_card_is_found_by_name_without_a_serial_number(server: DeviceServer) -> None:
    source = open_ni_source(bench(server.target, name="dev1"))
    source.close()
    assert source.acquisition.device.serial == "1A2B3C"


@pytest.mark.parametrize("device", [{"serial": "DEAD"}, {"name": "Dev9"}, {"name": "Dev2"}])
def test_missing_card_error_lists_the_connected_devices(server: DeviceServer, device: dict[str, Any]) -> None:
    error = refused(bench(server.target, **device))
    assert error.fault is DeviceFault.MISSING
    assert next(iter(device.values())) in str(error)
    assert "Dev1: USB-6251, serial number 1A2B3C, Dev2: PCI-6221, serial number BEEF" in str(error)
    assert server.tasks == []


def test_missing_card_error_without_any_device(server: DeviceServer) -> None:
    server.driver.devices = {}
    assert "connected: no device" in str(refused(bench(server.target)))


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


def test_nonexistent_input_is_rejected(server: DeviceServer) -> None:
    assert refused(bench(server.target, tacho_input="ai9")).fault is DeviceFault.REJECTED


def test_unknown_code_is_reported_with_number_and_text(server: DeviceServer) -> None:
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
        "GetBufferAttributeUInt32",
        "GetTimingAttributeDouble",
        "GetDeviceAttributeBool",
        "GetChanAttributeDouble",
        "GetChanAttributeDoubleArray",
    ],
)
def test_failed_opening_leaves_nothing_reserved(server: DeviceServer, rpc: str) -> None:
    server.faults[rpc].extend([0, -200077] if rpc == "CreateTask" else [-200077])
    assert refused(bench(server.target)).code == -200077
    assert server.tasks == []


def test_device_without_a_scaling_polynomial_is_refused(server: DeviceServer) -> None:
    server.driver.scaling = [()] * 3
    assert "scaling polynomial" in str(refused(bench(server.target)))
    assert server.tasks == []


def test_unreachable_server_is_named_with_the_deadline() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        target = f"127.0.0.1:{free.getsockname()[1]}"
    error = refused(bench(target, deadline_s=0.4))
    assert (error.fault, error.code) == (DeviceFault.MISSING, 0)
    assert f"{target} cannot be reached (deadline 0.4 s)" in str(error)


def test_frozen_server_ends_the_opening_by_the_deadline(server: DeviceServer) -> None:
    server.freeze()
    began = time.monotonic()
    error = refused(bench(server.target, deadline_s=0.4))
    assert time.monotonic() - began < 30
    assert error.fault is DeviceFault.TIMEOUT
    assert f"{server.target} did not respond within its deadline of 0.4 s" in str(error)


def test_server_too_old_for_a_call_is_a_driver_error(server: DeviceServer) -> None:
    server.refusals["CfgSampClkTiming"] = grpc.StatusCode.UNIMPLEMENTED
    error = refused(bench(server.target))
    assert error.fault is DeviceFault.DRIVER
    assert "too old" in str(error)
    assert server.tasks == []


def test_server_that_refuses_a_call_is_quoted(server: DeviceServer) -> None:
    server.refusals["TaskControl"] = grpc.StatusCode.PERMISSION_DENIED
    error = refused(bench(server.target))
    assert error.fault is DeviceFault.OTHER
    assert f"device server {server.target}: StatusCode.PERMISSION_DENIED: TaskControl is refused" in str(error)


def test_local_card_without_the_ni_driver_names_what_to_install() -> None:
    error = refused(bench())
    assert (error.fault, error.code) == (DeviceFault.DRIVER, 0)
    assert "install NI-DAQmx from ni.com/downloads" in str(error)


def test_missing_package_names_the_extra_to_install() -> None:
    program = (
        "import sys; sys.modules['nidaqmx'] = None\n"
        "from daq.drivers.ni import open_ni_source\n"
        "from daq.errors import DeviceError\n"
        "try: open_ni_source(None)\n"
        "except DeviceError as error: print(error.fault, error)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.startswith("driver the package nidaqmx is not installed")
    assert "rig-service[card]" in done.stdout


# Abandoned acquisitions at a server


def test_abandoned_acquisition_of_a_dead_client_is_cleared(server: DeviceServer) -> None:
    left = open_ni_source(bench(server.target))
    next(left.blocks())
    source = open_ni_source(bench(server.target))
    items = take(source, 2)
    source.close()
    assert ends_of(items)[0].reason is EndReason.STOPPED
    left.close()
    assert server.tasks == []


def test_acquisition_of_another_client_is_not_disturbed(server: DeviceServer, driver: NiDriver) -> None:
    driver.real_time = True
    other = open_ni_source(bench(server.target))
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

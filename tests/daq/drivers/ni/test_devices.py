"""The list of devices and the card's self-test, at a device server."""

import pytest

from daq.config.schema import Backend, DeviceSection
from daq.drivers.ni import NiSource, connected_devices, self_test
from daq.errors import DeviceError, DeviceFault
from tests.daq.support.device_server import DeviceServer


def section(server: DeviceServer, **keys: str) -> DeviceSection:
    return DeviceSection.model_validate(
        {"backend": Backend.NIDAQMX, "target": server.target, "deadline_s": 1.2} | keys, strict=False
    )


def test_devices_are_listed_with_serial_number_and_driver(server: DeviceServer) -> None:
    first, second = connected_devices(section(server))
    assert (first.name, first.product, first.serial) == ("Dev1", "USB-6251", "1A2B3C")
    assert (second.name, second.product, second.serial) == ("Dev2", "PCI-6221", "BEEF")
    assert first.driver == f"NI-DAQmx 24.5.1 at device server {server.target}"
    assert first.simulated == server.driver.acquisition.device.simulated
    assert first.busy is False
    assert server.tasks == []


def test_device_held_by_another_program_is_listed_as_busy(server: DeviceServer) -> None:
    server.driver.held_elsewhere = True
    assert [device.busy for device in connected_devices(section(server))] == [True, True]
    assert server.tasks == []


def test_device_held_by_a_recording_is_listed_as_busy(server: DeviceServer, card: NiSource) -> None:
    assert connected_devices(section(server))[0].busy is True
    card.close()
    assert connected_devices(section(server))[0].busy is False


def test_device_without_analog_inputs_is_neither_busy_nor_free(server: DeviceServer) -> None:
    server.faults["CreateAIVoltageChan"].extend([-200170, 0])
    assert [device.busy for device in connected_devices(section(server))] == [None, False]
    assert server.tasks == []


def test_self_test_passes_for_a_working_card(server: DeviceServer) -> None:
    self_test(section(server, serial="1a2b3c"))
    assert "SelfTestDevice" in server.log


def test_failed_self_test_reports_the_drivers_code(server: DeviceServer) -> None:
    server.driver.passes_self_test = False
    with pytest.raises(DeviceError, match="does not respond") as caught:
        self_test(section(server))
    assert (caught.value.fault, caught.value.code) == (DeviceFault.MISSING, -201003)


def test_self_test_of_a_missing_card_lists_the_connected_devices(server: DeviceServer) -> None:
    with pytest.raises(DeviceError, match="connected: Dev1: USB-6251, serial number 1A2B3C"):
        self_test(section(server, serial="DEAD"))


def test_listing_devices_without_the_ni_driver_names_what_to_install() -> None:
    with pytest.raises(DeviceError, match="install NI-DAQmx from"):
        connected_devices(DeviceSection(backend=Backend.NIDAQMX))

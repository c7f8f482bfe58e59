"""`rig devices`: what is connected."""

import argparse

from daq.cli.summary_text import print_json
from daq.config.schema import Backend, DeviceSection
from daq.drivers.ni import FoundDevice, connected_devices
from daq.schemas.devices import found_device_document

_STATES = {True: "busy: another program holds it", False: "free", None: "no analog input"}


def run(chosen: argparse.Namespace) -> int:
    """List what is connected; return the exit code."""
    devices = connected_devices(DeviceSection(backend=Backend.NIDAQMX, target=chosen.target or ""))
    if chosen.json:
        print_json([found_device_document(device) for device in devices])
    elif devices:
        print(devices[0].driver)
        for device in devices:
            print(_row(device))
    else:
        print("no device is connected: check the card's own supply (it is not listed without) and its USB cable")
    return 0


def _row(device: FoundDevice) -> str:
    kind = "simulated" if device.simulated else "real"
    return f"{device.name:8}  {device.product:12}  serial number {device.serial:10}  {kind:9}  {_STATES[device.busy]}"

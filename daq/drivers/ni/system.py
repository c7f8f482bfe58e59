"""The driver without an acquisition: what is connected and how it is."""

import datetime as dt

from nidaqmx.constants import TaskMode
from nidaqmx.errors import DaqError
from nidaqmx.system.device import Device

from daq.config.schema import DeviceSection
from daq.drivers.ni.connection import Connection
from daq.drivers.ni.devices import FoundDevice
from daq.drivers.ni.error_codes import BUSY_CODES


class NiSystem:
    """The driver, here or at a device server, without an acquisition: what is connected and how it is.

    Parameters
    ----------
    section : DeviceSection
        Where the driver is, and which card is meant.

    Raises
    ------
    DeviceError
        From every method but `close`.
    """

    def __init__(self, section: DeviceSection) -> None:
        self._connection = Connection(section)

    def devices(self) -> list[FoundDevice]:
        """Return what is connected."""
        with self._connection.translated():
            system = self._connection.system()
            version = "NI-DAQmx " + ".".join(str(part) for part in system.driver_version) + self._connection.where
            return [
                FoundDevice(
                    name=str(device.name),
                    product=str(device.product_type),
                    serial=f"{device.serial_num:X}",
                    simulated=bool(device.is_simulated),
                    busy=self._is_busy(device),
                    driver=version,
                )
                for device in system.devices
            ]

    def self_test(self) -> dt.date | None:
        """Let the card that is meant test itself; return when it last calibrated itself, or None."""
        with self._connection.translated():
            device = self._connection.device(self._connection.system())
            device.self_test_device()
            try:
                calibrated: dt.datetime = device.self_cal_last_date_and_time
            except (DaqError, ValueError):  # not supported, or never done: no such date
                return None
        return calibrated.date()

    def close(self) -> None:
        """Close the connection to the server; harmless when closed."""
        self._connection.close()

    def _is_busy(self, device: Device) -> bool | None:
        """Return whether another acquisition holds the device; None where it has no analog input to ask for."""
        with self._connection.task() as task:
            try:
                task.ai_channels.add_ai_voltage_chan(f"{device.name}/ai0")
                task.control(TaskMode.TASK_COMMIT)
            except DaqError as error:
                return True if error.error_code in BUSY_CODES else None
        return False

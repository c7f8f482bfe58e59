"""The NI USB-6251, by the driver on this machine or by a gRPC device server elsewhere.

nidaqmx and gRPC are imported when the card is opened: they are the extra `card`.
"""

from daq.drivers.ni.devices import FoundDevice
from daq.drivers.ni.source import Usb6251, connected_devices, open_usb6251, self_test

__all__ = ["FoundDevice", "Usb6251", "connected_devices", "open_usb6251", "self_test"]

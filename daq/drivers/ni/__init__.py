"""The NI USB-6251, by the driver on this machine or by a gRPC device server elsewhere.

nidaqmx and gRPC are imported when the card is opened: they are the extra `card`.
"""

from daq.drivers.ni.devices import FoundDevice
from daq.drivers.ni.source import NiSource, connected_devices, open_ni_source, self_test

__all__ = ["FoundDevice", "NiSource", "connected_devices", "open_ni_source", "self_test"]

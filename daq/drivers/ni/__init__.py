"""The NI USB-6251, through NI-DAQmx on this machine or at a gRPC device server.

nidaqmx and gRPC, the optional extra `card`, are imported when a card is opened.
"""

from daq.drivers.ni.source import NiSource, connected_devices, open_ni_source, self_test
from daq.drivers.source import FoundDevice

__all__ = ["FoundDevice", "NiSource", "connected_devices", "open_ni_source", "self_test"]

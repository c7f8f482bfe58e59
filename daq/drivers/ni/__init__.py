"""The NI USB-6251, by the driver on this machine or by a gRPC device server elsewhere.

`connection`, `driver`, `counter` and `system` know nidaqmx and gRPC, `faults` says what its codes mean at the bench,
`source` and `stamps` read.
"""

from daq.drivers.ni.devices import FoundDevice, connected_devices, self_test
from daq.drivers.ni.source import Usb6251, open_usb6251

__all__ = ["FoundDevice", "Usb6251", "connected_devices", "open_usb6251", "self_test"]

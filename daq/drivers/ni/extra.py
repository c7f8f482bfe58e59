"""The optional extra that the card needs, and what is said where it is not installed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from daq.errors import DeviceError, DeviceFault


@contextmanager
def card_extra() -> Iterator[None]:
    """Say of an import of the driver's file that fails which extra is not installed.

    Raises
    ------
    DeviceError
        A package of the extra is missing.
    """
    os.environ.setdefault("GRPC_VERBOSITY", "ERROR")  # gRPC's own log would run across the operator's screen
    try:
        yield
    except ImportError as error:
        package = (error.name or "nidaqmx").partition(".")[0]
        raise DeviceError(
            DeviceFault.DRIVER,
            f"the package {package} is not installed: install the service with its extra 'card' "
            "(pip install 'rig-service[card]')",
        ) from error

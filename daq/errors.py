"""The exceptions of daq, each with the exit code of the command that it ends.

    RigError
    ├── ConfigError         rig.toml or a file that it names is wrong; lists all errors          exit 2
    ├── UsageError          the command names something that does not exist                      exit 2
    ├── DeviceError         the device is missing, busy, too old, or failed                      exit 3
    ├── ServiceError        the service cannot start, for example because its port is in use     exit 2
    └── StoppedError        the operator stopped the command before it recorded anything         exit 130

Lost samples raise no exception: the end of the segment records them (`SegmentEnd`, exit 5), and the file is complete.
"""

from enum import StrEnum
from typing import Self


class RigError(Exception):
    """Base class: an error reported to the operator as one message, without a traceback."""

    exit_code = 1


class ConfigError(RigError):
    """A configuration file is wrong.

    Parameters
    ----------
    file : str
        The file.
    faults : list of str
        All errors found, each with key, value and what was expected.
    """

    exit_code = 2

    def __init__(self, file: str, faults: list[str]) -> None:
        self.file = file
        self.faults = faults
        lines = "\n".join(f"  {fault}" for fault in faults)
        super().__init__(f"{file}: {len(faults)} {'error' if len(faults) == 1 else 'errors'}\n{lines}")

    def __reduce__(self) -> tuple[type[Self], tuple[str, list[str]]]:
        """Return the class and its arguments, so that the error can be pickled to another process."""
        return type(self), (self.file, self.faults)


class UsageError(RigError):
    """A command or its arguments name something that does not exist."""

    exit_code = 2


class ServiceError(RigError):
    """The service cannot start."""

    exit_code = 2


class StoppedError(RigError):
    """A stop was requested before the device was open."""

    exit_code = 130


class DeviceFault(StrEnum):
    """Category of a device error."""

    MISSING = "missing"
    BUSY = "busy"
    DRIVER = "driver"
    REJECTED = "rejected"  # the device refused the settings
    TIMEOUT = "timeout"
    OTHER = "other"


class DeviceError(RigError):
    """The device cannot be used.

    Parameters
    ----------
    fault : DeviceFault
        Its category.
    message : str
        What is wrong, and what to do.
    code : int
        The driver's error code; 0 if it gave none.
    """

    exit_code = 3

    def __init__(self, fault: DeviceFault, message: str, code: int = 0) -> None:
        self.fault = fault
        self.message = message
        self.code = code
        super().__init__(f"{message} (driver code {code})" if code else message)

    def __reduce__(self) -> tuple[type[Self], tuple[DeviceFault, str, int]]:
        """Return the class and its arguments, so that the error can be pickled to another process."""
        return type(self), (self.fault, self.message, self.code)

"""The errors of the live side; each knows the exit code of the command that meets it.

    RigError
    ├── ConfigError         rig.toml or a file it names is wrong: every fault in one go          exit 2
    ├── UsageError          the command was asked for something that does not exist              exit 2
    ├── DeviceError         the device is missing, busy, too old, or failed                      exit 3
    ├── ServiceError        an address is taken, the page cannot be served                       exit 2
    └── StoppedError        somebody stopped it before anything was recorded                     exit 130

Samples lost in a run are no exception but a fact of the run: `SegmentEnd` (exit 5, file kept).
"""

from enum import StrEnum
from typing import Self


class RigError(Exception):
    """Anything the operator is told in one clear message."""

    exit_code = 1


class ConfigError(RigError):
    """The configuration is wrong.

    Parameters
    ----------
    file : str
        The file that is wrong.
    faults : sequence of str
        Every fault found, each with key, value and what was expected.
    """

    exit_code = 2

    def __init__(self, file: str, faults: list[str]) -> None:
        self.file = file
        self.faults = faults
        lines = "\n".join(f"  {fault}" for fault in faults)
        super().__init__(f"{file}: {len(faults)} {'fault' if len(faults) == 1 else 'faults'}\n{lines}")

    def __reduce__(self) -> tuple[type[Self], tuple[str, list[str]]]:
        """Return what makes it anew in another process."""
        return type(self), (self.file, self.faults)


class UsageError(RigError):
    """The command or its arguments ask for something that does not exist."""

    exit_code = 2


class ServiceError(RigError):
    """The service cannot be offered."""

    exit_code = 2


class StoppedError(RigError):
    """Somebody asked for the end before the device was open."""

    exit_code = 130


class DeviceFault(StrEnum):
    """What is wrong with a device."""

    MISSING = "missing"
    BUSY = "busy"
    DRIVER = "driver"
    REJECTED = "rejected"  # it refused the settings
    TIMEOUT = "timeout"
    OTHER = "other"


class DeviceError(RigError):
    """The device cannot be used.

    Parameters
    ----------
    fault : DeviceFault
        What kind of trouble it is.
    message : str
        The trouble in the words of the bench, and what to do.
    code : int
        The driver's code; 0 where it gave none.
    """

    exit_code = 3

    def __init__(self, fault: DeviceFault, message: str, code: int = 0) -> None:
        self.fault = fault
        self.message = message
        self.code = code
        super().__init__(f"{message} (driver code {code})" if code else message)

    def __reduce__(self) -> tuple[type[Self], tuple[DeviceFault, str, int]]:
        """Return what makes it anew in another process."""
        return type(self), (self.fault, self.message, self.code)

"""NI-DAQmx error codes: their categories and messages to the operator; the error if nidaqmx is not installed.

The numbers repeat `nidaqmx.error_codes.DAQmxErrors`, so that this module does not need nidaqmx.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from daq.errors import DeviceError, DeviceFault

NOT_YET_AVAILABLE = -200284  # a read timed out; it delivers the samples that have arrived
DRIVER_NOT_INSTALLED = (
    "the NI-DAQmx driver is not installed on this machine: install NI-DAQmx from ni.com/downloads, or set "
    "device.target to the host:port of a device server"
)
DRIVER_TOO_OLD = "the NI-DAQmx driver on this machine is too old: install a newer one"

_FULL = (
    "the samples were not fetched fast enough and the buffer {}: "
    "close other programs, lower timing.rate_hz or raise timing.buffer_s"
)
_MEMORY = "the card's own memory overflowed: USB is too slow, give the card a port of its own without a hub"
_CONVERTER = "the converter had not finished when the next sample was due: lower the rate"
OVERRUN_CODES = {
    -200279: _FULL.format("was overwritten"),
    -50410: _FULL.format("was overwritten"),
    -200222: _FULL.format("is full"),
    -200613: _FULL.format("is full"),
    -200283: _FULL.format("between card and program is full"),
    -200361: _MEMORY,
    -200010: _MEMORY,
    -209829: _MEMORY,
    -200004: _MEMORY,
    -200019: _CONVERTER,
    -201319: _CONVERTER,
    -200714: "USB could not carry the samples fast enough: give the card a port of its own without a hub",
}
_GONE = "the card is not connected: check its supply and its USB cable"
ABSENT_CODES = {
    -200220: _GONE,
    -88705: _GONE,
    -200324: _GONE,
    -89130: _GONE,
    -200045: "the card was disconnected: check its supply and its USB cable",
    -200194: "the card lost its supply for a time: check its supply",
    -201003: "the card does not respond: check its supply and its USB cable",
}
BUSY_CODES = {
    -50103: "another program holds the card: close it there (NI MAX, LabVIEW, a second recording)",
    -200022: "another program holds the card: close it there (NI MAX, LabVIEW, a second recording)",
    -89137: "another program holds a line of the card: close it there (NI MAX, LabVIEW, a second recording)",
}
OTHER_CODES = {
    NOT_YET_AVAILABLE: "no samples arrived in time: check the card's supply and its USB cable, or plug it in again",
    -88710: "the acquisition was aborted by another program or by a reset of the card",
    -88709: "the acquisition was aborted by another program or by a reset of the card",
    -200088: "the driver no longer knows the acquisition: the driver or its device server was restarted",
}
SETTINGS_CODES = range(-209_999, -199_999)  # NI-DAQmx's numbers for errors in a task's settings

_TEXTS = OVERRUN_CODES | ABSENT_CODES | BUSY_CODES | OTHER_CODES


def device_fault(code: int, *, known: bool) -> DeviceFault:
    """Return the category of an error code; ``known`` states whether the driver's own list contains it."""
    if code in BUSY_CODES:
        return DeviceFault.BUSY
    if code in ABSENT_CODES:
        return DeviceFault.MISSING
    if code == NOT_YET_AVAILABLE:
        return DeviceFault.TIMEOUT
    has_text = code in OVERRUN_CODES or code in OTHER_CODES
    return DeviceFault.REJECTED if known and code in SETTINGS_CODES and not has_text else DeviceFault.OTHER


def operator_message(code: int, text: str) -> str:
    """Return the message to the operator for an error code, followed by the driver's own text."""
    advice = _TEXTS.get(code, "")
    return (
        f"{advice}; the driver reports: {driver_text(text)}" if advice else f"the driver reports: {driver_text(text)}"
    )


def driver_text(text: str) -> str:
    """Return the driver's text on one line, without the task name and status code at its end.

    The text begins with a sentence; further lines such as "Property: …" or "Requested Value: …" give details.
    """
    sentence, *details = text.strip().split("\n\n")
    lines = [" ".join(line.split()) for paragraph in details for line in paragraph.splitlines()]
    about = [line for line in lines if line and not line.startswith(("Task Name:", "Status Code:"))]
    return " ".join(sentence.split()) + (f" ({', '.join(about)})" if about else "")


@contextmanager
def card_extra_required() -> Iterator[None]:
    """Turn a failed import of the driver package into an error that names the extra to install.

    Raises
    ------
    DeviceError
        A package of the extra is missing.
    """
    os.environ.setdefault("GRPC_VERBOSITY", "ERROR")  # else gRPC logs to the operator's screen
    try:
        yield
    except ImportError as error:
        package = (error.name or "nidaqmx").partition(".")[0]
        raise DeviceError(
            DeviceFault.DRIVER,
            f"the package {package} is not installed: install the service with its extra 'card' "
            "(pip install 'rig-service[card]')",
        ) from error

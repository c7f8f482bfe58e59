"""What the driver's codes mean at the bench.

The numbers are NI-DAQmx's own (`nidaqmx.error_codes.DAQmxErrors`), repeated here so that they can be read without it.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from daq.errors import DeviceError, DeviceFault

NOT_YET_AVAILABLE = -200284  # a read's time-out; the samples that did come are delivered with it

_FULL = (
    "the samples were not fetched fast enough and the buffer {}: "
    "close other programs, lower timing.rate_hz or raise timing.buffer_s"
)
_MEMORY = "the card's own memory overflowed: USB is too slow, give the card a port of its own without a hub"
_CONVERTER = "the converter was asked for the next sample before it was done: lower the rate"
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
_GONE = "the card is not there: check its supply and its USB cable"
ABSENT_CODES = {
    -200220: _GONE,
    -88705: _GONE,
    -200324: _GONE,
    -89130: _GONE,
    -200045: "the card was taken away: check its supply and its USB cable",
    -200194: "the card lost its supply and has it again: check its supply",
    -201003: "the card does not answer: check its supply and its USB cable",
}
BUSY_CODES = {
    -50103: "another program holds the card: close it there (NI MAX, LabVIEW, a second recording)",
    -200022: "another program holds the card: close it there (NI MAX, LabVIEW, a second recording)",
    -89137: "another program holds a line of the card: close it there (NI MAX, LabVIEW, a second recording)",
}
OTHER_CODES = {
    NOT_YET_AVAILABLE: "no samples arrived in time: look at the card's supply and its USB cable, or plug it in anew",
    -88710: "the acquisition was broken off, by another program or a reset of the card",
    -88709: "the acquisition was broken off, by another program or a reset of the card",
    -200088: "the driver no longer knows the acquisition: it, or its device server, was started anew",
}
SETTINGS_CODES = range(-209_999, -199_999)  # where NI-DAQmx numbers its complaints about a task's settings

_WORDS = OVERRUN_CODES | ABSENT_CODES | BUSY_CODES | OTHER_CODES


def device_fault(code: int, *, known: bool) -> DeviceFault:
    """Return what kind of trouble a code is; ``known`` tells whether the driver's own list names it."""
    if code in BUSY_CODES:
        return DeviceFault.BUSY
    if code in ABSENT_CODES:
        return DeviceFault.MISSING
    if code == NOT_YET_AVAILABLE:
        return DeviceFault.TIMEOUT
    is_told = code in OVERRUN_CODES or code in OTHER_CODES
    return DeviceFault.REJECTED if known and code in SETTINGS_CODES and not is_told else DeviceFault.OTHER


def bench_words(code: int, text: str) -> str:
    """Return the trouble in the words of the bench, then in the driver's own."""
    words = _WORDS.get(code, "")
    return f"{words}; the driver says: {driver_words(text)}" if words else f"the driver says: {driver_words(text)}"


def driver_words(text: str) -> str:
    """Return the driver's text on one line, without the task and the code with which it ends.

    A sentence comes first; paragraphs such as "Property: …", "Requested Value: …", a line each, say what it is about.
    """
    sentence, *details = text.strip().split("\n\n")
    lines = [" ".join(line.split()) for paragraph in details for line in paragraph.splitlines()]
    about = [line for line in lines if line and not line.startswith(("Task Name:", "Status Code:"))]
    return " ".join(sentence.split()) + (f" ({', '.join(about)})" if about else "")


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

"""The optional extra that the card needs, and what is said where it is not installed.

What the driver's codes mean at the bench.
What the driver warns of, kept for the operator: Python would print it across the screen, at every read anew.
"""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TextIO

from nidaqmx.errors import DaqWarning

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


_heard_by: ContextVar["Warned | None"] = ContextVar("heard_by", default=None)
_passed_on = warnings.showwarning


class Warned:
    """The driver's warnings, each once."""

    def __init__(self) -> None:
        self._texts: dict[int, str] = {}
        self._told = 0

    @contextmanager
    def hearing(self) -> Iterator[None]:
        """Keep what the driver warns of in this block and thread."""
        _listen()
        token = _heard_by.set(self)
        try:
            yield
        finally:
            _heard_by.reset(token)

    def add(self, warning: DaqWarning) -> None:
        """Keep a warning."""
        code = int(warning.error_code)
        text = str(warning).removeprefix(f"\nWarning {code} occurred.\n\n")
        self._texts.setdefault(code, f"the driver warns: {driver_words(text)} (driver code {code})")

    def news(self) -> list[str]:
        """Return the warnings that have come since this was last asked."""
        texts = list(self._texts.values())[self._told :]
        self._told += len(texts)
        return texts


def _listen() -> None:
    """See to it that this file is shown every warning first, whoever else has come to show them since."""
    global _passed_on  # noqa: PLW0603 - Python has one place where warnings are shown
    if warnings.showwarning is not _show:
        _passed_on = warnings.showwarning
        warnings.showwarning = _show


def _show(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    warned = _heard_by.get()
    if warned is not None and isinstance(message, DaqWarning):
        warned.add(message)
    else:
        _passed_on(message, category, filename, lineno, file, line)


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

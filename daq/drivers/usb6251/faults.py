"""What the driver's codes mean at the bench.

The numbers are NI-DAQmx's own (`nidaqmx.error_codes.DAQmxErrors`), repeated here so that they can be read without it.
"""

from daq.errors import DeviceFault

NOT_YET_AVAILABLE = -200284  # a read's time-out; the samples that did come are delivered with it

_SLOW = "close other programs, lower timing.rate_hz or raise timing.buffer_s"
OVERRUN_CODES = {
    -200279: f"the samples were not fetched fast enough and the buffer was overwritten: {_SLOW}",
    -200222: f"the samples were not fetched fast enough and the buffer is full: {_SLOW}",
    -200361: "the card's own memory overflowed: USB is too slow, give the card a port of its own without a hub",
    -200010: "the card's own memory overflowed: USB is too slow, give the card a port of its own without a hub",
    -200019: "the converter was asked for the next sample before it was done: lower the rate",
    -200714: "USB could not carry the samples fast enough: give the card a port of its own without a hub",
}
ABSENT_CODES = {
    -200220: "the card is not there: check its supply and its USB cable",
    -201003: "the card does not answer: check its supply and its USB cable",
    -88705: "the card is not there: check its supply and its USB cable",
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
    if known and code in SETTINGS_CODES and code not in OVERRUN_CODES:
        return DeviceFault.REJECTED
    return DeviceFault.OTHER


def bench_words(code: int, text: str) -> str:
    """Return the trouble in the words of the bench, then the first paragraph of the driver's own, on one line."""
    driver = " ".join(text.partition("\n\n")[0].split())
    words = _WORDS.get(code, "")
    return f"{words}; the driver says: {driver}" if words else f"the driver says: {driver}"

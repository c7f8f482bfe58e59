"""The interface of all sample sources, the limit on new segments after faults, and the devices that a driver lists."""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

from analysis.signals.blocks import SegmentEnd, SourceItem
from analysis.signals.header import Acquisition


class Source(Protocol):
    """A device, a simulated rig or a recording, opened and ready to deliver blocks.

    Its constructor or `open_source` opens it and raises `DeviceError`, leaving nothing reserved, if that fails.
    `blocks` may be called once. A `SegmentEnd` follows the blocks of every segment. A fault of the device during the
    run is such an end, not an exception.
    """

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition with its actual settings, read back from the device."""
        ...

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped, finished or failed."""
        ...

    def stop(self) -> None:
        """Request the stop, from any thread; `blocks` delivers all samples read so far and ends."""
        ...

    def close(self) -> None:
        """Release the device; may be called twice."""
        ...


RESTART_PERIOD = 60.0  # s, in which `per_minute` new segments are allowed


class RestartLimiter:
    """Limits how often a run continues in a new segment after a fault; for use by one thread.

    Parameters
    ----------
    per_minute : int
        Maximum number of new segments within any minute; 0 for none.
    """

    def __init__(self, per_minute: int) -> None:
        self._per_minute = per_minute
        self._times: deque[float] = deque(maxlen=max(per_minute, 1))

    def decide(self, end: SegmentEnd, *, continues: bool) -> tuple[bool, SegmentEnd]:
        """Return whether the run may continue if the fault lets it, and the segment's end, which states the limit."""
        if not continues:
            return False, end
        now = time.monotonic()
        full = len(self._times) == self._per_minute
        if self._per_minute > 0 and not (full and now - self._times[0] < RESTART_PERIOD):
            self._times.append(now)
            return True, end
        reason = "every fault ends the run" if self._per_minute == 0 else f"{self._per_minute} new segments in a minute"
        detail = f"{end.detail}; the run ends here: {reason} (session.restarts_per_minute)"
        return False, replace(end, detail=detail)


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A device in the driver's list.

    Parameters
    ----------
    name : str
        The driver's name for it, as "Dev1"; it depends on the USB port.
    product : str
        Product type, as "USB-6251".
    serial : str
        Serial number, hexadecimal as printed on the card.
    simulated : bool
        Whether the driver only simulates it.
    busy : bool or None
        Whether another acquisition holds it; None if unknown.
    driver : str
        Name, version and location of the driver.
    """

    name: str
    product: str
    serial: str
    simulated: bool
    busy: bool | None
    driver: str

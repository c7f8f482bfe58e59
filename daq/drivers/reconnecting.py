"""A device that may go away and come back in the midst of a run."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition
from daq.drivers.source import RestartLimiter, Source
from daq.errors import DeviceError, DeviceFault
from daq.stop_flag import StopFlag

BROKEN = frozenset({EndReason.UNPLUGGED, EndReason.DEVICE_ERROR})
FINAL = frozenset({DeviceFault.BUSY, DeviceFault.REJECTED, DeviceFault.DRIVER})  # waiting does not help


class ReconnectingSource:
    """A `Source` that opens its device anew when it went away, and goes on with the next segment.

    A card that was unplugged or lost its supply, a device server that is gone or frozen: the segment ends with what is
    known of the loss, and the device is opened again and again until it is back. Where it comes back as another, is
    held by somebody else, refuses its settings or stays away for too long, the run ends with a segment without samples
    that says so.

    Parameters
    ----------
    open_device : callable
        Opens the device; DeviceError where it cannot be opened, which leaves nothing reserved.
    restarts : RestartLimiter
        How often a new segment may begin.
    retry : float
        Time between two attempts, s.
    patience : float
        How long the device may stay away, s; 0: it is not waited for.

    Raises
    ------
    DeviceError
        The device cannot be opened the first time.
    """

    def __init__(
        self, open_device: Callable[[], Source], restarts: RestartLimiter, *, retry: float, patience: float
    ) -> None:
        self._open = open_device
        self._restarts = restarts
        self._retry = retry
        self._patience = patience
        self._stopping = StopFlag()
        self._device = open_device()
        self._acquisition = self._device.acquisition

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition as it really is, read back from the device."""
        return self._acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped or finally failed."""
        first = 0
        while True:
            base, goes_on = first, False
            for item in self._device.blocks():
                numbered = replace(item, segment=base + item.segment)
                if isinstance(numbered, SampleBlock):
                    yield numbered
                    continue
                goes_on, numbered = self._judged(numbered)
                first = numbered.segment + 1
                yield numbered
            self._device.close()
            if not goes_on or self._stopping.is_set():
                return
            error = self._reconnect()
            if error is not None:
                reason = EndReason.UNPLUGGED if error.fault is DeviceFault.MISSING else EndReason.DEVICE_ERROR
                yield SegmentEnd(first, 0, reason, detail=str(error))
                return
            if self._stopping.is_set():
                self._device.close()
                return

    def stop(self) -> None:
        """Ask for the end, from any thread."""
        self._stopping.set()
        self._device.stop()

    def close(self) -> None:
        """Release the device; harmless when closed, from any thread."""
        self._stopping.set()
        self._device.close()

    def _judged(self, end: SegmentEnd) -> tuple[bool, SegmentEnd]:
        """Return whether the device is to be opened anew after this end, and the end with what is to be said."""
        if end.reason not in BROKEN or self._stopping.is_set() or self._patience == 0:
            return False, end
        return (True, end) if self._restarts.take() else (False, self._restarts.last(end))

    def _reconnect(self) -> DeviceError | None:
        """Open the device again until it is there or the end was asked for; return why it stays away."""
        deadline = time.monotonic() + self._patience
        while not self._stopping.is_set():
            self._stopping.wait(self._retry)
            if self._stopping.is_set():
                return None
            try:
                device = self._open()
            except DeviceError as error:
                if error.fault in FINAL:
                    return error
                if time.monotonic() >= deadline:
                    text = f"the device did not come back within {self._patience:g} s (session.reconnect_s): {error}"
                    return DeviceError(error.fault, text)
                continue
            if device.acquisition != self._acquisition:
                device.close()
                return DeviceError(DeviceFault.OTHER, _another(device.acquisition, self._acquisition))
            self._device = device
            return None
        return None


def _another(new: Acquisition, old: Acquisition) -> str:
    """Say that what came back cannot be recorded under the run's header."""
    if (new.device.product, new.device.serial) != (old.device.product, old.device.serial):
        came, was = (f"{device.product} {device.serial}" for device in (new.device, old.device))
        return f"another card came back, {came} in place of {was}: begin a new run"
    return "the card came back with other scaling, rate or driver: begin a new run"

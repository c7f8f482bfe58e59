"""Opens the source that a rig names, and reconnects to a card that was disconnected."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition
from daq.config.rig import Rig
from daq.config.schema import Backend
from daq.drivers.ni import open_ni_source
from daq.drivers.simulation.card import SimulatedCard, SimulatedSource
from daq.drivers.source import RestartLimiter, Source
from daq.errors import DeviceError, DeviceFault
from daq.stop_flag import StopFlag
from model.errors import ModelError

RECONNECT_REASONS = frozenset({EndReason.UNPLUGGED, EndReason.DEVICE_ERROR})
PERMANENT_FAULTS = frozenset({DeviceFault.BUSY, DeviceFault.REJECTED, DeviceFault.DRIVER})  # waiting does not help


class ReconnectingSource:
    """A `Source` that reopens its device after a disconnection and continues with the next segment.

    When the card is unplugged or loses its supply, or the device server disappears or freezes, the segment ends with
    what is known of the loss, and the device is reopened until it is back. If another device comes back, or the device
    is busy, rejects its settings or stays disconnected for too long, the run ends with an empty segment that states the
    reason.

    Parameters
    ----------
    open_device : callable
        Opens the device; raises DeviceError if that fails, leaving nothing reserved.
    restarts : RestartLimiter
        Limits new segments after faults.
    retry_interval : float
        Time between two attempts, s.
    timeout : float
        How long the device may stay disconnected, s; 0 to end the run at once.

    Raises
    ------
    DeviceError
        The device cannot be opened the first time.
    """

    def __init__(
        self, open_device: Callable[[], Source], restarts: RestartLimiter, *, retry_interval: float, timeout: float
    ) -> None:
        self._open = open_device
        self._restarts = restarts
        self._retry_interval = retry_interval
        self._timeout = timeout
        self._stopping = StopFlag()
        self._device = open_device()
        self.acquisition = self._device.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped or until reconnecting fails."""
        first = 0
        while True:
            base, continues = first, False
            for item in self._device.blocks():
                numbered = replace(item, segment=base + item.segment)
                if isinstance(numbered, SampleBlock):
                    yield numbered
                    continue
                continues, numbered = self._decide(numbered)
                first = numbered.segment + 1
                yield numbered
            self._device.close()
            if not continues or self._stopping.is_set():
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
        """Request the stop, from any thread."""
        self._stopping.set()
        self._device.stop()

    def close(self) -> None:
        """Release the device, from any thread; may be called twice."""
        self._stopping.set()
        self._device.close()

    def _decide(self, end: SegmentEnd) -> tuple[bool, SegmentEnd]:
        """Return whether to reconnect after this segment end, and the end with its final detail."""
        continues = end.reason in RECONNECT_REASONS and not self._stopping.is_set() and self._timeout > 0
        return self._restarts.decide(end, continues=continues)

    def _reconnect(self) -> DeviceError | None:
        """Reopen the device until it is back or a stop is requested; return the error if it stays disconnected."""
        deadline = time.monotonic() + self._timeout
        while not self._stopping.is_set():
            self._stopping.wait(self._retry_interval)
            if self._stopping.is_set():
                return None
            try:
                device = self._open()
            except DeviceError as error:
                if error.fault in PERMANENT_FAULTS:
                    return error
                if time.monotonic() >= deadline:
                    text = f"the device did not come back within {self._timeout:g} s (session.reconnect_s): {error}"
                    return DeviceError(error.fault, text)
                continue
            if device.acquisition != self.acquisition:
                device.close()
                return DeviceError(DeviceFault.OTHER, _other_device(device.acquisition, self.acquisition))
            self._device = device
            return None
        return None


def _other_device(new: Acquisition, old: Acquisition) -> str:
    """Return the message that the reconnected device does not match the run's header."""
    if (new.device.product, new.device.serial) != (old.device.product, old.device.serial):
        found, expected = (f"{device.product} {device.serial}" for device in (new.device, old.device))
        return f"another card was connected, {found} instead of {expected}: start a new run"
    return "the card was reconnected with another scaling, rate or driver: start a new run"


def open_source(rig: Rig) -> Source:
    """Return the rig's source, opened and ready.

    Parameters
    ----------
    rig : Rig
        The rig.

    Raises
    ------
    DeviceError
        The device or its driver is missing, busy or rejects the settings.
    """
    session = rig.config.session
    restarts = RestartLimiter(session.restarts_per_minute)
    if rig.config.device.backend is Backend.NIDAQMX:
        return ReconnectingSource(
            lambda: open_ni_source(rig, restarts), restarts, retry_interval=session.retry_s, timeout=session.reconnect_s
        )
    try:
        card = SimulatedCard(rig)
    except ModelError as error:
        raise DeviceError(DeviceFault.REJECTED, f"the simulated shaft cannot start: {error}") from error
    rate = card.acquisition.rate
    return SimulatedSource(
        card,
        block=max(round(rig.config.timing.block_s * rate), 1),
        buffer=round(rig.config.timing.buffer_s * rate),
        real_time=rig.config.simulation.pace == "real time",
        restarts=restarts,
    )

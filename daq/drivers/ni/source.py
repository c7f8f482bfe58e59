"""The card as a source: fixed-size blocks, read by the caller's thread, and every gap told."""

import datetime as dt
import time
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import replace
from typing import TYPE_CHECKING

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import Acquisition
from daq.config.rig import Rig
from daq.config.schema import DeviceSection
from daq.drivers.ni.counter_stamps import Stamps
from daq.drivers.ni.devices import FoundDevice
from daq.drivers.ni.error_codes import ABSENT_CODES, OVERRUN_CODES, card_extra
from daq.drivers.source import RestartLimiter
from daq.errors import DeviceError
from daq.stop_flag import StopFlag

if TYPE_CHECKING:
    from daq.drivers.ni.card import NiCard

COMPARED_EVERY = 1.0  # s of samples, after which our count is compared with the driver's


def open_ni_source(rig: Rig, restarts: RestartLimiter | None = None) -> "NiSource":
    """Open the card that a rig names, reserve it and read back what it was really set to.

    Parameters
    ----------
    rig : Rig
        A rig whose backend is nidaqmx.
    restarts : RestartLimiter or None
        How often a new segment may begin; None for what the rig says.

    Returns
    -------
    NiSource
        Ready to deliver blocks.

    Raises
    ------
    DeviceError
        Package or driver not installed, server out of reach, card missing or busy, settings rejected. Nothing is left
        reserved.
    """
    with card_extra():
        from daq.drivers.ni.card import NiCard  # noqa: PLC0415 - an optional extra, and slow to import
    return NiSource(NiCard(rig), restarts or RestartLimiter(rig.config.session.restarts_per_minute))


def connected_devices(section: DeviceSection) -> list[FoundDevice]:
    """Return what is connected to this machine, or to the device server that a section names.

    Raises
    ------
    DeviceError
        Package or driver not installed, server out of reach.
    """
    with card_extra():
        from daq.drivers.ni.system import NiSystem  # noqa: PLC0415 - an optional extra, and slow to import
    with closing(NiSystem(section)) as system:
        return system.devices()


def self_test(section: DeviceSection) -> dt.date | None:
    """Let the card that a section names test itself; it must be idle.

    Returns
    -------
    date or None
        When it last calibrated itself; None where it does not tell.

    Raises
    ------
    DeviceError
        Package or driver not installed, server out of reach, card missing, busy or failed.
    """
    with card_extra():
        from daq.drivers.ni.system import NiSystem  # noqa: PLC0415 - an optional extra, and slow to import
    with closing(NiSystem(section)) as system:
        return system.self_test()


class NiSource:
    """The card, opened and ready to deliver blocks.

    After an overrun the acquisition starts anew, as the next segment; any other fault ends it.

    Parameters
    ----------
    card : NiCard
        The card with its acquisition committed; closed by `close`.
    restarts : RestartLimiter
        How often a new segment may begin.
    """

    def __init__(self, card: "NiCard", restarts: RestartLimiter) -> None:
        self._card = card
        self._restarts = restarts
        self._stamps = Stamps(card)
        self._stopping = StopFlag()
        self._iterated = False

    @property
    def acquisition(self) -> Acquisition:
        """The acquisition as it really is, read back from the device."""
        return self._card.acquisition

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped or failed.

        A card that does not even start is told by the end of a segment without samples.

        Raises
        ------
        RuntimeError
            Iterated a second time.
        """
        if self._iterated:
            raise RuntimeError("blocks: iterated a second time, expected once; open the card anew")
        self._iterated = True
        return self._run()

    def stop(self) -> None:
        """Ask for the end, from any thread; `blocks` ends within a block."""
        self._stopping.set()

    def close(self) -> None:
        """Release the card and the connection to it; harmless when closed, from any thread."""
        self._stopping.set()
        self._card.close()

    def _run(self) -> Iterator[SourceItem]:
        segment = 0
        try:
            while True:
                try:
                    self._start(again=segment > 0)
                except DeviceError as error:
                    yield self._fault(segment, 0, error)
                    return
                end = self._told((yield from self._segment(segment)))
                goes_on = end.reason is EndReason.OVERRUN and not self._stopping.is_set()
                if goes_on and not self._restarts.take():
                    goes_on, end = False, self._restarts.last(end)
                yield end
                if not goes_on or self._stopping.is_set():
                    return
                segment += 1
        finally:
            self._card.release()

    def _start(self, *, again: bool) -> None:
        if again:
            try:
                self._card.stop()
            except DeviceError as error:
                if error.code not in OVERRUN_CODES:  # stopping says once more what ended the acquisition
                    raise
        self._stamps.start(again=again)
        self._card.start()

    def _segment(self, segment: int) -> Generator[SourceItem, None, SegmentEnd]:
        count = compared = 0
        apart: int | None = None  # driver's count less ours: what it counts from is its own matter, as long as it stays
        while not self._stopping.is_set():
            try:
                codes = self._card.read()
            except DeviceError as error:
                return self._fault(segment, count, error)
            host_time_ns = time.time_ns()
            backlog, fault = self._backlog()
            first, count = count, count + codes.shape[1]
            if fault is not None and fault.code == 0:  # the way to the driver failed: the counter need not be asked
                self._stamps.fail(count, fault)
            ticks = self._stamps.upto(count, backlog)
            yield SampleBlock(codes, segment, first, host_time_ns, backlog, ticks)
            if fault is not None:
                return self._fault(segment, count, fault)
            if count - compared >= COMPARED_EVERY * self.acquisition.rate:
                compared = count
                try:
                    position = self._card.position()
                except DeviceError as error:
                    return self._fault(segment, count, error)
                apart = position - count if apart is None else apart
                if position - count != apart:
                    return _miscounted(segment, count, position - apart)
        return self._stopped(segment, count)

    def _told(self, end: SegmentEnd) -> SegmentEnd:
        """Return a segment's end with what is to be said of the counter, and what the driver has warned of."""
        end = self._stamps.told(end)
        return replace(end, detail="; ".join(filter(None, (end.detail, *self._card.warnings()))))

    def _backlog(self) -> tuple[int, DeviceError | None]:
        try:
            return self._card.backlog(), None
        except DeviceError as error:
            return 0, error

    def _stopped(self, segment: int, count: int) -> SegmentEnd:
        """End what was stopped, if the driver counted as many samples as we did."""
        try:
            position = self._card.position()
        except DeviceError as error:
            detail = f"the driver's own count could not be asked: {error}"
            return SegmentEnd(segment, count, EndReason.STOPPED, detail=detail)
        if position == count:
            return SegmentEnd(segment, count, EndReason.STOPPED)
        return _miscounted(segment, count, position)

    def _fault(self, segment: int, count: int, error: DeviceError) -> SegmentEnd:
        if error.code == 0:  # the way to the driver failed: there is nobody to ask
            return SegmentEnd(segment, count, EndReason.DEVICE_ERROR, lost_is_exact=False, detail=str(error))
        try:
            lost = max(0, self._card.acquired() - count)
        except DeviceError:
            lost = 0
        detail = str(error)
        if error.code in OVERRUN_CODES:
            reason = EndReason.OVERRUN
        else:
            self._card.release()
            if error.code in ABSENT_CODES or not self._card.is_present():
                reason, detail = EndReason.UNPLUGGED, f"the card is gone: {detail}"
            else:
                reason = EndReason.DEVICE_ERROR
        return SegmentEnd(segment, count, reason, lost, lost_is_exact=False, detail=detail)


def _miscounted(segment: int, count: int, position: int) -> SegmentEnd:
    """Return the end of a segment of which the driver has counted other than we have."""
    detail = f"the driver counts {position} samples delivered, {count} were taken"
    if position > count:
        return SegmentEnd(segment, count, EndReason.OVERRUN, lost=position - count, detail=detail)
    return SegmentEnd(segment, count, EndReason.DEVICE_ERROR, lost_is_exact=False, detail=detail)

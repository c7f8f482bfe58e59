"""The card as a source of sample blocks with the counter's timestamps, and functions that list and test devices."""

import datetime as dt
import time
from collections.abc import Generator, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd, SourceItem
from daq.config.rig import Rig
from daq.config.schema import DeviceSection
from daq.drivers.ni.error_codes import ABSENT_CODES, OVERRUN_CODES, card_extra_required
from daq.drivers.source import FoundDevice, RestartLimiter
from daq.errors import DeviceError, DeviceFault
from daq.stop_flag import StopFlag

if TYPE_CHECKING:
    from daq.drivers.ni.card import NiCard

MAX_TIMESTAMP_DELAY = 5.0  # s from the edge to the program: longer than any real delay, much shorter than a wrap


class CounterUnwrapper:
    """Extends latched counts to 64 bits.

    Between two counts less than a wrap apart, the counter wraps at most once. After a longer pause the counts alone are
    ambiguous. Then the samples decide: the counter was empty when it was last read, so the next edge came later than
    that, by less than a wrap.

    Parameters
    ----------
    wrap : int
        Number of ticks after which the card's count starts again from 0.
    """

    def __init__(self, wrap: int) -> None:
        self._wrap = wrap
        self._minimum = 0  # of the next count, in ticks since the counter started

    def ticks(self, counts: NDArray[np.uint32]) -> NDArray[np.int64]:
        """Return the ticks since the counter started, for the counts read next."""
        if counts.size == 0:
            return np.empty(0, np.int64)
        steps = np.mod(np.diff(counts.astype(np.int64)), self._wrap)
        first = self._minimum + (int(counts[0]) - self._minimum) % self._wrap
        ticks = first + np.concatenate([[0], np.cumsum(steps)])
        self._minimum = int(ticks[-1]) + 1
        return ticks

    def no_edge_before(self, tick: int) -> None:
        """Set the tick before which no unread edge can lie."""
        self._minimum = max(self._minimum, tick)


class CounterStamps:
    """The counter's timestamps in one segment.

    Parameters
    ----------
    card : NiCard
        The card, with or without a counter.
    """

    def __init__(self, card: "NiCard") -> None:
        self._card = card
        self._counter = card.acquisition.tacho.counter
        self._ticks_per_sample = card.acquisition.ticks_per_sample
        self._reset()

    def _reset(self) -> None:
        self._unwrapper = CounterUnwrapper(self._card.counter_wrap)
        self._ahead = np.empty(0, np.int64)  # timestamps of samples that have not been read yet
        self._fault = ""

    def start(self, *, again: bool) -> None:
        """Begin a segment: start the counter, which then waits for the first sample."""
        self._reset()
        if self._counter is None:
            return
        if again:
            with suppress(DeviceError):  # starting it reports the same error
                self._card.stop_counter()
        try:
            self._card.start_counter()
        except DeviceError as error:
            self.fail(0, error)

    def take_until(self, end: int, backlog: int) -> NDArray[np.int64] | None:
        """Return the new timestamps up to a sample, without waiting; None without a working counter.

        Parameters
        ----------
        end : int
            One past the last sample that was read.
        backlog : int
            Number of samples that the card has acquired after it.
        """
        if self._counter is None or self._fault:
            return None
        try:
            counts, is_empty = self._card.counts()
        except DeviceError as error:
            self.fail(end, error)
            return None
        timebase, here = self._counter.timebase, end * self._ticks_per_sample
        ticks, newest = self._unwrapper.ticks(counts), here + backlog * self._ticks_per_sample
        if ticks.size and ticks[-1] > newest + MAX_TIMESTAMP_DELAY * timebase:
            counted = f"it counted {ticks[-1] / timebase:.1f} s, but the samples are at {newest / timebase:.1f} s"
            reason = "it uses another clock or did not start with them"
            self.fail(end, DeviceError(DeviceFault.OTHER, f"{counted}: {reason}"))
            return None
        if is_empty:
            self._unwrapper.no_edge_before(int(here - MAX_TIMESTAMP_DELAY * timebase))
        known = np.concatenate([self._ahead, ticks])
        taken, self._ahead = np.split(known, [np.searchsorted(known, here)])
        return taken

    def fail(self, end: int, error: DeviceError) -> None:
        """Stop using the counter for the rest of the segment, from a sample on."""
        if self._counter is not None and not self._fault:
            self._fault = (
                f"the tacho's counter {self._counter.counter} gave no timestamps from sample {end} on: {error}"
            )

    def with_fault(self, end: SegmentEnd) -> SegmentEnd:
        """Return the segment's end with a fault of the counter added to its detail."""
        return replace(end, detail="; ".join(filter(None, (end.detail, self._fault))))


if TYPE_CHECKING:
    from daq.drivers.ni.card import NiCard

COUNT_CHECK_INTERVAL = 1.0  # s of samples between two comparisons of our sample count with the driver's


def open_ni_source(rig: Rig, restarts: RestartLimiter | None = None) -> "NiSource":
    """Return the card that a rig names, opened, reserved and with its actual settings read back.

    Parameters
    ----------
    rig : Rig
        A rig whose backend is nidaqmx.
    restarts : RestartLimiter or None
        Limits new segments after faults; None for the rig's own limit.

    Returns
    -------
    NiSource
        A source that is ready to deliver blocks.

    Raises
    ------
    DeviceError
        The package or driver is not installed, the server is unreachable, the card is missing or busy, or the driver
        rejects the settings. Nothing stays reserved.
    """
    with card_extra_required():
        from daq.drivers.ni.card import NiCard  # noqa: PLC0415 - an optional extra, and slow to import
    return NiSource(NiCard(rig), restarts or RestartLimiter(rig.config.session.restarts_per_minute))


def connected_devices(section: DeviceSection) -> list[FoundDevice]:
    """Return the devices connected to this machine, or to the device server that a section names.

    Raises
    ------
    DeviceError
        The package or driver is not installed, or the server is unreachable.
    """
    with card_extra_required():
        from daq.drivers.ni.card import Connection  # noqa: PLC0415 - an optional extra, and slow to import
    with closing(Connection(section)) as connection:
        return connection.devices()


def self_test(section: DeviceSection) -> dt.date | None:
    """Run the self-test of the card that a section names; the card must be idle.

    Returns
    -------
    date or None
        Date of its last self-calibration; None if unknown.

    Raises
    ------
    DeviceError
        The package or driver is not installed, the server is unreachable, or the card is missing, busy or defective.
    """
    with card_extra_required():
        from daq.drivers.ni.card import Connection  # noqa: PLC0415 - an optional extra, and slow to import
    with closing(Connection(section)) as connection:
        return connection.self_test()


class NiSource:
    """A `Source` that reads an opened card.

    After an overrun the acquisition restarts as the next segment; any other fault ends the run.

    Parameters
    ----------
    card : NiCard
        The card with its acquisition committed; closed by `close`.
    restarts : RestartLimiter
        Limits new segments after faults.
    """

    def __init__(self, card: "NiCard", restarts: RestartLimiter) -> None:
        self._card = card
        self._restarts = restarts
        self._stamps = CounterStamps(card)
        self.acquisition = card.acquisition
        self._stopping = StopFlag()
        self._is_started = False

    def blocks(self) -> Iterator[SourceItem]:
        """Start, and yield blocks and segment ends until stopped or failed.

        If the card does not start, the only item is the end of a segment without samples.

        Raises
        ------
        RuntimeError
            Called a second time.
        """
        if self._is_started:
            raise RuntimeError("blocks: called a second time, expected once; open the card again")
        self._is_started = True
        return self._run()

    def stop(self) -> None:
        """Request the stop, from any thread; `blocks` ends within a block."""
        self._stopping.set()

    def close(self) -> None:
        """Release the card and close the connection to it, from any thread; may be called twice."""
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
                end = self._with_details((yield from self._segment(segment)))
                continues = end.reason is EndReason.OVERRUN and not self._stopping.is_set()
                continues, end = self._restarts.decide(end, continues=continues)
                yield end
                if not continues or self._stopping.is_set():
                    return
                segment += 1
        finally:
            self._card.release()

    def _start(self, *, again: bool) -> None:
        if again:
            try:
                self._card.stop()
            except DeviceError as error:
                if error.code not in OVERRUN_CODES:  # stopping reports once more what ended the acquisition
                    raise
        self._stamps.start(again=again)
        self._card.start()

    def _segment(self, segment: int) -> Generator[SourceItem, None, SegmentEnd]:
        count = checked = 0
        offset: int | None = None  # driver's count minus ours: its zero point is unknown, but must not change
        try:
            while not self._stopping.is_set():
                codes = self._card.read()
                host_time_ns = time.time_ns()
                backlog, fault = self._backlog()
                first, count = count, count + codes.shape[1]
                if fault is not None and fault.code == 0:  # the connection failed, so the counter cannot be read
                    self._stamps.fail(count, fault)
                ticks = self._stamps.take_until(count, backlog)
                yield SampleBlock(codes, segment, first, host_time_ns, backlog, ticks)
                if fault is not None:
                    return self._fault(segment, count, fault)
                if count - checked >= COUNT_CHECK_INTERVAL * self.acquisition.rate:
                    checked = count
                    position = self._card.position()
                    offset = position - count if offset is None else offset
                    if position - count != offset:
                        return _miscounted(segment, count, position - offset)
        except DeviceError as error:
            return self._fault(segment, count, error)
        return self._stopped(segment, count)

    def _with_details(self, end: SegmentEnd) -> SegmentEnd:
        """Return a segment's end with the counter's fault and the driver's warnings added to its detail."""
        end = self._stamps.with_fault(end)
        return replace(end, detail="; ".join(filter(None, (end.detail, *self._card.warnings.take_new()))))

    def _backlog(self) -> tuple[int, DeviceError | None]:
        try:
            return self._card.backlog(), None
        except DeviceError as error:
            return 0, error

    def _stopped(self, segment: int, count: int) -> SegmentEnd:
        """Return the end of a stopped segment; a fault if the driver counted other than we did."""
        try:
            position = self._card.position()
        except DeviceError as error:
            detail = f"the driver's own count could not be read: {error}"
            return SegmentEnd(segment, count, EndReason.STOPPED, detail=detail)
        if position == count:
            return SegmentEnd(segment, count, EndReason.STOPPED)
        return _miscounted(segment, count, position)

    def _fault(self, segment: int, count: int, error: DeviceError) -> SegmentEnd:
        if error.code == 0:  # the connection failed, so the loss is unknown
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
                reason, detail = EndReason.UNPLUGGED, f"the card is disconnected: {detail}"
            else:
                reason = EndReason.DEVICE_ERROR
        return SegmentEnd(segment, count, reason, lost, lost_is_exact=False, detail=detail)


def _miscounted(segment: int, count: int, position: int) -> SegmentEnd:
    """Return the end of a segment in which the driver's sample count differs from ours."""
    detail = f"the driver counts {position} delivered samples, but {count} were received"
    if position > count:
        return SegmentEnd(segment, count, EndReason.OVERRUN, lost=position - count, detail=detail)
    return SegmentEnd(segment, count, EndReason.DEVICE_ERROR, lost_is_exact=False, detail=detail)

"""The recorder: a process that only carries samples from the source into the file and the ring.

It exchanges messages with the controlling process over an anonymous pipe. It sends `DeviceOpened` or
`RecordingRefused` first, `AcquisitionEnded` when the samples have ended, and `FileClosed` last. It receives results to
store with the samples, `StopRequest`, and `ResultsEnded` when no more results follow. If the controlling process dies,
the recorder stops the source and completes the file on its own.
"""

import logging
import shutil
import signal
import threading
import time
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue

from analysis.signals.blocks import EndReason, SampleBlock, SegmentEnd
from analysis.signals.header import RunHeader
from daq.config.rig import Rig
from daq.drivers.factory import open_source
from daq.drivers.source import Source
from daq.drivers.triggered import TriggerStart, apply_trigger
from daq.errors import RigError, StoppedError, UsageError
from daq.session.processes import ignore_terminal_signals
from daq.session.recording.ring import BlockRing, SharedBytes
from daq.session.recording.statistics import RecorderStatistics
from recordings.errors import RecordingError
from recordings.mcap.parts import PartLimits, PartWriter
from recordings.mcap.results import EncodedResult, Marker, encode_marker


@dataclass(frozen=True, slots=True)
class RecordingRequest:
    """A run to record.

    Parameters
    ----------
    rig : Rig
        The rig.
    run : str
        Id of the run.
    started_ns : int
        Wall clock, ns since 1970.
    note, program : str
        The operator's note; name and version of the program.
    path : Path
        The file to create.
    duration : float or None
        Sample time after which to stop, s; None: until it is stopped.
    """

    rig: Rig
    run: str
    started_ns: int
    note: str
    program: str
    path: Path
    duration: float | None


@dataclass(frozen=True, slots=True)
class DeviceOpened:
    """The device is open and the file is created."""

    header: RunHeader


@dataclass(frozen=True, slots=True)
class RecordingRefused:
    """The recording did not start; nothing was recorded."""

    message: str
    exit_code: int


@dataclass(frozen=True, slots=True)
class AcquisitionEnded:
    """No more samples follow; the recorder still accepts results."""

    ends: tuple[SegmentEnd, ...]


@dataclass(frozen=True, slots=True)
class FileClosed:
    """The file is complete; `message` is the error message, empty for none."""

    message: str


@dataclass(frozen=True, slots=True)
class StopRequest:
    """Request to stop the source."""


@dataclass(frozen=True, slots=True)
class ResultsEnded:
    """No more results follow; the live analysis skipped this number of samples per channel."""

    skipped_samples: int


class MessageSender:
    """Sender of messages to another process, in order, from its own thread: a blocked receiver blocks no caller.

    Parameters
    ----------
    pipe : Connection
        Connection to the other process. When it breaks, queued messages are dropped.
    """

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._messages: SimpleQueue[object] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="message-sender", daemon=True)
        self._thread.start()

    def send(self, message: object) -> None:
        """Queue a message; safe from any thread."""
        self._messages.put(message)

    def close(self, timeout: float) -> bool:
        """Send the queued messages within `timeout` s; return whether the thread has ended."""
        self._messages.put(None)
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (message := self._messages.get()) is not None:
            try:
                self._pipe.send(message)
            except OSError:
                return


logger = logging.getLogger(__name__)

RESULTS_DEADLINE = 15.0  # s to wait for the last results after the acquisition, before the file is closed without


def record(
    request: RecordingRequest, ring_memory: SharedBytes, statistics: RecorderStatistics, pipe: Connection
) -> None:
    """Run the recorder; entry point of its process."""
    ignore_terminal_signals()  # the controlling process handles them
    ring = BlockRing(ring_memory)
    with ExitStack() as stack:
        try:
            free, reserve = _disk_space(request)
            if free < reserve:
                raise UsageError(_disk_full_message(request, free, reserve))
            source = stack.enter_context(closing(open_source(request.rig)))
            if pipe.poll():  # the only message sent before `DeviceOpened` is a stop request
                raise StoppedError("stopped before the device was open")
            header = run_header(request, source)
            writer = PartWriter(request.path, header, _part_limits(request, header))
        except RigError as error:
            with suppress(OSError):  # after a stop the controlling process does not wait
                pipe.send(RecordingRefused(str(error), error.exit_code))
        except RecordingError as error:
            pipe.send(RecordingRefused(str(error), UsageError.exit_code))
        else:
            _Recorder(request, source, writer, ring, statistics, pipe).run()


def _part_limits(request: RecordingRequest, header: RunHeader) -> PartLimits:
    """Return the size and duration limits of a run's files, from the rig file."""
    storage = request.rig.config.storage
    samples = round(60 * storage.split_minutes * header.acquisition.rate) or None
    return PartLimits(samples, round(1e9 * storage.split_gb) or None, request.rig.config.trigger.events != 1)


def _disk_space(request: RecordingRequest) -> tuple[int, int]:
    """Return the free bytes of the run's disk, and the reserve that must stay free."""
    return shutil.disk_usage(request.path.parent).free, int(request.rig.config.storage.reserve_gb * 1e9)


def _disk_full_message(request: RecordingRequest, free: int, reserve: int) -> str:
    return (
        f"{request.path.parent}: {free / 1e9:.2f} GB free, expected more than storage.reserve_gb = {reserve / 1e9:g}: "
        "free disk space or record elsewhere (storage.folder, RIG_DATA)"
    )


def run_header(request: RecordingRequest, source: Source) -> RunHeader:
    """Return the header of the run, with the acquisition read back from the opened device."""
    return RunHeader(
        run=request.run,
        rig=request.rig.config.rig,
        started_ns=request.started_ns,
        acquisition=source.acquisition,
        settings=request.rig.settings,
        limits=request.rig.limits,
        config_toml=request.rig.toml,
        program=request.program,
        note=request.note,
    )


def _log_fault(error: Exception) -> str:
    """Log the traceback of a defect and return its message for the end of the file."""
    logger.error("recording stopped", exc_info=error)
    return f"recording stopped by a program error: {type(error).__name__}: {error}"


class _Recorder:
    """Carries blocks from the source into file and ring until the end, and stores results from the pipe."""

    def __init__(
        self,
        request: RecordingRequest,
        source: Source,
        writer: PartWriter,
        ring: BlockRing,
        statistics: RecorderStatistics,
        pipe: Connection,
    ) -> None:
        self._request = request
        self._header = run_header(request, source)
        self._source = apply_trigger(source, request.rig.config.trigger, self)
        self._skipped_by_trigger = 0  # samples per channel that the trigger skipped since the last block it delivered
        self._writer = writer
        self._ring = ring
        self._statistics = statistics
        self._pipe = pipe
        self._ends: list[SegmentEnd] = []
        self._message = ""
        self._skipped: int | None = None  # unknown until `ResultsEnded` arrives
        self._results_ended = threading.Event()
        self._disk_checked = -1.0
        rate = source.acquisition.rate
        self._rate = rate
        self._max_samples = None if request.duration is None else max(1, round(request.duration * rate))

    def run(self) -> None:
        signal.signal(signal.SIGTERM, lambda *_: self._source.stop())
        listener = threading.Thread(target=self._listen, name="recorder-listener", daemon=True)
        try:
            self._pipe.send(DeviceOpened(self._header))
            listener.start()
            self._statistics.start()
            self._record_blocks()
        except Exception as error:  # noqa: BLE001 - any error: the file is completed and the error reported
            self._message = _log_fault(error)
            self._source.stop()
        finally:
            self._ring.finish()
            self._source.close()
            with suppress(OSError):  # the controlling process may be dead; the file matters
                self._pipe.send(AcquisitionEnded(tuple(self._ends)))
                self._results_ended.wait(RESULTS_DEADLINE)
            self._close_file()
            listener.join(1.0)

    def _record_blocks(self) -> None:
        for item in self._source.blocks():
            try:
                self._record(item)
            except RecordingError as error:
                self._end_after_write_error(item, str(error))
                return

    def _record(self, item: SampleBlock | SegmentEnd) -> None:
        if isinstance(item, SegmentEnd):
            if item.reason is EndReason.STOPPED:
                has_reached_duration = self._max_samples is not None and self._statistics.samples >= self._max_samples
                item = replace(
                    item,
                    reason=EndReason.FINISHED if has_reached_duration else item.reason,
                    detail=self._message or item.detail,
                )
            self._writer.write_segment_end(item)
            self._statistics.add_end(item)
            self._ends.append(item)
        else:
            self._writer.write_block(item)
            self._statistics.add_block(item)
            self._check_disk_space()
            if self._max_samples is not None and self._statistics.samples >= self._max_samples:
                self._source.stop()
        self._ring.put(item)

    def on_waiting(self, event: int, speed: float) -> None:
        """Set the statistics to armed for an event; a method of `TriggerListener`."""
        self._statistics.set_armed(event, speed)

    def on_skipped(self, samples: int) -> None:
        """Count samples skipped by the trigger; a method of `TriggerListener`."""
        self._writer.skip_samples(samples)
        self._skipped_by_trigger += samples

    def on_start(self, start: TriggerStart) -> None:
        """Record the start of an event as a marker; a method of `TriggerListener`."""
        skipped, self._skipped_by_trigger = self._skipped_by_trigger, 0
        text = f"start: {start.condition}, after {skipped:,} samples ({skipped / self._rate:,.1f} s) skipped"
        marker = Marker(start.segment, start.sample, text, time.time_ns())
        self._writer.add_result(encode_marker(marker, self._header))

    def _end_after_write_error(self, item: SampleBlock | SegmentEnd, message: str) -> None:
        """Stop after a failed write; samples after the last written block count as lost."""
        self._message = message
        self._source.stop()
        lost = item.n_samples if isinstance(item, SampleBlock) else 0
        end = SegmentEnd(
            item.segment,
            self._statistics.segment_samples,
            EndReason.RECORDER,
            lost,
            lost_is_exact=False,
            detail=message,
        )
        self._statistics.add_end(end)
        self._ends.append(end)
        self._ring.put(end)

    def _check_disk_space(self) -> None:
        now = time.monotonic()
        if now - self._disk_checked < 1.0:
            return
        self._disk_checked = now
        free, reserve = _disk_space(self._request)
        self._statistics.disk_bytes_left = max(0, free - reserve)
        if free < reserve and not self._message:
            self._message = "recording stopped: " + _disk_full_message(self._request, free, reserve)
            self._source.stop()

    def _listen(self) -> None:
        """Receive results and stop requests until the controlling process is done or dead; then stop the source."""
        try:
            while True:
                message = self._pipe.recv()
                if isinstance(message, EncodedResult):
                    with suppress(RecordingError):  # the sample path meets the same error and reports it
                        self._writer.add_result(message)
                elif isinstance(message, StopRequest):
                    self._source.stop()
                elif isinstance(message, ResultsEnded):
                    self._skipped = message.skipped_samples
                    return
        except (EOFError, OSError):
            pass  # the controlling process is dead
        except Exception as error:  # noqa: BLE001 - any error: the file is completed and the error reported
            self._message = _log_fault(error)
        finally:
            self._source.stop()
            self._results_ended.set()

    def _close_file(self) -> None:
        try:
            # without `ResultsEnded` the stored results may be incomplete: count all as skipped
            skipped = self._statistics.samples if self._skipped is None else self._skipped
            self._writer.close(skipped_samples=skipped)
        except RecordingError as error:
            self._message = self._message or str(error)
        with suppress(OSError):
            self._pipe.send(FileClosed(self._message))

"""A run being recorded: controls the recorder process, analyses its samples live and returns the results to it."""

import logging
import math
import multiprocessing
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

from analysis.live.alarms import Alarm
from analysis.live.summary import RunSummary
from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from daq.config.rig import Rig
from daq.errors import DeviceError, DeviceFault, RigError, StoppedError
from daq.session.live_analysis import LiveAnalysis
from daq.session.live_update import (
    LiveUpdate,
    LiveUpdateSink,
    RunState,
    Status,
    TimedMarker,
    acknowledgement_marker,
    alarm_marker,
)
from daq.session.predictor import Predictor
from daq.session.processes import terminal_signals_blocked
from daq.session.recording.recorder import (
    RESULTS_DEADLINE,
    AcquisitionEnded,
    DeviceOpened,
    FileClosed,
    MessageSender,
    RecordingRefused,
    RecordingRequest,
    ResultsEnded,
    StopRequest,
    record,
)
from daq.session.recording.ring import BlockRing, RingReader
from daq.session.recording.statistics import (
    RecorderStatistics,
    clipped_channels,
    loss_message,
    reconnect_message,
    recording_health,
)
from daq.session.run import RunOutcome
from recordings.mcap.results import DEFAULT_TEXT, MAX_MARKER_LENGTH, Marker, encode_marker, encode_snapshot

logger = logging.getLogger(__name__)

OPEN_DEADLINE = 120.0  # s: the simulated rig compiles its model the first time
OPEN_POLL_INTERVAL = 0.1  # s between checks for a stop request while the device is being opened
RING_SECONDS = 8.0  # of samples that the live analysis may fall behind before it skips
POLL_INTERVAL = 0.02  # s between reads of the ring
STATUS_INTERVAL = 0.5  # s between live updates without a new snapshot
KILL_DEADLINE = 5.0  # s for the system to end a killed process
STOP_DEADLINE = 30.0  # s that a recorder has to end its acquisition before it is killed


class RecordedRun:
    """A run being recorded: a recorder process and the live analysis in a thread of this one.

    Parameters
    ----------
    request : RecordingRequest
        The run to record.
    model : Predictor
        The model whose prediction is shown with it.
    sinks : sequence of LiveUpdateSink
        Consumers of the live updates.
    is_stopping : callable
        Returns whether the user has requested the end; called while the device is being opened.
    stop_deadline : float
        Time after a stop request, s, when the recorder is killed. Its file holds all flushed samples.

    Attributes
    ----------
    header : RunHeader
        The run's header, with the acquisition as the device reported it.
    path : Path
        The file.

    Raises
    ------
    StoppedError
        The end was requested before the device was open; nothing is left behind.
    RigError
        The device or the file cannot be opened; nothing is left behind.
    """

    def __init__(
        self,
        request: RecordingRequest,
        model: Predictor,
        sinks: Sequence[LiveUpdateSink] = (),
        is_stopping: Callable[[], bool] = lambda: False,
        stop_deadline: float = STOP_DEADLINE,
    ) -> None:
        self.path = request.path
        self._request = request
        self._model = model
        rig: Rig = request.rig
        timing = rig.config.timing
        capacity = math.ceil(timing.rate_hz * timing.block_s) + 1
        self._statistics = RecorderStatistics.allocate()
        self._ring = BlockRing.create(
            len(rig.config.channel), capacity, max(16, math.ceil(RING_SECONDS / timing.block_s))
        )
        self._reader = RingReader(self._ring)
        self._pipe, self._process = self._start_recorder()
        self._sender = MessageSender(self._pipe)
        self._stop_deadline = stop_deadline
        self._end_at = math.inf  # on the monotonic clock
        self._ends: tuple[SegmentEnd, ...] = ()
        self._last_end: SegmentEnd | None = None
        self._last_loss = ""
        self._message = ""
        self._analysis_error = ""
        self._error = ""
        self._state = RunState.STARTING
        self._is_stopped_by_user = False
        try:
            self.header = self._wait_until_open(is_stopping)
        except BaseException:
            self._release()
            raise
        self._rate = self.header.acquisition.rate
        self._analysis: LiveAnalysis | None = LiveAnalysis(
            self.header, model, sinks, self._store_snapshot, self._store_alarm
        )
        self._display = self._analysis
        self._state = RunState.RECORDING
        self._thread = threading.Thread(target=self._run, name="live-analysis", daemon=True)
        self._thread.start()

    def _start_recorder(self) -> tuple[Connection, BaseProcess]:
        context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
        here, there = context.Pipe()
        process = context.Process(
            target=record, args=(self._request, self._ring.memory, self._statistics, there), name="rig-recorder"
        )
        with terminal_signals_blocked():
            process.start()
        there.close()
        return here, process

    def _wait_until_open(self, is_stopping: Callable[[], bool]) -> RunHeader:
        deadline = time.monotonic() + OPEN_DEADLINE
        while not self._pipe.poll(OPEN_POLL_INTERVAL):
            if is_stopping():
                self._sender.send(StopRequest())
                raise _stopped_error()
            if time.monotonic() > deadline:
                raise DeviceError(DeviceFault.TIMEOUT, f"the device was not open after {OPEN_DEADLINE:g} s")
        try:
            message = self._pipe.recv()
        except EOFError:
            self._process.join(5.0)
            if is_stopping():  # the recorder saw the request as well
                raise _stopped_error() from None
            raise DeviceError(
                DeviceFault.OTHER,
                f"the recorder ended before the recording started (exit code {self._process.exitcode})",
            ) from None
        if isinstance(message, RecordingRefused):
            error = RigError(message.message)
            error.exit_code = message.exit_code
            raise error
        opened: DeviceOpened = message
        return opened.header

    def _store_snapshot(self, snapshot: Snapshot) -> None:
        """Send a snapshot to the recorder, which stores it with the samples."""
        for result in encode_snapshot(snapshot, self.header):
            self._sender.send(result)

    def _store_alarm(self, alarm: Alarm) -> None:
        """Send the marker of a new alarm to the recorder, which stores it with the samples."""
        self._add_marker(alarm_marker(alarm, self._rate, time.time_ns()))

    def _add_marker(self, marker: Marker) -> None:
        """Show a marker, and send it to the recorder, which stores it with the samples."""
        (segment, sample), samples = self._statistics.position, self._statistics.samples
        # a marker in an earlier segment is shown at the start of the current one
        since = marker.sample if marker.segment == segment else 0
        self._display.add_marker(
            TimedMarker(marker, marker.sample / self._rate, (samples - sample + since) / self._rate)
        )
        self._sender.send(encode_marker(marker, self.header))

    def _request_stop(self) -> None:
        """Send a stop request; the stop deadline starts with the first one."""
        self._end_at = min(self._end_at, time.monotonic() + self._stop_deadline)
        self._sender.send(StopRequest())

    def status(self) -> Status:
        """Return the status of the recording."""
        rate, statistics, config = self._rate, self._statistics, self._request.rig.config
        state, warning = self._state, ""
        if state is RunState.RECORDING and not self._ring.is_closed:
            state, warning = recording_health(statistics, rate, config.timing)
            if state is RunState.INTERRUPTED and self._last_end is not None and not statistics.segment_samples:
                warning = (
                    f"{warning}: {self._last_end.detail}{reconnect_message(self._last_end, config.session.reconnect_s)}"
                )
        bytes_per_second = rate * len(self.header.acquisition.channels) * 2
        left = statistics.disk_bytes_left / bytes_per_second if statistics.disk_bytes_left >= 0 else math.inf
        return Status(
            state=state,
            elapsed=statistics.samples / rate,
            samples=statistics.samples,
            lost=statistics.lost,
            lost_is_exact=not statistics.lost_is_lower_bound,
            backlog=statistics.backlog / rate,
            disk_left=left,
            skipped=self._reader.skipped,
            model=self._model.state,
            clipped=clipped_channels(statistics, self.header.acquisition),
            last_loss=self._last_loss,
            detail=self._message or warning or self._analysis_error,
        )

    def _run(self) -> None:
        """Analyse the run and receive the recorder's end, also after an error here."""
        try:
            self._analyse_until_end()
        except Exception as error:  # any error: the recorder is stopped and completes its file
            logger.exception("the run was stopped")
            self._error = f"the run was stopped by a program error: {type(error).__name__}: {error}"
            self._request_stop()
        self._sender.send(ResultsEnded(self._reader.skipped))
        self._receive_end()
        self._message = self._message or self._error
        self._state = RunState.FAILED if self._outcome().exit_code in {3, 5} else RunState.FINISHED
        self._offer()

    def _offer(self) -> None:
        """Offer a live update without a new snapshot."""
        try:
            self._display.offer(self.status())
        except Exception as error:  # an error of a sink must not end a recording: it is reported
            if not self._analysis_error:  # once, not for each update
                logger.exception("a live display failed")
            self._analysis_error = f"a live display failed: {type(error).__name__}: {error}; the recording continues"

    def _analyse_until_end(self) -> None:
        """Analyse the items that the recorder publishes, until it ends."""
        offered_at = time.monotonic()
        while True:
            is_recording = self._is_recording()
            has_items = self._analyse()
            now = time.monotonic()
            if has_items:
                offered_at = now
            elif not is_recording:
                break
            else:
                if now - offered_at > STATUS_INTERVAL:
                    self._offer()
                    offered_at = now
                time.sleep(POLL_INTERVAL)

    def _is_recording(self) -> bool:
        """Return whether more samples may follow; kill a recorder that does not stop by the deadline."""
        if time.monotonic() > self._end_at and not self._ring.is_closed and self._process.is_alive():
            late = f"the recorder did not stop within {self._stop_deadline:g} s and was killed"
            self._message = f"{late}; its file holds all flushed samples"
            self._process.kill()
            self._process.join(KILL_DEADLINE)
        return self._process.is_alive() and not self._ring.is_closed

    def _analyse(self) -> bool:
        has_items = False
        for item in self._reader.available():
            has_items = True
            if isinstance(item, SegmentEnd):
                self._last_end, self._last_loss = item, loss_message(item) or self._last_loss
            if self._analysis is None:
                continue
            try:
                self._analysis.process(item, self.status())
            except Exception as error:  # an error of the analysis must not end a recording: it is reported
                logger.exception("live analysis stopped")
                self._analysis_error = (
                    f"live analysis stopped: {type(error).__name__}: {error}; the recording continues"
                )
                self._analysis = None
        return has_items

    def _receive_end(self) -> None:
        deadline = time.monotonic() + RESULTS_DEADLINE
        while self._pipe.poll(max(0.0, deadline - time.monotonic())):
            try:
                message = self._pipe.recv()
            except (EOFError, OSError):
                break
            if isinstance(message, AcquisitionEnded):
                self._ends = message.ends
            elif isinstance(message, FileClosed):
                self._message = message.message or self._message
                return
        self._message = self._message or "the recorder ended without closing its file; it holds all flushed samples"

    def _outcome(self) -> RunOutcome:
        return RunOutcome(self._ends, self._message, self._is_stopped_by_user, self._reader.skipped)

    def latest(self) -> LiveUpdate:
        """Return the current live update."""
        return self._display.latest(self.status())

    def summary(self) -> RunSummary:
        """Return the summary of the samples analysed live."""
        return self._display.summary()

    def stop(self) -> None:
        """Request the end, as the user does."""
        self._is_stopped_by_user = True
        self._request_stop()

    def add_marker(self, text: str) -> Marker | None:
        """Add a marker at the current sample and send it to the recorder; return None where the run has ended."""
        if not self._thread.is_alive() or self._ring.is_closed:
            return None
        segment, sample = self._statistics.position
        marker = Marker(segment, sample, " ".join(text.split())[:MAX_MARKER_LENGTH] or DEFAULT_TEXT, time.time_ns())
        self._add_marker(marker)
        return marker

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Acknowledge the alarms so far and record that in the file; return those that were new."""
        acknowledged = self._display.acknowledge()
        if acknowledged and self._thread.is_alive():
            segment, sample = self._statistics.position
            self._add_marker(acknowledgement_marker(acknowledged, segment, sample, time.time_ns()))
        return acknowledged

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether the run has ended."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def close(self) -> RunOutcome:
        """End the run, join its thread and process, and return the outcome."""
        if self._thread.is_alive():
            self._request_stop()
            self._thread.join(self._stop_deadline + 2 * RESULTS_DEADLINE)
        self._release()
        return self._outcome()

    def _release(self) -> None:
        if not self._sender.close(RESULTS_DEADLINE):  # the recorder does not read its pipe
            self._process.kill()
            self._sender.close(KILL_DEADLINE)
        self._pipe.close()  # a recorder that still runs now completes its file
        self._process.join(RESULTS_DEADLINE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(KILL_DEADLINE)


def _stopped_error() -> StoppedError:
    return StoppedError("stopped before the device was open: nothing was recorded")

"""A run that is being recorded: the recorder in its process, the analysis beside it, results sent back to be kept."""

import math
import multiprocessing
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

from analysis.live.alarms import Alarm
from analysis.live.summary import RunSummary
from analysis.signals.blocks import SegmentEnd
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import Snapshot
from daq.config.rig import Rig
from daq.drivers.reconnecting import RECONNECT_REASONS
from daq.errors import DeviceError, DeviceFault, RigError, StoppedError
from daq.session.alarms import acknowledgement_marker, alarm_marker
from daq.session.live_analysis import LiveAnalysis
from daq.session.live_update import Clipping, LiveUpdate, LiveUpdateSink, RunState, Status, TimedMarker
from daq.session.processes import start_process
from daq.session.recording.health import loss_message, recording_health
from daq.session.recording.messages import (
    AcquisitionEnded,
    DeviceOpened,
    FileClosed,
    MessageSender,
    RecordingRefused,
    RecordingRequest,
    ResultsEnded,
    StopRequest,
)
from daq.session.recording.recorder import RESULTS_DEADLINE, record
from daq.session.recording.ring import BlockRing
from daq.session.recording.statistics import RecorderStatistics
from daq.session.run import LivePredictor, RunOutcome
from recordings.mcap.markers import MAX_MARKER_LENGTH, Marker, encode_marker
from recordings.mcap.results import encode_snapshot

OPEN_DEADLINE = 120.0  # s: the simulated rig compiles its model the first time
OPENING_LOOK = 0.1  # s between two looks at whether the end was asked for meanwhile
RING_SECONDS = 8.0  # of samples that the live analysis may fall behind before it skips
POLL = 0.02  # s between two looks into the ring
STATUS_INTERVAL = 0.5  # s between frames when no snapshot comes
KILL_DEADLINE = 5.0  # s for the system to take a process away
STOP_DEADLINE = 30.0  # s that a recorder is given to end its acquisition before it is ended


class RecordedRun:
    """A run that is being recorded.

    Parameters
    ----------
    order : Order
        What is to be recorded.
    model : Model
        Whose prediction is laid over it.
    sinks : sequence of LiveUpdateSink
        Who shows it.
    is_stopping : callable
        Asked, while the device is being opened, whether the end has been asked for.
    stop_deadline : float
        Time after which a recorder that was told to stop is ended, s. Its file holds all that was flushed.

    Raises
    ------
    StoppedError
        The end was asked for before the device was open; nothing is left behind.
    RigError
        Where the device or the file cannot be opened; nothing is left behind.
    """

    def __init__(
        self,
        order: RecordingRequest,
        model: LivePredictor,
        sinks: Sequence[LiveUpdateSink] = (),
        is_stopping: Callable[[], bool] = lambda: False,
        stop_deadline: float = STOP_DEADLINE,
    ) -> None:
        self._order = order
        self._model = model
        rig: Rig = order.rig
        timing = rig.config.timing
        capacity = math.ceil(timing.rate_hz * timing.block_s) + 1
        self._statistics_memory = RecorderStatistics.allocate()
        self._statistics = RecorderStatistics(self._statistics_memory)
        self._ring = BlockRing.create(
            len(rig.config.channel), capacity, max(16, math.ceil(RING_SECONDS / timing.block_s))
        )
        self._reader = self._ring.reader()
        self._pipe, self._process = self._spawn()
        self._outbox = MessageSender(self._pipe)
        self._stop_deadline = stop_deadline
        self._end_at = math.inf  # on the monotonic clock
        self._ends: tuple[SegmentEnd, ...] = ()
        self._last_end: SegmentEnd | None = None
        self._last_loss = ""
        self._message = ""
        self._note = ""
        self._fault = ""
        self._state = RunState.STARTING
        self._is_stopped_by_user = False
        try:
            self._header = self._opened(is_stopping)
        except BaseException:
            self._release()
            raise
        self._rate = self._header.acquisition.rate
        self._analysis: LiveAnalysis | None = LiveAnalysis(self._header, model.at, sinks, self._keep, self._keep_alarm)
        self._shown = self._analysis
        self._state = RunState.RECORDING
        self._thread = threading.Thread(target=self._watch, name="live-analysis", daemon=True)
        self._thread.start()

    @property
    def header(self) -> RunHeader:
        """The run's header, with the acquisition as the device reported it."""
        return self._header

    @property
    def path(self) -> Path:
        """The file."""
        return self._order.path

    def _spawn(self) -> tuple[Connection, BaseProcess]:
        context = multiprocessing.get_context("spawn")  # the same on every platform, and safe beside threads
        here, there = context.Pipe()
        process = context.Process(
            target=record, args=(self._order, self._ring.memory, self._statistics_memory, there), name="rig-recorder"
        )
        start_process(process)
        there.close()
        return here, process

    def _opened(self, is_stopping: Callable[[], bool]) -> RunHeader:
        deadline = time.monotonic() + OPEN_DEADLINE
        while not self._pipe.poll(OPENING_LOOK):
            if is_stopping():
                self._outbox.send(StopRequest())
                raise _stopped()
            if time.monotonic() > deadline:
                raise DeviceError(DeviceFault.TIMEOUT, f"the device was not open after {OPEN_DEADLINE:g} s")
        try:
            message = self._pipe.recv()
        except EOFError:
            self._process.join(5.0)
            if is_stopping():  # the recorder was told as well
                raise _stopped() from None
            raise DeviceError(
                DeviceFault.OTHER, f"the recorder ended before it began (exit code {self._process.exitcode})"
            ) from None
        if isinstance(message, RecordingRefused):
            error = RigError(message.message)
            error.exit_code = message.exit_code
            raise error
        opened: DeviceOpened = message
        return opened.header

    def _keep(self, snapshot: Snapshot) -> None:
        """Send a snapshot to be written beside the samples."""
        for result in encode_snapshot(snapshot, self._header):
            self._outbox.send(result)

    def _keep_alarm(self, alarm: Alarm) -> None:
        """Send an alarm that has come to be written beside the samples."""
        self._add_marker(alarm_marker(alarm, self._rate, time.time_ns()))

    def _add_marker(self, marker: Marker) -> None:
        """Show a marker, and send it to be written beside the samples."""
        (segment, sample), samples = self._statistics.position, self._statistics.samples
        since = (
            marker.sample if marker.segment == segment else 0
        )  # of a segment that is over: where the present one began
        self._shown.add_marker(TimedMarker(marker, marker.sample / self._rate, (samples - sample + since) / self._rate))
        self._outbox.send(encode_marker(marker, self._header))

    def _tell_to_stop(self) -> None:
        """Stop the recorder; from now on its time is limited."""
        self._end_at = min(self._end_at, time.monotonic() + self._stop_deadline)
        self._outbox.send(StopRequest())

    def status(self) -> Status:
        """Return the state of the recording."""
        rate, statistics = self._rate, self._statistics
        state, alert = self._state, ""
        if state is RunState.RECORDING and not self._ring.is_closed:
            state, alert = recording_health(statistics, self._header.acquisition.rate, self._order.rig.config.timing)
            if state is RunState.INTERRUPTED and self._last_end is not None and not statistics.segment_samples:
                alert = f"{alert}: {self._last_end.detail}{self._patience(self._last_end)}"
        bytes_per_second = rate * len(self._header.acquisition.channels) * 2
        left = statistics.disk_bytes_left / bytes_per_second if statistics.disk_bytes_left >= 0 else math.inf
        return Status(
            state=state,
            elapsed=statistics.samples / rate,
            samples=statistics.samples,
            lost=statistics.lost,
            lost_is_exact=statistics.lost_is_exact,
            backlog=statistics.backlog / rate,
            disk_left=left,
            skipped=self._reader.skipped,
            model=self._model.state,
            clipped=self._clipped(),
            last_loss=self._last_loss,
            detail=self._message or alert or self._note,
        )

    def _clipped(self) -> tuple[Clipping, ...]:
        """Return which channels have been clipped, as the recorder counts it."""
        names = [channel.name for channel in self._header.acquisition.channels]
        counts = [(name, *self._statistics.clipped(row)) for row, name in enumerate(names)]
        return tuple(
            Clipping(name, samples, blocks, end / self._rate) for name, samples, blocks, end in counts if samples
        )

    def _patience(self, end: SegmentEnd) -> str:
        """Return that a device that went away is waited for, where it is."""
        patience = self._order.rig.config.session.reconnect_s
        is_awaited = end.reason in RECONNECT_REASONS and patience > 0
        return f"; it is waited for, {patience:g} s at most (session.reconnect_s)" if is_awaited else ""

    def _watch(self) -> None:
        """Follow the recorder to its end, whatever happens here."""
        try:
            self._follow()
        except Exception as error:  # noqa: BLE001 - whatever it is, the recorder is stopped and finishes its file
            self._fault = f"the run was stopped by a fault of the program: {type(error).__name__}: {error}"
            self._tell_to_stop()
        self._outbox.send(ResultsEnded(self._reader.skipped))
        self._farewell()
        self._message = self._message or self._fault
        self._state = RunState.FAILED if self._outcome().exit_code in {3, 5} else RunState.FINISHED
        self._offer()

    def _offer(self) -> None:
        """Show how things stand where there is no new result."""
        try:
            self._shown.offer(self.status())
        except Exception as error:  # noqa: BLE001 - a fault of a screen must not end a recording: it is told
            self._note = f"a screen failed: {type(error).__name__}: {error}; the recording goes on"

    def _follow(self) -> None:
        """Analyse what the recorder publishes until it ends."""
        offered = time.monotonic()
        while True:
            alive = self._is_recording()
            seen = self._analyse()
            now = time.monotonic()
            if seen:
                offered = now
            elif not alive:
                break
            else:
                if now - offered > STATUS_INTERVAL:
                    self._offer()
                    offered = now
                time.sleep(POLL)

    def _is_recording(self) -> bool:
        """Return whether samples may still come; a recorder that was told to stop and does not is ended."""
        if time.monotonic() > self._end_at and not self._ring.is_closed and self._process.is_alive():
            late = f"the recorder did not stop within {self._stop_deadline:g} s and was ended"
            self._message = f"{late}; its file holds all that was flushed"
            self._process.kill()
            self._process.join(KILL_DEADLINE)
        return self._process.is_alive() and not self._ring.is_closed

    def _analyse(self) -> bool:
        seen = False
        for item in self._reader.available():
            seen = True
            if isinstance(item, SegmentEnd):
                self._last_end, self._last_loss = item, loss_message(item) or self._last_loss
            if self._analysis is None:
                continue
            try:
                self._analysis.process(item, self.status())
            except Exception as error:  # noqa: BLE001 - a fault of the analysis must not end a recording: it is told
                self._note = f"live analysis stopped: {type(error).__name__}: {error}; the recording goes on"
                self._analysis = None
        return seen

    def _farewell(self) -> None:
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
        self._message = self._message or "the recorder ended without closing its file; it holds all that was flushed"

    def _outcome(self) -> RunOutcome:
        return RunOutcome(self._ends, self._message, self._is_stopped_by_user, self._reader.skipped)

    def latest(self) -> LiveUpdate:
        """Return the present frame."""
        return self._shown.frame(self.status())

    def summary(self) -> RunSummary:
        """Return the summary of what has been analysed live."""
        return self._shown.summary()

    def stop(self) -> None:
        """Ask for the end, by hand."""
        self._is_stopped_by_user = True
        self._tell_to_stop()

    def add_marker(self, text: str) -> Marker | None:
        """Name the present moment; return the marker, which is in the file soon, or None where the run has ended."""
        if not self._thread.is_alive() or self._ring.is_closed:
            return None
        segment, sample = self._statistics.position
        marker = Marker(segment, sample, " ".join(text.split())[:MAX_MARKER_LENGTH] or "mark", time.time_ns())
        self._add_marker(marker)
        return marker

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Take note of the alarms so far, which is in the file soon; return those that were new."""
        noted = self._shown.acknowledge()
        if noted and self._thread.is_alive():
            segment, sample = self._statistics.position
            self._add_marker(acknowledgement_marker(noted, segment, sample, time.time_ns()))
        return noted

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether it has come."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def close(self) -> RunOutcome:
        """End the run, join its thread and process, and say how it ended."""
        if self._thread.is_alive():
            self._tell_to_stop()
            self._thread.join(self._stop_deadline + 2 * RESULTS_DEADLINE)
        self._release()
        return self._outcome()

    def _release(self) -> None:
        if not self._outbox.close(RESULTS_DEADLINE):  # nobody listens any more
            self._process.kill()
            self._outbox.close(KILL_DEADLINE)
        self._pipe.close()  # a recorder that still runs finishes its file now
        self._process.join(RESULTS_DEADLINE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join(KILL_DEADLINE)


def _stopped() -> StoppedError:
    return StoppedError("stopped before the device was open: nothing was recorded")

"""The live analysis: items in, frames out, the same for a run that is recorded and one that is replayed."""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

from analysis.live.alarms import Alarm, visible_alarms, worst_severity
from analysis.live.analyser import Analyser
from analysis.live.summary import RunSummary, SummaryBuilder
from analysis.signals.blocks import SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from analysis.signals.snapshot import RunOut, Snapshot
from daq.session.live_update import LiveUpdate, LiveUpdateSink, Status, TimedMarker
from model.prediction.prediction_map import Prediction

MAX_LIVE_MARKERS = 20  # shown live, the last ones

Predict = Callable[[float], Prediction | None]


class LiveAnalysis:
    """Analyses what it is given and offers a frame for every snapshot.

    Parameters
    ----------
    header : RunHeader
        The run.
    predict : callable
        The model's prediction at a speed, rad/s, at once; None where there is none.
    sinks : sequence of LiveUpdateSink
        Who shows the frames.
    keep : callable or None
        Takes every snapshot, to write it beside the samples.
    keep_alarm : callable or None
        Takes every alarm when it comes, likewise.
    """

    def __init__(
        self,
        header: RunHeader,
        predict: Predict,
        sinks: Sequence[LiveUpdateSink],
        keep: Callable[[Snapshot], None] | None = None,
        keep_alarm: Callable[[Alarm], None] | None = None,
    ) -> None:
        self._header = header
        self._predict = predict
        self._sinks = tuple(sinks)
        self._keep = keep
        self._keep_alarm = keep_alarm
        self._analyser = Analyser(header.acquisition, header.settings)
        self._summary = SummaryBuilder(header)
        self._lock = threading.Lock()
        self._snapshot: Snapshot | None = None
        self._prediction: Prediction | None = None
        self._runout: RunOut | None = None
        self._alarms: tuple[Alarm, ...] = ()
        self._markers: deque[TimedMarker] = deque(maxlen=MAX_LIVE_MARKERS)
        self._acknowledged = 0  # number of the last alarm that somebody has acknowledged

    def process(self, item: SourceItem, status: Status) -> None:
        """Analyse an item; `status` is the state of the recording that goes with the frames."""
        snapshots = self._analyser.end_segment(item) if isinstance(item, SegmentEnd) else self._analyser.add_block(item)
        for snapshot in snapshots:
            self._note(snapshot)
        if isinstance(item, SegmentEnd):
            self._summary.end_segment(item)
        if snapshots:
            self.offer(status)

    def _note(self, snapshot: Snapshot) -> None:
        came = self._summary.add_snapshot(snapshot)
        if self._keep is not None:
            self._keep(snapshot)
        if self._keep_alarm is not None:
            for alarm in came:
                self._keep_alarm(alarm)
        prediction = self._predict(snapshot.speed)
        with self._lock:
            self._snapshot, self._prediction = snapshot, prediction
            self._alarms, self._runout = self._summary.alarms, self._summary.runout

    def _shown(self) -> tuple[Alarm, ...]:
        return visible_alarms(self._alarms, self._acknowledged, latch=self._header.limits.latch)

    def add_marker(self, marker: TimedMarker) -> None:
        """Show a marker with the frames from now on, with as many of those before it as are shown."""
        with self._lock:
            self._markers.append(marker)

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Take note of the alarms so far, and return those that were in sight and new; what lasts stays in sight."""
        with self._lock:
            noted = tuple(alarm for alarm in self._shown() if alarm.number > self._acknowledged)
            self._acknowledged = max((alarm.number for alarm in noted), default=self._acknowledged)
        return noted

    def frame(self, status: Status) -> LiveUpdate:
        """Return the latest frame with this status."""
        with self._lock:
            shown, acknowledged = self._shown(), self._acknowledged
            lasting = [alarm for alarm in shown if alarm.is_active]
            status = replace(
                status,
                severity=worst_severity(lasting),
                latched=worst_severity(shown),
                alarms=shown,
                acknowledged=acknowledged,
                markers=tuple(self._markers),
            )
            return LiveUpdate(self._header, status, self._snapshot, self._prediction, self._runout)

    def offer(self, status: Status) -> None:
        """Offer the latest frame to everybody who shows one."""
        frame = self.frame(status)
        for sink in self._sinks:
            sink.offer(frame)

    def summary(self) -> RunSummary:
        """Return the summary of what has been analysed."""
        return self._summary.summary()

"""Live analysis of recorded and replayed runs: blocks and segment ends in, live updates out."""

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

MAX_LIVE_MARKERS = 20  # the latest ones are shown

Predict = Callable[[float], Prediction | None]


class LiveAnalysis:
    """Analyses a run's blocks and offers a live update for every snapshot.

    Parameters
    ----------
    header : RunHeader
        The run.
    predict : callable
        Returns the model's prediction at a speed, rad/s, without waiting; None where there is none.
    sinks : sequence of LiveUpdateSink
        Consumers of the live updates.
    on_snapshot : callable or None
        Receives every snapshot, to store it with the samples.
    on_alarm : callable or None
        Receives every new alarm, to store it with the samples.
    """

    def __init__(
        self,
        header: RunHeader,
        predict: Predict,
        sinks: Sequence[LiveUpdateSink],
        on_snapshot: Callable[[Snapshot], None] | None = None,
        on_alarm: Callable[[Alarm], None] | None = None,
    ) -> None:
        self._header = header
        self._predict = predict
        self._sinks = tuple(sinks)
        self._on_snapshot = on_snapshot
        self._on_alarm = on_alarm
        self._analyser = Analyser(header.acquisition, header.settings)
        self._summary = SummaryBuilder(header)
        self._lock = threading.Lock()
        self._snapshot: Snapshot | None = None
        self._prediction: Prediction | None = None
        self._runout: RunOut | None = None
        self._alarms: tuple[Alarm, ...] = ()
        self._markers: deque[TimedMarker] = deque(maxlen=MAX_LIVE_MARKERS)
        self._acknowledged = 0  # number of the last acknowledged alarm

    def process(self, item: SourceItem, status: Status) -> None:
        """Analyse a block or segment end; the live updates carry `status`."""
        snapshots = self._analyser.end_segment(item) if isinstance(item, SegmentEnd) else self._analyser.add_block(item)
        for snapshot in snapshots:
            self._add_snapshot(snapshot)
        if isinstance(item, SegmentEnd):
            self._summary.end_segment(item)
        if snapshots:
            self.offer(status)

    def _add_snapshot(self, snapshot: Snapshot) -> None:
        new_alarms = self._summary.add_snapshot(snapshot)
        if self._on_snapshot is not None:
            self._on_snapshot(snapshot)
        if self._on_alarm is not None:
            for alarm in new_alarms:
                self._on_alarm(alarm)
        prediction = self._predict(snapshot.speed)
        with self._lock:
            self._snapshot, self._prediction = snapshot, prediction
            self._alarms, self._runout = self._summary.alarms, self._summary.runout

    def _shown_alarms(self) -> tuple[Alarm, ...]:
        return visible_alarms(self._alarms, self._acknowledged, latch=self._header.limits.latch)

    def add_marker(self, marker: TimedMarker) -> None:
        """Show a marker in the live updates from now on, with up to ``MAX_LIVE_MARKERS - 1`` earlier ones."""
        with self._lock:
            self._markers.append(marker)

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Acknowledge the alarms so far; return those shown and new. Alarms whose condition persists stay shown."""
        with self._lock:
            acknowledged = tuple(alarm for alarm in self._shown_alarms() if alarm.number > self._acknowledged)
            self._acknowledged = max((alarm.number for alarm in acknowledged), default=self._acknowledged)
        return acknowledged

    def latest(self, status: Status) -> LiveUpdate:
        """Return the live update of the latest snapshot with this status."""
        with self._lock:
            shown, acknowledged = self._shown_alarms(), self._acknowledged
            persistent = [alarm for alarm in shown if alarm.is_active]
            status = replace(
                status,
                severity=worst_severity(persistent),
                latched=worst_severity(shown),
                alarms=shown,
                acknowledged=acknowledged,
                markers=tuple(self._markers),
            )
            return LiveUpdate(self._header, status, self._snapshot, self._prediction, self._runout)

    def offer(self, status: Status) -> None:
        """Offer the latest live update to all sinks."""
        update = self.latest(status)
        for sink in self._sinks:
            sink.offer(update)

    def summary(self) -> RunSummary:
        """Return the summary of the blocks analysed so far."""
        return self._summary.summary()

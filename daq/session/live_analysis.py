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
from analysis.signals.snapshot import Snapshot
from daq.session.live_update import LiveUpdate, LiveUpdateSink, RunState, Status, TimedMarker
from daq.session.predictor import Predictor

MAX_LIVE_MARKERS = 20  # the latest ones are shown


class LiveAnalysis:
    """Analyses a run's blocks and offers a live update for every snapshot.

    Parameters
    ----------
    header : RunHeader
        The run.
    model : Predictor
        The model whose prediction is shown with every snapshot.
    sinks : sequence of LiveUpdateSink
        Consumers of the live updates.
    on_snapshot, on_alarm : callable
        Receive every snapshot and every new alarm, to store them with the samples.
    """

    def __init__(
        self,
        header: RunHeader,
        model: Predictor,
        sinks: Sequence[LiveUpdateSink],
        on_snapshot: Callable[[Snapshot], None] = lambda _: None,
        on_alarm: Callable[[Alarm], None] = lambda _: None,
    ) -> None:
        self._model = model
        self._sinks = tuple(sinks)
        self._on_snapshot = on_snapshot
        self._on_alarm = on_alarm
        self._analyser = Analyser(header.acquisition, header.settings)
        self._summary = SummaryBuilder(header)
        self._lock = threading.Lock()
        self._update = LiveUpdate(header, Status(RunState.STARTING))  # of the last snapshot
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
        self._on_snapshot(snapshot)
        for alarm in new_alarms:
            self._on_alarm(alarm)
        prediction = self._model.at(snapshot.speed)
        with self._lock:
            self._update = replace(self._update, snapshot=snapshot, prediction=prediction, runout=self._summary.runout)
            self._alarms = self._summary.alarms

    def _shown_alarms(self) -> tuple[Alarm, ...]:
        return visible_alarms(self._alarms, self._acknowledged, latch=self._update.header.limits.latch)

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
            return replace(self._update, status=status)

    def offer(self, status: Status) -> None:
        """Offer the latest live update to all sinks."""
        update = self.latest(status)
        for sink in self._sinks:
            sink.offer(update)

    def summary(self) -> RunSummary:
        """Return the summary of the blocks analysed so far."""
        return self._summary.summary()

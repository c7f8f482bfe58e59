"""A replayed run: a recording that passes through the live analysis again."""

import threading
from collections.abc import Sequence

from analysis.live.alarms import Alarm
from analysis.live.summary import RunSummary
from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from daq.drivers.source import Source
from daq.session.live_analysis import LiveAnalysis
from daq.session.live_update import LiveUpdate, LiveUpdateSink, RunState, Status, TimedMarker
from daq.session.predictor import Predictor
from daq.session.run import RunOutcome
from recordings.mcap.results import Marker


class ReplayedRun:
    """A recording being replayed through the live analysis.

    Parameters
    ----------
    header : RunHeader
        The recorded run.
    source : Source
        Its replay; `close` closes it.
    model : Predictor
        The model whose prediction is shown with it.
    sinks : sequence of LiveUpdateSink
        Consumers of the live updates.
    markers : sequence of Marker
        Its markers; each is shown when the replay reaches it.
    """

    def __init__(
        self,
        header: RunHeader,
        source: Source,
        model: Predictor,
        sinks: Sequence[LiveUpdateSink] = (),
        markers: Sequence[Marker] = (),
    ) -> None:
        self.header = header
        self._source = source
        self._model = model
        self._analysis = LiveAnalysis(header, model, sinks)
        self._ends: list[SegmentEnd] = []
        self._samples = 0
        self._markers = sorted(
            markers, key=lambda marker: (marker.segment, marker.sample), reverse=True
        )  # the next one last
        self._state = RunState.REPLAYING
        self._is_stopped_by_user = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._replay, name="replay", daemon=True)
        self._thread.start()

    def status(self) -> Status:
        """Return the progress of the replay."""
        return Status(
            state=self._state,
            elapsed=self._samples / self.header.acquisition.rate,
            samples=self._samples,
            lost=sum(end.lost for end in self._ends),
            lost_is_exact=all(end.lost_is_exact for end in self._ends),
            model=self._model.state,
        )

    def _replay(self) -> None:
        try:
            for item in self._source.blocks():
                if isinstance(item, SampleBlock):
                    self._samples += item.n_samples
                else:
                    self._ends.append(item)
                self._show_markers(item)
                self._analysis.process(item, self.status())
            self._state = RunState.FINISHED
        except Exception as error:  # noqa: BLE001 - `close` raises it
            self._error = error
            self._state = RunState.FAILED
        self._analysis.offer(self.status())

    def _show_markers(self, item: SourceItem) -> None:
        """Show the markers up to the end of a block or segment."""
        end = item.end if isinstance(item, SampleBlock) else item.samples
        rate = self.header.acquisition.rate
        while self._markers and (self._markers[-1].segment, self._markers[-1].sample) <= (item.segment, end):
            marker = self._markers.pop()
            self._analysis.add_marker(
                TimedMarker(marker, marker.sample / rate, (self._samples - end + marker.sample) / rate)
            )

    def latest(self) -> LiveUpdate:
        """Return the current live update."""
        return self._analysis.latest(self.status())

    def summary(self) -> RunSummary:
        """Return the summary of the samples replayed so far."""
        return self._analysis.summary()

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Acknowledge the alarms so far, in this replay only; return those that were new."""
        return self._analysis.acknowledge()

    def stop(self) -> None:
        """Request the end, as the user does."""
        self._is_stopped_by_user = True
        self._source.stop()

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether the run has ended."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def close(self) -> RunOutcome:
        """End the replay, join its thread and return the outcome; an exception of the replay is raised here."""
        self._source.stop()
        self._thread.join(10.0)
        self._source.close()
        if self._error is not None:
            raise self._error
        return RunOutcome(tuple(self._ends), is_stopped_by_user=self._is_stopped_by_user)

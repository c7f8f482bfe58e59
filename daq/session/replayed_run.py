"""A run that is replayed: the recording through the very same analysis, at whatever pace."""

import threading
from collections.abc import Sequence

from analysis.live.alarms import Alarm
from analysis.live.summary import RunSummary
from analysis.signals.blocks import SampleBlock, SegmentEnd, SourceItem
from analysis.signals.header import RunHeader
from daq.drivers.source import Source
from daq.session.live_analysis import LiveAnalysis
from daq.session.live_update import LiveUpdate, LiveUpdateSink, RunState, Status, TimedMarker
from daq.session.run import LivePredictor, RunOutcome
from recordings.mcap.markers import Marker


class ReplayedRun:
    """A recording on its way through the live analysis.

    Parameters
    ----------
    header : RunHeader
        The recorded run.
    source : Source
        Its replay; closed with the run.
    model : Model
        Whose prediction is laid over it.
    sinks : sequence of LiveUpdateSink
        Who shows it.
    markers : sequence of Marker
        What was marked in it; each is shown when the replay comes to it.
    """

    def __init__(
        self,
        header: RunHeader,
        source: Source,
        model: LivePredictor,
        sinks: Sequence[LiveUpdateSink] = (),
        markers: Sequence[Marker] = (),
    ) -> None:
        self._header = header
        self._source = source
        self._model = model
        self._analysis = LiveAnalysis(header, model.at, sinks)
        self._ends: list[SegmentEnd] = []
        self._samples = 0
        self._markers = sorted(
            markers, key=lambda marker: (marker.segment, marker.sample), reverse=True
        )  # the next one last
        self._state = RunState.REPLAYING
        self._is_stopped_by_user = False
        self._fault: BaseException | None = None
        self._thread = threading.Thread(target=self._pump, name="replay", daemon=True)
        self._thread.start()

    @property
    def header(self) -> RunHeader:
        """The recorded run's header."""
        return self._header

    def status(self) -> Status:
        """Return how far the replay is."""
        return Status(
            state=self._state,
            elapsed=self._samples / self._header.acquisition.rate,
            samples=self._samples,
            lost=sum(end.lost for end in self._ends),
            lost_is_exact=all(end.lost_is_exact for end in self._ends),
            model=self._model.state,
        )

    def _pump(self) -> None:
        try:
            for item in self._source.blocks():
                if isinstance(item, SampleBlock):
                    self._samples += item.n_samples
                else:
                    self._ends.append(item)
                self._show_markers(item)
                self._analysis.process(item, self.status())
            self._state = RunState.FINISHED
        except Exception as error:  # noqa: BLE001 - carried to whoever closes the run
            self._fault = error
            self._state = RunState.FAILED
        self._analysis.offer(self.status())

    def _show_markers(self, item: SourceItem) -> None:
        """Show the markers up to the end of an item."""
        end = item.end if isinstance(item, SampleBlock) else item.samples
        rate = self._header.acquisition.rate
        while self._markers and (self._markers[-1].segment, self._markers[-1].sample) <= (item.segment, end):
            marker = self._markers.pop()
            self._analysis.add_marker(
                TimedMarker(marker, marker.sample / rate, (self._samples - end + marker.sample) / rate)
            )

    def latest(self) -> LiveUpdate:
        """Return the present frame."""
        return self._analysis.frame(self.status())

    def summary(self) -> RunSummary:
        """Return the summary of what has been replayed."""
        return self._analysis.summary()

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Take note of the alarms so far, for this replay alone; return those that were new."""
        return self._analysis.acknowledge()

    def stop(self) -> None:
        """Ask for the end, by hand."""
        self._is_stopped_by_user = True
        self._source.stop()

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether it has come."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def close(self) -> RunOutcome:
        """End the replay, join its thread, and say how it ended; what went wrong in it is raised here."""
        self._source.stop()
        self._thread.join(10.0)
        self._source.close()
        if self._fault is not None:
            raise self._fault
        return RunOutcome(tuple(self._ends), is_stopped_by_user=self._is_stopped_by_user)

"""Interfaces of a run in progress, recorded or replayed, and its outcome."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from analysis.live.alarms import Alarm
from analysis.signals.blocks import EndReason, SegmentEnd
from analysis.signals.header import RunHeader
from daq.session.live_update import LiveUpdate
from model.prediction.prediction_map import Prediction
from recordings.mcap.markers import Marker


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """How a run ended.

    Parameters
    ----------
    ends : tuple of SegmentEnd
        Ends of its segments.
    message : str
        Error message for the operator; empty for none.
    is_stopped_by_user : bool
        Whether the user stopped it.
    skipped : int
        Samples per channel that the live analysis skipped.
    """

    ends: tuple[SegmentEnd, ...]
    message: str = ""
    is_stopped_by_user: bool = False
    skipped: int = 0

    @property
    def exit_code(self) -> int:
        """0 success, 3 device failed, 5 data lost (file usable), 130 stopped by the user (file complete)."""
        reasons = {end.reason for end in self.ends}
        if not self.ends or self.message or any(not end.is_gap_free for end in self.ends):
            return 5
        if reasons & {EndReason.UNPLUGGED, EndReason.DEVICE_ERROR}:
            return 3
        return 130 if self.is_stopped_by_user else 0


class LivePredictor(Protocol):
    """The model as a run uses it: predictions without waiting."""

    @property
    def state(self) -> str:
        """State for display: "ready", "ready, not exact: <reason>", "computing 34 %" or the reason for none."""
        ...

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, without waiting; None where there is none."""
        ...


class Run(Protocol):
    """A run in progress, recorded or replayed, as the view and the service see it."""

    @property
    def header(self) -> RunHeader:
        """The run's header."""
        ...

    def latest(self) -> LiveUpdate:
        """Return the current live update."""
        ...

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Acknowledge the alarms so far; return those that were new."""
        ...

    def stop(self) -> None:
        """Request the end, as the user does."""
        ...

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether the run has ended."""
        ...

    def close(self) -> RunOutcome:
        """End the run, join its threads and processes, and return the outcome."""
        ...


@runtime_checkable
class SupportsMarkers(Protocol):
    """A recorded run: markers and acknowledgements go into its file."""

    def add_marker(self, text: str) -> Marker | None:
        """Add a marker at the current sample; return None where the run has ended."""
        ...

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Acknowledge the alarms so far; return those that were new."""
        ...

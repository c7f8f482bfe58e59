"""What every run offers while it goes, and what it comes to in the end."""

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
        Its segments.
    message : str
        What went wrong, for the operator; empty where all is well.
    is_stopped_by_user : bool
        Whether somebody stopped it.
    skipped : int
        Samples per channel that the live analysis had to skip.
    """

    ends: tuple[SegmentEnd, ...]
    message: str = ""
    is_stopped_by_user: bool = False
    skipped: int = 0

    @property
    def exit_code(self) -> int:
        """0 good, 3 the device failed, 5 data lost (file kept), 130 stopped by hand (file complete)."""
        reasons = {end.reason for end in self.ends}
        if not self.ends or self.message or any(not end.is_gap_free for end in self.ends):
            return 5
        if reasons & {EndReason.UNPLUGGED, EndReason.DEVICE_ERROR}:
            return 3
        return 130 if self.is_stopped_by_user else 0


class LivePredictor(Protocol):
    """What a run asks of the model."""

    @property
    def state(self) -> str:
        """Whether it is "ready", "ready, not exact: " and why, "computing 34 %", or why there is none."""
        ...

    def at(self, speed: float) -> Prediction | None:
        """Return the prediction at a speed, rad/s, at once; None where there is none."""
        ...


class Run(Protocol):
    """A run in progress; for the view and the service a recorded and a replayed one are the same."""

    @property
    def header(self) -> RunHeader:
        """The run's header."""
        ...

    def latest(self) -> LiveUpdate:
        """Return the present frame."""
        ...

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Take note of the alarms so far; return those that were new."""
        ...

    def stop(self) -> None:
        """Ask for the end, by hand."""
        ...

    def wait(self, timeout: float) -> bool:
        """Wait up to `timeout` s for the end; return whether it has come."""
        ...

    def close(self) -> RunOutcome:
        """End it, join all that it started, and say how it ended."""
        ...


@runtime_checkable
class SupportsMarkers(Protocol):
    """A run in which moments can be named and alarms be acknowledged for good: one that is recorded."""

    def add_marker(self, text: str) -> Marker | None:
        """Name the present moment; return None where the run has ended."""
        ...

    def acknowledge(self) -> tuple[Alarm, ...]:
        """Take note of the alarms so far; return those that were new."""
        ...

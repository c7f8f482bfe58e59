"""What the live side shows of a run at one moment: the shaft, the model beside it, and the state of the recording."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from analysis.live.alarms import Alarm
from analysis.signals.header import RunHeader, Severity
from analysis.signals.snapshot import RunOut, Snapshot
from model.prediction.prediction_map import Prediction
from recordings.mcap.markers import Marker


class RunState(StrEnum):
    """Where a run stands."""

    STARTING = "starting"
    ARMED = "armed"  # samples come, and are recorded from a condition on
    RECORDING = "recording"
    DEGRADED = "degraded"  # recording, but samples are about to be lost
    INTERRUPTED = "interrupted"  # recording, but no samples come
    REPLAYING = "replaying"
    FINISHED = "finished"
    FAILED = "failed"

    @property
    def is_under_way(self) -> bool:
        """Whether the run has not ended."""
        return self not in {RunState.FINISHED, RunState.FAILED}


@dataclass(frozen=True, slots=True)
class TimedMarker:
    """A marker, and when in the run it lies.

    Parameters
    ----------
    marker : Marker
        The marker.
    time : float
        Sample time in its segment, s.
    elapsed : float
        Sample time since the run began, s.
    """

    marker: Marker
    time: float
    elapsed: float


@dataclass(frozen=True, slots=True)
class Clipping:
    """What a channel lost at the ends of the converter's range since the run began.

    Parameters
    ----------
    channel : str
        Its name.
    samples : int
        Samples there.
    blocks : int
        Blocks with any.
    last : float
        Sample time, since the run began, of the end of the last such block, s.
    """

    channel: str
    samples: int
    blocks: int
    last: float


@dataclass(frozen=True, slots=True)
class Status:
    """The state of the recording, for somebody two metres away.

    Parameters
    ----------
    state : RunState
        Where the run stands.
    elapsed : float
        Sample time since the run began, s.
    samples : int
        Samples per channel recorded (or replayed).
    lost : int
        Samples per channel known to be lost.
    lost_is_exact : bool
        False where ``lost`` is a lower bound.
    backlog : float
        What the device held at the last read, s.
    disk_left : float
        How long the disk lasts at this rate before the reserve is reached, s; infinite where nothing is written.
    skipped : int
        Samples per channel that the live analysis had to skip (they are recorded).
    dropped_frames : int
        Pictures that the view could not draw in time.
    severity : Severity
        The worst of the alarms that last.
    latched : Severity
        The worst of the alarms in sight.
    markers : tuple of TimedMarker
        The last moments that were marked, in their order.
    model : str
        "ready", "ready, not exact: " and why, "computing 34 %", or why there is no prediction.
    clipped : tuple of Clipping
        Of the channels that have been clipped, whether the live analysis has seen it or had to skip.
    last_loss : str
        What became of the last segment with which something went wrong; empty where there was none.
    detail : str
        What went wrong, for the operator; empty where all is well.
    alarms : tuple of Alarm
        Those in sight: they last, or are latched until somebody acknowledges them.
    acknowledged : int
        Number of the last alarm that somebody has acknowledged; 0 for none.
    """

    state: RunState
    elapsed: float = 0.0
    samples: int = 0
    lost: int = 0
    lost_is_exact: bool = True
    backlog: float = 0.0
    disk_left: float = float("inf")
    skipped: int = 0
    dropped_frames: int = 0
    severity: Severity = Severity.NORMAL
    latched: Severity = Severity.NORMAL
    model: str = "off"
    clipped: tuple[Clipping, ...] = ()
    last_loss: str = ""
    detail: str = ""
    alarms: tuple[Alarm, ...] = ()
    acknowledged: int = 0
    markers: tuple[TimedMarker, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class LiveUpdate:
    """One moment of a run.

    Parameters
    ----------
    header : RunHeader
        The run.
    status : Status
        Its state.
    snapshot : Snapshot or None
        The shaft; None before the first.
    prediction : Prediction or None
        The model at the measured speed; None where the speed or the model is not known.
    runout : RunOut or None
        What is taken off as run-out; None where it is not asked for or not known yet.
    """

    header: RunHeader
    status: Status
    snapshot: Snapshot | None = None
    prediction: Prediction | None = None
    runout: RunOut | None = None


class LiveUpdateSink(Protocol):
    """Whoever shows frames. It takes them at once and may forget all but the latest; it never blocks."""

    def offer(self, frame: LiveUpdate) -> None:
        """Show this frame when there is time."""
        ...

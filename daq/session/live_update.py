"""The live update: a run's latest snapshot, prediction and recording status, and its alarms as text and markers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Protocol

from analysis.live.alarms import Alarm, MonitoredQuantity
from analysis.signals.header import RunHeader, Severity
from analysis.signals.snapshot import OrderFrame, RunOut, Snapshot
from analysis.signals.units import MICROMETRE, NUMBER, RPM, TIME
from model.prediction.prediction_map import Prediction
from recordings.mcap.results import MAX_MARKER_LENGTH, Marker, MarkerKind


class RunState(StrEnum):
    """State of a run."""

    STARTING = "starting"
    ARMED = "armed"  # samples arrive; recording starts with the trigger condition
    RECORDING = "recording"
    DEGRADED = "degraded"  # recording, but samples are about to be lost
    INTERRUPTED = "interrupted"  # recording, but no samples arrive
    REPLAYING = "replaying"
    FINISHED = "finished"
    FAILED = "failed"

    @property
    def is_active(self) -> bool:
        """Whether the run has not ended."""
        return self not in {RunState.FINISHED, RunState.FAILED}


@dataclass(frozen=True, slots=True)
class TimedMarker:
    """A marker with its time in the run.

    Parameters
    ----------
    marker : Marker
        The marker.
    time : float
        Sample time in its segment, s.
    elapsed : float
        Sample time since the start of the run, s.
    """

    marker: Marker
    time: float
    elapsed: float


@dataclass(frozen=True, slots=True)
class Clipping:
    """Clipped samples of a channel since the start of the run."""

    channel: Annotated[str, NUMBER.of("Name of the channel")]
    samples: Annotated[int, NUMBER.of("Samples at either end of the converter's range")]
    blocks: Annotated[int, NUMBER.of("Blocks with clipped samples")]
    last: Annotated[float, TIME.of("End of the last such block, sample time since the start of the run")]


@dataclass(frozen=True, slots=True)
class Status:
    """Status of a recording or replay."""

    state: Annotated[RunState, NUMBER.of("State of the run")]
    elapsed: Annotated[float, TIME.of("Sample time since the start of the run")] = 0.0
    samples: Annotated[int, NUMBER.of("Samples per channel recorded or replayed")] = 0
    lost: Annotated[int, NUMBER.of("Lost samples per channel", "lost_samples")] = 0
    lost_is_exact: Annotated[bool, NUMBER.of("False where the number of lost samples is a lower bound")] = True
    backlog: Annotated[float, TIME.of("Unread samples in the device at the last read")] = 0.0
    disk_left: Annotated[
        float, TIME.of("Time until the disk is full at this rate; unknown where nothing is written")
    ] = float("inf")
    skipped: Annotated[
        int, NUMBER.of("Samples per channel that the live analysis skipped; they are recorded", "skipped_samples")
    ] = 0
    dropped_updates: Annotated[int, NUMBER.of("Live updates that the viewer could not draw in time")] = 0
    severity: Annotated[Severity, NUMBER.of("Highest severity of the present alarms")] = Severity.NORMAL
    latched: Annotated[Severity, NUMBER.of("Highest severity of the displayed alarms", "latched_severity")] = (
        Severity.NORMAL
    )
    model: Annotated[
        str, NUMBER.of('State: "ready", "ready, not exact: <reason>", "computing 34 %", or why there is none')
    ] = "off"
    clipped: Annotated[
        tuple[Clipping, ...], NUMBER.of("Clipped channels, counted while recording; empty in a replay")
    ] = ()
    last_loss: Annotated[str, NUMBER.of("End of the last segment that ended with a fault; empty without any")] = ""
    detail: Annotated[str, NUMBER.of("Error message; empty without an error")] = ""
    alarms: Annotated[
        tuple[Alarm, ...], NUMBER.of("Displayed alarms: present, or latched and not yet acknowledged")
    ] = ()
    acknowledged: Annotated[
        int, NUMBER.of("Number of the last acknowledged alarm; 0 for none", "acknowledged_alarm")
    ] = 0
    markers: Annotated[tuple[TimedMarker, ...], NUMBER.of("The latest markers in order of time")] = ()


@dataclass(frozen=True, slots=True, eq=False)
class LiveUpdate:
    """Snapshot, prediction and status of a run at one time.

    Parameters
    ----------
    header : RunHeader
        The run.
    status : Status
        Status of the recording or replay.
    snapshot : Snapshot or None
        Result of the live analysis; None before the first.
    prediction : Prediction or None
        The model at the measured speed; None where the speed or the model is unknown.
    runout : RunOut or None
        The subtracted run-out; None where no compensation is configured or the run-out is not known yet.
    """

    header: RunHeader
    status: Status
    snapshot: Snapshot | None = None
    prediction: Prediction | None = None
    runout: RunOut | None = None

    @property
    def order_frame(self) -> OrderFrame | None:
        """The latest order frame; None before the first."""
        return None if self.snapshot is None else self.snapshot.frame


class LiveUpdateSink(Protocol):
    """Consumer of live updates: it returns at once, may drop all but the latest, and never blocks."""

    def offer(self, update: LiveUpdate) -> None:
        """Accept an update for display."""
        ...


def alarm_name(alarm: Alarm) -> str:
    """Return severity, quantity and probe: "danger at x", "1X alarm at x", "speed danger"."""
    which = "" if alarm.quantity is MonitoredQuantity.OVERALL else f"{alarm.quantity.value} "
    return f"{which}{alarm.severity.value}" + (f" at {alarm.probe}" if alarm.probe else "")


def alarm_value_text(alarm: Alarm) -> str:
    """Return the largest value so far and the limit: "96 µm peak-to-peak, limit 90"."""
    if alarm.quantity is MonitoredQuantity.SPEED:
        return f"{alarm.largest / RPM:,.0f} r/min, limit {alarm.limit / RPM:,.0f}"
    value, unit = alarm.largest / MICROMETRE, "peak-to-peak" if alarm.quantity is MonitoredQuantity.OVERALL else "peak"
    return f"{value:.{0 if value >= 20.0 else 1}f} µm {unit}, limit {alarm.limit / MICROMETRE:g}"


def alarm_text(alarm: Alarm) -> str:
    """Return name, value, limit and speed: "danger at x: 96 µm peak-to-peak, limit 90, at 12,000 r/min"."""
    has_speed = math.isfinite(alarm.begin.speed) and alarm.quantity is not MonitoredQuantity.SPEED
    at = f", at {alarm.begin.speed / RPM:,.0f} r/min" if has_speed else ""
    return f"{alarm_name(alarm)}: {alarm_value_text(alarm)}{at}"


def alarm_marker(alarm: Alarm, rate: float, host_time_ns: int) -> Marker:
    """Return the marker of a new alarm.

    Parameters
    ----------
    alarm : Alarm
        The alarm.
    rate : float
        Sample rate, Hz.
    host_time_ns : int
        Host clock, ns since 1970.
    """
    sample = round(alarm.begin.time * rate)
    return Marker(alarm.begin.segment, sample, alarm_text(alarm)[:MAX_MARKER_LENGTH], host_time_ns, MarkerKind.ALARM)


def acknowledgement_marker(alarms: Sequence[Alarm], segment: int, sample: int, host_time_ns: int) -> Marker:
    """Return the marker of the acknowledgement of alarms at a sample of a segment; host clock in ns since 1970."""
    named = ", ".join(alarm_name(alarm) for alarm in alarms)
    return Marker(segment, sample, f"acknowledged {named}"[:MAX_MARKER_LENGTH], host_time_ns, MarkerKind.ACKNOWLEDGED)

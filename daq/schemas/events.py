"""Limits that were passed, and who took note.

A place in a run.
Moments that were marked while a run was recorded.
"""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from analysis.live.alarms import Alarm, MonitoredQuantity
from analysis.signals.blocks import TimeInRun
from analysis.signals.header import Severity
from daq.schemas.units import Schema, finite, micrometres, rpm, utc_time
from daq.session.alarms import alarm_name, alarm_value_text
from daq.session.live_update import TimedMarker
from recordings.mcap.markers import MAX_MARKER_LENGTH, Marker, MarkerKind


class TimeInRunSchema(Schema):
    """A place in a run."""

    segment: int = Field(description="Gap-free stretch of the run, from 0", examples=[0], ge=0)
    time_s: float = Field(description="Sample time in that segment, s", examples=[98.4])
    speed_rpm: float | None = Field(description="Shaft speed there, r/min; null where unknown", examples=[10_980.0])


def time_in_run_schema(place: TimeInRun) -> TimeInRunSchema:
    """Return a place in a run as a document."""
    return TimeInRunSchema(segment=place.segment, time_s=finite(place.time) or 0.0, speed_rpm=rpm(place.speed))


class MarkerSchema(Schema):
    """A moment and its name."""

    kind: MarkerKind = Field(
        description="A word of somebody, an alarm that came, or the acknowledgement of alarms", examples=["word"]
    )
    text: str = Field(description="Its name", examples=["knocking begins"])
    segment: int = Field(description="The segment in which it lies", examples=[0], ge=0)
    time_s: float | None = Field(
        description="Sample time in the segment, s, right within a block and the card's backlog", examples=[12.3]
    )
    marked_at: datetime = Field(description="Wall clock of the host, UTC", examples=["2026-11-24T09:12:19.550000Z"])


class LiveMarkerSchema(MarkerSchema):
    """A moment of the run under way."""

    elapsed_s: float | None = Field(description="Sample time since the run began, s", examples=[12.3])


class MarkerRequest(BaseModel):
    """What the present moment is to be called."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    text: Annotated[str, Field(description="Its name", examples=["knocking begins"], max_length=MAX_MARKER_LENGTH)] = (
        "mark"
    )


def marker_schema(marker: Marker, rate: float) -> MarkerSchema:
    """Return a marker as a document, for the run's sample rate, Hz."""
    return MarkerSchema(
        kind=marker.kind,
        text=marker.text,
        segment=marker.segment,
        time_s=finite(marker.sample / rate),
        marked_at=utc_time(marker.host_time_ns),
    )


def live_marker_schema(placed: TimedMarker) -> LiveMarkerSchema:
    """Return a marker of the run under way as a document."""
    return LiveMarkerSchema(
        kind=placed.marker.kind,
        text=placed.marker.text,
        segment=placed.marker.segment,
        time_s=finite(placed.time),
        marked_at=utc_time(placed.marker.host_time_ns),
        elapsed_s=finite(placed.elapsed),
    )


class AlarmSchema(Schema):
    """A limit that was passed: by vibration for as long as the rig's `limits.hold_s` asks, by the speed at all."""

    number: int = Field(description="In the order in which they came, from 1", examples=[2], ge=1)
    quantity: MonitoredQuantity = Field(
        description="What passed it: the overall vibration, 1X, the components below 1X together, or the speed; of the "
        "limits and the largest values, those in its unit are given, the others null",
        examples=["overall"],
    )
    probe: str | None = Field(description="The operator's name for the probe; null for the speed", examples=["x"])
    severity: Severity = Field(description="Which limit", examples=["danger"])
    limit_peak_to_peak_um: float | None = Field(
        description="Limit of the overall vibration, µm peak-to-peak", examples=[95.0]
    )
    limit_peak_um: float | None = Field(description="Limit of 1X or of what is below it, µm peak", examples=[None])
    limit_rpm: float | None = Field(description="Limit of the speed, r/min", examples=[None])
    begin: TimeInRunSchema = Field(description="When the alarm came")
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration since the limit was passed, µm peak-to-peak", examples=[97.2]
    )
    largest_peak_um: float | None = Field(
        description="Largest 1X, or sum of the amplitudes below it, since then, µm peak", examples=[None]
    )
    largest_rpm: float | None = Field(description="Highest speed since then, r/min", examples=[None])
    largest_at: TimeInRunSchema = Field(description="Where that was")
    end: TimeInRunSchema | None = Field(
        description="When the value had fallen below the limit by the rig's hysteresis; null while it lasts, or "
        "where it lasted to the run's end"
    )
    name: str = Field(description="Which it is, for people", examples=["danger at x"])
    message: str = Field(
        description="The largest value and the limit, for people", examples=["97 µm peak-to-peak, limit 95"]
    )


class AcknowledgeRequest(Schema):
    """An order to take note of the alarms in sight; it has no fields."""


class AcknowledgedAlarmsSchema(Schema):
    """Alarms that somebody has taken note of."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    alarms: tuple[AlarmSchema, ...] = Field(description="Those that were new; those that last stay in sight")


def alarm_schema(alarm: Alarm) -> AlarmSchema:
    """Return an alarm as a document."""
    is_overall, is_speed = alarm.quantity is MonitoredQuantity.OVERALL, alarm.quantity is MonitoredQuantity.SPEED
    is_peak = not is_overall and not is_speed
    return AlarmSchema(
        number=alarm.number,
        quantity=alarm.quantity,
        probe=alarm.probe or None,
        severity=alarm.severity,
        limit_peak_to_peak_um=micrometres(alarm.limit) if is_overall else None,
        limit_peak_um=micrometres(alarm.limit) if is_peak else None,
        limit_rpm=rpm(alarm.limit) if is_speed else None,
        begin=time_in_run_schema(alarm.begin),
        largest_peak_to_peak_um=micrometres(alarm.largest) if is_overall else None,
        largest_peak_um=micrometres(alarm.largest) if is_peak else None,
        largest_rpm=rpm(alarm.largest) if is_speed else None,
        largest_at=time_in_run_schema(alarm.largest_at),
        end=None if alarm.end is None else time_in_run_schema(alarm.end),
        name=alarm_name(alarm),
        message=alarm_value_text(alarm),
    )

"""Schemas of events in a run: times in the run, markers, alarms and their acknowledgement."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from analysis.live.alarms import Alarm, MonitoredQuantity
from analysis.signals.blocks import TimeInRun
from analysis.signals.header import Severity
from daq.schemas.units import Count, Number, Schema, finite, micrometres, rpm, utc_time
from daq.session.live_update import TimedMarker, alarm_name, alarm_value_text
from recordings.mcap.results import DEFAULT_TEXT, MAX_MARKER_LENGTH, Marker, MarkerKind


class TimeInRunSchema(Schema, of=(TimeInRun,)):
    """A time in a run and the shaft speed at that time."""

    segment: Count = Field(examples=[0])
    time_s: float = Field(examples=[98.4])
    speed_rpm: Number = Field(examples=[10_980.0])


class MarkerSchema(Schema):
    """A named time in a run."""

    kind: MarkerKind = Field(
        description="Text added by an operator, start of an alarm, or acknowledgement of alarms", examples=["word"]
    )
    text: str = Field(description="Text of the marker", examples=["knocking begins"])
    segment: int = Field(description="Gap-free stretch of the run, from 0", examples=[0], ge=0)
    time_s: Number = Field(
        description="Sample time in the segment, s, accurate to a block plus the card's backlog", examples=[12.3]
    )
    marked_at: datetime = Field(description="Wall clock of the host, UTC", examples=["2026-11-24T09:12:19.550000Z"])


class LiveMarkerSchema(MarkerSchema):
    """A marker of the live run."""

    elapsed_s: Number = Field(description="Sample time since the start of the run, s", examples=[12.3])


class MarkerRequest(BaseModel):
    """Request to add a marker at the current time."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    text: Annotated[
        str, Field(description="Text of the marker", examples=["knocking begins"], max_length=MAX_MARKER_LENGTH)
    ] = DEFAULT_TEXT


def marker_schema(marker: Marker, rate: float) -> MarkerSchema:
    """Return the schema of a marker at the run's sample rate, Hz."""
    return MarkerSchema.of(marker, time_s=finite(marker.sample / rate), marked_at=utc_time(marker.host_time_ns))


def live_marker_schema(placed: TimedMarker) -> LiveMarkerSchema:
    """Return the schema of a marker of the live run."""
    return LiveMarkerSchema.of(
        placed.marker,
        time_s=finite(placed.time),
        marked_at=utc_time(placed.marker.host_time_ns),
        elapsed_s=finite(placed.elapsed),
    )


class AlarmSchema(Schema, of=(Alarm,)):
    """An exceeded limit: by vibration for at least the rig's `limits.hold_s`, by speed at once."""

    number: Annotated[int, Field(ge=1)] = Field(examples=[2])
    quantity: MonitoredQuantity = Field(
        description="Watched quantity: overall vibration, 1X, the sum of components below 1X, or speed. Limits and "
        "largest values in other units than its own are null",
        examples=["overall"],
    )
    probe: str | None = Field(description="The operator's name for the probe; null for the speed", examples=["x"])
    severity: Severity = Field(examples=["danger"])
    limit_peak_to_peak_um: Number = Field(
        description="Limit of the overall vibration, µm peak-to-peak", examples=[95.0]
    )
    limit_peak_um: Number = Field(description="Limit of 1X, or of the components below 1X, µm peak", examples=[None])
    limit_rpm: Number = Field(description="Limit of the speed, r/min", examples=[None])
    begin: TimeInRunSchema = Field()
    largest_peak_to_peak_um: Number = Field(
        description="Largest overall vibration since the limit was exceeded, µm peak-to-peak", examples=[97.2]
    )
    largest_peak_um: Number = Field(
        description="Largest 1X, or sum of the amplitudes below 1X, since then, µm peak", examples=[None]
    )
    largest_rpm: Number = Field(description="Highest speed since then, r/min", examples=[None])
    largest_at: TimeInRunSchema = Field()
    end: TimeInRunSchema | None = Field()
    name: str = Field(description="Name of the alarm as displayed", examples=["danger at x"])
    message: str = Field(description="Largest value and limit as displayed", examples=["97 µm peak-to-peak, limit 95"])


class AcknowledgeRequest(Schema):
    """Request to acknowledge all active alarms; it has no fields."""


class AcknowledgedAlarmsSchema(Schema):
    """Acknowledged alarms."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    alarms: tuple[AlarmSchema, ...] = Field(description="Newly acknowledged alarms; those that last stay displayed")


def alarm_schema(alarm: Alarm) -> AlarmSchema:
    """Return the schema of an alarm."""
    is_overall, is_speed = alarm.quantity is MonitoredQuantity.OVERALL, alarm.quantity is MonitoredQuantity.SPEED
    is_peak = not is_overall and not is_speed
    return AlarmSchema.of(
        alarm,
        probe=alarm.probe or None,
        limit_peak_to_peak_um=micrometres(alarm.limit) if is_overall else None,
        limit_peak_um=micrometres(alarm.limit) if is_peak else None,
        limit_rpm=rpm(alarm.limit) if is_speed else None,
        largest_peak_to_peak_um=micrometres(alarm.largest) if is_overall else None,
        largest_peak_um=micrometres(alarm.largest) if is_peak else None,
        largest_rpm=rpm(alarm.largest) if is_speed else None,
        name=alarm_name(alarm),
        message=alarm_value_text(alarm),
    )

"""Limits that were passed, and who took note."""

from pydantic import Field

from analysis.live.alarms import Alarm, Watched
from analysis.signals.header import Severity
from daq.schemas.document import Document
from daq.schemas.place import MomentDocument, place_document
from daq.schemas.units import micrometres, rpm
from daq.session.alarms import alarm_name, alarm_size


class AlarmDocument(Document):
    """A limit that was passed: by vibration for as long as the rig's `limits.hold_s` asks, by the speed at all."""

    number: int = Field(description="In the order in which they came, from 1", examples=[2], ge=1)
    quantity: Watched = Field(
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
    begin: MomentDocument = Field(description="When the alarm came")
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration since the limit was passed, µm peak-to-peak", examples=[97.2]
    )
    largest_peak_um: float | None = Field(
        description="Largest 1X, or sum of the amplitudes below it, since then, µm peak", examples=[None]
    )
    largest_rpm: float | None = Field(description="Highest speed since then, r/min", examples=[None])
    largest_at: MomentDocument = Field(description="Where that was")
    end: MomentDocument | None = Field(
        description="When the value had fallen below the limit by the rig's hysteresis; null while it lasts, or "
        "where it lasted to the run's end"
    )
    name: str = Field(description="Which it is, for people", examples=["danger at x"])
    told: str = Field(
        description="The largest value and the limit, for people", examples=["97 µm peak-to-peak, limit 95"]
    )


class AcknowledgeDocument(Document):
    """An order to take note of the alarms in sight; it has no fields."""


class AcknowledgedDocument(Document):
    """Alarms that somebody has taken note of."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    alarms: tuple[AlarmDocument, ...] = Field(description="Those that were new; those that last stay in sight")


def alarm_document(alarm: Alarm) -> AlarmDocument:
    """Return an alarm as a document."""
    is_overall, is_speed = alarm.quantity is Watched.OVERALL, alarm.quantity is Watched.SPEED
    is_peak = not is_overall and not is_speed
    return AlarmDocument(
        number=alarm.number,
        quantity=alarm.quantity,
        probe=alarm.probe or None,
        severity=alarm.severity,
        limit_peak_to_peak_um=micrometres(alarm.limit) if is_overall else None,
        limit_peak_um=micrometres(alarm.limit) if is_peak else None,
        limit_rpm=rpm(alarm.limit) if is_speed else None,
        begin=place_document(alarm.begin),
        largest_peak_to_peak_um=micrometres(alarm.largest) if is_overall else None,
        largest_peak_um=micrometres(alarm.largest) if is_peak else None,
        largest_rpm=rpm(alarm.largest) if is_speed else None,
        largest_at=place_document(alarm.largest_at),
        end=None if alarm.end is None else place_document(alarm.end),
        name=alarm_name(alarm),
        told=alarm_size(alarm),
    )

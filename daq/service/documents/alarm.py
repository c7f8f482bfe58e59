"""Limits that were passed, and who took note."""

from pydantic import Field

from analysis.alarm import Alarm
from analysis.run import Severity
from daq.service.documents.document import Document
from daq.service.documents.place import MomentDocument, place_document
from daq.service.documents.units import micrometres


class AlarmDocument(Document):
    """A limit that was passed at one probe for as long as the rig's `limits.hold_s` asks."""

    number: int = Field(description="In the order in which they came, from 1", examples=[2], ge=1)
    probe: str = Field(description="The operator's name for the probe", examples=["x"])
    severity: Severity = Field(description="Which limit", examples=["danger"])
    limit_peak_to_peak_um: float | None = Field(description="That limit, µm peak-to-peak", examples=[95.0])
    begin: MomentDocument = Field(description="When the alarm came")
    largest_peak_to_peak_um: float | None = Field(
        description="Largest overall vibration since the limit was passed, µm peak-to-peak", examples=[97.2]
    )
    largest_at: MomentDocument = Field(description="Where that was")
    end: MomentDocument | None = Field(
        description="When the vibration had fallen below the limit by the rig's hysteresis; null while it lasts, or "
        "where it lasted to the run's end"
    )


class AcknowledgeDocument(Document):
    """An order to take note of the alarms in sight; it has no fields."""


class AcknowledgedDocument(Document):
    """Alarms that somebody has taken note of."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    alarms: tuple[AlarmDocument, ...] = Field(description="Those that were new; those that last stay in sight")


def alarm_document(alarm: Alarm) -> AlarmDocument:
    """Return an alarm as a document."""
    return AlarmDocument(
        number=alarm.number,
        probe=alarm.probe,
        severity=alarm.severity,
        limit_peak_to_peak_um=micrometres(alarm.limit),
        begin=place_document(alarm.begin),
        largest_peak_to_peak_um=micrometres(alarm.largest),
        largest_at=place_document(alarm.largest_at),
        end=None if alarm.end is None else place_document(alarm.end),
    )

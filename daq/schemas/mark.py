"""Moments that were marked while a run was recorded."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from daq.schemas.document import Document
from daq.schemas.units import finite, moment
from daq.session.live_update import PlacedMark
from recordings.mcap.markers import MOST_LETTERS, Mark, MarkKind


class MarkDocument(Document):
    """A moment and its name."""

    kind: MarkKind = Field(
        description="A word of somebody, an alarm that came, or the acknowledgement of alarms", examples=["word"]
    )
    text: str = Field(description="Its name", examples=["knocking begins"])
    segment: int = Field(description="The segment in which it lies", examples=[0], ge=0)
    time_s: float | None = Field(
        description="Sample time in the segment, s, right within a block and the card's backlog", examples=[12.3]
    )
    at: datetime = Field(description="Wall clock of the host, UTC", examples=["2026-11-24T09:12:19.550000Z"])


class LiveMarkDocument(MarkDocument):
    """A moment of the run under way."""

    elapsed_s: float | None = Field(description="Sample time since the run began, s", examples=[12.3])


class MarkOrder(BaseModel):
    """What the present moment is to be called."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    text: Annotated[str, Field(description="Its name", examples=["knocking begins"], max_length=MOST_LETTERS)] = "mark"


def mark_document(mark: Mark, rate: float) -> MarkDocument:
    """Return a mark as a document, for the run's sample rate, Hz."""
    return MarkDocument(
        kind=mark.kind,
        text=mark.text,
        segment=mark.segment,
        time_s=finite(mark.sample / rate),
        at=moment(mark.host_time_ns),
    )


def live_mark_document(placed: PlacedMark) -> LiveMarkDocument:
    """Return a mark of the run under way as a document."""
    return LiveMarkDocument(
        kind=placed.mark.kind,
        text=placed.mark.text,
        segment=placed.mark.segment,
        time_s=finite(placed.time),
        at=moment(placed.mark.host_time_ns),
        elapsed_s=finite(placed.elapsed),
    )

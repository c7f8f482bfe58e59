"""A place in a run."""

from pydantic import Field

from analysis.whirl.findings import Moment
from daq.schemas.document import Document
from daq.schemas.units import finite, rpm


class MomentDocument(Document):
    """A place in a run."""

    segment: int = Field(description="Gap-free stretch of the run, from 0", examples=[0], ge=0)
    time_s: float = Field(description="Sample time in that segment, s", examples=[98.4])
    speed_rpm: float | None = Field(description="Shaft speed there, r/min; null where unknown", examples=[10_980.0])


def place_document(place: Moment) -> MomentDocument:
    """Return a place in a run as a document."""
    return MomentDocument(segment=place.segment, time_s=finite(place.time) or 0.0, speed_rpm=rpm(place.speed))

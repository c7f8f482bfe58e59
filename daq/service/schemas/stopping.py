"""Starting and ending a run over REST."""

from datetime import datetime

from pydantic import Field

from daq.schemas.document import Document
from daq.schemas.run import RunId


class OrderDocument(Document):
    """What is to be recorded."""

    rig: str | None = Field(
        None, description="Name of the rig, one that the service was started with; the first where left out",
        max_length=200, examples=["gj90c"],
    )  # fmt: skip
    note: str = Field("", description="The operator's words", max_length=2000, examples=["after the oil change"])
    duration_s: float | None = Field(
        None, description="Sample time after which the run ends by itself, s; null: when it is stopped",
        strict=True, gt=0, le=1e6, examples=[300.0],
    )  # fmt: skip


class StartedDocument(Document):
    """A run that has begun."""

    run: RunId
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])


class StopDocument(Document):
    """An order to end the run under way; it has no fields."""


class StoppingDocument(Document):
    """A run that is ending."""

    run: RunId

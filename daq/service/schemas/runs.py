"""Starting and ending a run over REST.

What may be changed of a recorded run: what is said of it, and where it lies.
"""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from daq.schemas.runs import RunId
from daq.schemas.units import Schema


class AnnotationRequest(Schema):
    """Words and tags for a run; what is left out or null stays as it is."""

    remark: str | None = Field(
        None, description="Words on the run, in place of those before", max_length=10_000, examples=["bearing changed"]
    )
    tags: tuple[Annotated[str, Field(max_length=64)], ...] | None = Field(
        None, description="All its tags, in place of those before; printable, without blanks at either end",
        max_length=100, examples=[["reference"]],
    )  # fmt: skip


class TrashedRunSchema(Schema):
    """A run that was moved into the trash."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    trash: str = Field(
        description="Its file, in the data folder; it can be taken back",
        examples=["trash/2026-11-24T09-12-07-gj90c.mcap"],
    )
    name: str = Field(description="Its name in the trash", examples=["2026-11-24T09-12-07-gj90c"])


class TrashEntrySchema(Schema):
    """A run in the trash."""

    name: str = Field(
        description="Its id, with a number behind where a run of this id lay there already",
        examples=["2026-11-24T09-12-07-gj90c (2)"],
    )
    size_bytes: int = Field(description="Size of its file, bytes", ge=0, examples=[154_000_000])


class TrashSchema(Schema):
    """What was put away."""

    runs: tuple[TrashEntrySchema, ...] = Field(description="By name")


class RestoreRequest(Schema):
    """What a run that is taken back is to be called."""

    run: str | None = Field(
        None, description="Its id; null: its name in the trash", max_length=200, examples=["2026-11-24T09-12-07-gj90c"]
    )


class StartRequest(Schema):
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


class StartedRunSchema(Schema):
    """A run that has begun."""

    run: RunId
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])


class StopRequest(Schema):
    """An order to end the run under way; it has no fields."""


class StoppingRunSchema(Schema):
    """A run that is ending."""

    run: RunId

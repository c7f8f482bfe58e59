"""Schemas for starting and stopping runs, and for annotating, deleting and restoring them."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from daq.schemas.runs import RunId
from daq.schemas.units import Schema


class AnnotationRequest(Schema):
    """Remark and tags of a run; a field that is left out or null is not changed."""

    remark: str | None = Field(
        None,
        description="Remark on the run; replaces the previous one",
        max_length=10_000,
        examples=["bearing changed"],
    )
    tags: tuple[Annotated[str, Field(max_length=64)], ...] | None = Field(
        None, description="All tags; replaces the previous ones. Printable, without leading or trailing spaces",
        max_length=100, examples=[["reference"]],
    )  # fmt: skip


class TrashedRunSchema(Schema):
    """A run that was moved into the trash."""

    run: str = Field(description="Id of the run", examples=["2026-11-24T09-12-07-gj90c"])
    trash: str = Field(
        description="Its file, relative to the data folder; the run can be restored",
        examples=["trash/2026-11-24T09-12-07-gj90c.mcap"],
    )
    name: str = Field(description="Its name in the trash", examples=["2026-11-24T09-12-07-gj90c"])


class TrashEntrySchema(Schema):
    """A run in the trash."""

    name: str = Field(
        description="Its id, with a number if the trash already had a run of this id",
        examples=["2026-11-24T09-12-07-gj90c (2)"],
    )
    size_bytes: int = Field(description="Size of its file, bytes", ge=0, examples=[154_000_000])


class TrashSchema(Schema):
    """The runs in the trash."""

    runs: tuple[TrashEntrySchema, ...] = Field(description="Sorted by name")


class RestoreRequest(Schema):
    """Id of the restored run."""

    run: str | None = Field(
        None, description="New id; null: its name in the trash", max_length=200, examples=["2026-11-24T09-12-07-gj90c"]
    )


class StartRequest(Schema):
    """Request to start a run."""

    rig: str | None = Field(
        None, description="Name of a rig that the service was started with; null: the first",
        max_length=200, examples=["gj90c"],
    )  # fmt: skip
    note: str = Field("", description="The operator's note", max_length=2000, examples=["after the oil change"])
    duration_s: float | None = Field(
        None, description="Duration after which the run ends, s of samples; null: until it is stopped",
        strict=True, gt=0, le=1e6, examples=[300.0],
    )  # fmt: skip


class StartedRunSchema(Schema):
    """A run that has started."""

    run: RunId
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])


class StopRequest(Schema):
    """Request to stop the current run; it has no fields."""


class StoppingRunSchema(Schema):
    """A run that is stopping."""

    run: RunId

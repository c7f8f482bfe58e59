"""A run in the list of runs."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Protocol

from pydantic import Field

from daq.service.documents.document import Document
from daq.service.documents.units import finite, moment

Count = Annotated[int, Field(ge=0)]


class RunEntry(Protocol):
    """What the list needs to know of a run."""

    run: str
    rig: str
    started_ns: int
    duration: float
    samples: int
    is_complete: bool
    size: int
    note: str
    trouble: str


class RunDocument(Document):
    """A recorded run."""

    run: str = Field(description="Its id", examples=["2026-11-24T09-12-07-gj90c"])
    rig: str = Field(description="Name of the rig", examples=["gj90c"])
    note: str = Field(description="The operator's words", examples=["after the oil change"])
    started_at: datetime = Field(description="Wall clock at the start, UTC", examples=["2026-11-24T09:12:07.250000Z"])
    duration_s: float | None = Field(description="Sampled time, s; null where unknown", examples=[300.0])
    samples: Count | None = Field(description="Samples per channel; null where unknown", examples=[60_000_000])
    is_complete: bool = Field(description="Whether the recording was ended in order", examples=[True])
    size_bytes: Count = Field(description="Size of the file, bytes", examples=[154_000_000])
    trouble: str = Field(description="What is wrong with the file; empty where nothing is", examples=[""])


class RunListDocument(Document):
    """A page of the list of runs."""

    runs: tuple[RunDocument, ...] = Field(description="Newest first")
    total: Count = Field(description="Runs that fit the question, on all pages", examples=[12])
    limit: Count = Field(description="At most so many on a page", examples=[20])
    offset: Count = Field(description="So many of the newest were passed over", examples=[0])


def run_document(entry: RunEntry) -> RunDocument:
    """Return a run of the catalogue as a document."""
    return RunDocument(
        run=entry.run,
        rig=entry.rig,
        note=entry.note,
        started_at=moment(entry.started_ns),
        duration_s=finite(entry.duration),
        samples=entry.samples,
        is_complete=entry.is_complete,
        size_bytes=entry.size,
        trouble=entry.trouble,
    )


def run_list_document(entries: Sequence[RunEntry], total: int, limit: int, offset: int) -> RunListDocument:
    """Return a page of runs, of ``total`` on all pages, as a document."""
    return RunListDocument(
        runs=tuple(run_document(entry) for entry in entries), total=total, limit=limit, offset=offset
    )

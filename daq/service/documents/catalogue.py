"""What the catalogue knows of the runs, as documents."""

from pydantic import Field

from daq.service.documents.document import Document
from daq.service.documents.run import RunDocument, run_document
from recordings.catalogue import RunEntry
from recordings.indexing import IndexReport


class FoundRunDocument(Document):
    """A run and what was said of it afterwards."""

    run: RunDocument
    remark: str = Field(description="Words added afterwards", examples=["bearing changed after this run"])
    tags: tuple[str, ...] = Field(description="Tags given afterwards", examples=[["reference"]])
    verdict: str = Field(
        description="What the last verification of the file came to: sound, not whole, unreadable; empty without one",
        examples=["sound"],
    )


class IndexDocument(Document):
    """How the files differ from what was known of them, by their runs' ids."""

    new: tuple[str, ...]
    changed: tuple[str, ...]
    vanished: tuple[str, ...]
    damaged: tuple[str, ...]
    unchanged: int


def found_run_document(entry: RunEntry) -> FoundRunDocument:
    """Return a run of the catalogue, with its words, as a document."""
    return FoundRunDocument(run=run_document(entry), remark=entry.remark, tags=entry.tags, verdict=entry.verdict)


def index_document(report: IndexReport) -> IndexDocument:
    """Return what an index found as a document."""
    return IndexDocument(
        new=report.new,
        changed=report.changed,
        vanished=report.vanished,
        damaged=report.damaged,
        unchanged=report.unchanged,
    )

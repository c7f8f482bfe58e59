"""What the catalogue knows of the runs, as documents."""

from daq.schemas.document import Document
from recordings.catalogue.indexing import IndexReport


class IndexDocument(Document):
    """How the files differ from what was known of them, by their runs' ids."""

    new: tuple[str, ...]
    changed: tuple[str, ...]
    vanished: tuple[str, ...]
    damaged: tuple[str, ...]
    unchanged: int


def index_document(report: IndexReport) -> IndexDocument:
    """Return what an index found as a document."""
    return IndexDocument(
        new=report.new,
        changed=report.changed,
        vanished=report.vanished,
        damaged=report.damaged,
        unchanged=report.unchanged,
    )

"""The header of a run, from whichever of its copies is intact."""

from collections.abc import Mapping
from pathlib import Path

from analysis.signals.header import RunHeader
from recordings.errors import DamagedError, RecordingError, UnknownFormatError
from recordings.mcap.container import Container
from recordings.mcap.header import header_from_document
from recordings.mcap.layout import RUN_RECORD, unsealed
from recordings.mcap.salvage import search_metadata


def read_header(container: Container) -> RunHeader:
    """Return the header of a run; the whole file is searched for it where its records do not lead there.

    Raises
    ------
    DamagedError
        Where no copy is intact.
    UnknownFormatError
        Where the file is no run or of a format version that is not known here.
    """
    faults: list[RecordingError] = []
    for entries in container.metadata(RUN_RECORD) or search_metadata(container, RUN_RECORD):
        try:
            return header_of(container.path, entries)
        except RecordingError as error:
            faults.append(error)
    if faults:
        raise faults[0]
    if container.is_finished:
        raise UnknownFormatError(f"{container.path}: an MCAP file, but no run: it lacks the record {RUN_RECORD}")
    raise DamagedError(f"{container.path}: cut short or damaged: the record {RUN_RECORD} at its start is missing")


def header_of(path: Path, entries: Mapping[str, str]) -> RunHeader:
    """Return the header that one of its copies holds; DamagedError or UnknownFormatError where it holds none."""
    document = unsealed(path, RUN_RECORD, entries)
    try:
        return header_from_document(document)
    except DamagedError as error:
        raise DamagedError(f"{path}: {error}") from error

"""Entries of the catalogue: a run's file and its annotations, what is read from them, and how long that is valid.

Annotations are a remark and tags in a JSON file beside the run; the recording itself never changes.
"""

import hashlib
import json
import stat
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Self

from analysis.signals.header import Acquisition, RunHeader
from analysis.signals.snapshot import LARGEST_OVERALL
from analysis.signals.units import NUMBER
from recordings.errors import AnnotationError, RecordingError
from recordings.file_operations import atomic_write, storage_errors
from recordings.mcap.container import has_end_magic
from recordings.mcap.header import to_json
from recordings.mcap.layout import NANOSECONDS
from recordings.mcap.reader import RunReader

if TYPE_CHECKING:  # imports scipy, for which listing runs need not wait
    from analysis.live.summary import RunSummary

ANNOTATIONS_SUFFIX = ".notes.json"
ANNOTATIONS_FORMAT = 1
MAX_TAG_LENGTH = 64
MAX_REMARK_LENGTH = 10_000


@dataclass(frozen=True, slots=True)
class Annotations:
    """Remark and tags of a run.

    Parameters
    ----------
    remark : str
        Free text.
    tags : tuple of str
        Labels, sorted, without duplicates.
    """

    remark: str = ""
    tags: tuple[str, ...] = ()


def validated_annotations(remark: str, tags: tuple[str, ...]) -> Annotations:
    """Return annotations with stripped remark and sorted tags; AnnotationError if one is too long or malformed."""
    if len(remark) > MAX_REMARK_LENGTH:
        raise AnnotationError(f"remark: {len(remark)} characters, expected at most {MAX_REMARK_LENGTH}")
    for tag in tags:
        if not tag.strip() or tag != tag.strip() or len(tag) > MAX_TAG_LENGTH or not tag.isprintable():
            raise AnnotationError(
                f"tag: {tag[:80]!r}, expected 1 to {MAX_TAG_LENGTH} printable characters, no blanks at either end"
            )
    return Annotations(remark.strip(), tuple(sorted(set(tags))))


def annotations_path(run: Path) -> Path:
    """Return the path of the annotations file beside a run's file."""
    return run.with_name(f"{run.stem}{ANNOTATIONS_SUFFIX}")


def load_annotations(run: Path) -> Annotations:
    """Return the annotations of a run; empty if they are missing or cannot be read."""
    try:
        content = json.loads(annotations_path(run).read_text(encoding="utf-8"))
    except (OSError, ValueError):  # no such file, or neither UTF-8 nor JSON
        return Annotations()
    match content:
        case {"remark": str(remark), "tags": [*tags]} if all(isinstance(tag, str) for tag in tags):
            with suppress(AnnotationError):
                return validated_annotations(remark, tuple(tags))
    return Annotations()


def store_annotations(run: Path, annotations: Annotations) -> None:
    """Replace the annotations of a run, atomically; StorageError if that fails."""
    path = annotations_path(run)
    content = {"format": ANNOTATIONS_FORMAT, "remark": annotations.remark, "tags": list(annotations.tags)}
    with storage_errors(path), atomic_write(path) as temporary:
        temporary.write_text(json.dumps(content, ensure_ascii=False, indent=1), encoding="utf-8")


NOT_FINISHED = "not finished: it is still being written, or its writer was killed"


@dataclass(frozen=True, slots=True)
class RunFile:
    """Size and modification times of a run's file: what changes when the file changes.

    Parameters
    ----------
    path : Path
        The file.
    size : int
        Bytes.
    modified_ns : int
        Modification time of the file, ns since 1970.
    annotations_modified_ns : int
        Modification time of the annotations beside it, ns since 1970; 0 without annotations.
    """

    path: Path
    size: int
    modified_ns: int
    annotations_modified_ns: int

    @classmethod
    def from_path(cls, path: Path, *, may_have_annotations: bool = True) -> Self | None:
        """Return the state of a file on disk; None if it is missing or not a regular file."""
        try:
            status = path.stat()
        except OSError:
            return None
        if not stat.S_ISREG(status.st_mode):
            return None
        annotations_modified_ns = 0
        if may_have_annotations:
            with suppress(OSError):
                annotations_modified_ns = annotations_path(path).stat().st_mtime_ns
        return cls(path, status.st_size, status.st_mtime_ns, annotations_modified_ns)


@dataclass(frozen=True, slots=True)
class RunEntry:
    """A run as the catalogue lists it.

    Parameters
    ----------
    path : Path
        The run's file.
    modified_ns : int
        Modification time of the file, ns since 1970.
    header : RunHeader or None
        The run's header; None if the file cannot be read.
    duration : float
        Sample time, s.
    samples : int
        Samples per channel.
    calibration : str
        `calibration_identity` of the probes' calibrations.
    largest : tuple of float or None
        Largest overall vibration by the measures `OVERALL`; None until the run is indexed with its summary.
    """

    id: Annotated[str, NUMBER.of("Id of the run", "run")]
    path: Path
    size: Annotated[int, NUMBER.of("Size of the file, bytes", "size_bytes")]
    modified_ns: int
    header: RunHeader | None = None
    duration: float = 0.0
    samples: int = 0
    is_complete: Annotated[bool, NUMBER.of("Whether the recording was finished properly")] = False
    is_gap_free: Annotated[bool, NUMBER.of("Whether the run is one segment without lost samples")] = False
    fault: Annotated[str, NUMBER.of("Error of the file; empty without an error")] = ""
    remark: Annotated[str, NUMBER.of("Remark added afterwards")] = ""
    tags: Annotated[tuple[str, ...], NUMBER.of("Tags added afterwards")] = ()
    verdict: Annotated[
        str, NUMBER.of("Verdict of the last verification: intact, damaged, unreadable; empty without one")
    ] = ""
    calibration: str = ""
    largest: Annotated[tuple[float, ...] | None, LARGEST_OVERALL] = None

    @property
    def started_ns(self) -> int:
        """Start of the run, ns since 1970; the file's modification time if the header cannot be read."""
        return self.modified_ns if self.header is None else self.header.started_ns


def read_entry(path: Path, size: int, modified_ns: int) -> RunEntry:
    """Return the entry of a file, read from the file alone; a read error becomes the entry's fault."""
    try:
        with RunReader(path) as reader:
            return RunEntry(
                path.stem,
                path,
                size,
                modified_ns,
                header=reader.header,
                duration=reader.duration,
                samples=reader.n_samples,
                is_complete=reader.is_complete,
                is_gap_free=reader.is_gap_free,
                fault="" if reader.is_complete else NOT_FINISHED,
                calibration=calibration_identity(reader.header.acquisition),
            )
    except RecordingError as error:
        return RunEntry(path.stem, path, size, modified_ns, fault=str(error))


def calibration_identity(acquisition: Acquisition) -> str:
    """Return a hash of the probes' calibrations, 16 hexadecimal digits: equal for equal calibrations only."""
    calibrations = {
        channel.name: to_json(channel.calibration)
        for channel in acquisition.channels
        if channel.calibration is not None
    }
    return hashlib.sha256(json.dumps(calibrations, sort_keys=True).encode()).hexdigest()[:16]


Summarise = Callable[[RunReader], "RunSummary"]
UNREADABLE = "unreadable"
MAX_WRITE_PAUSE = 10.0
"""Seconds after its last change in which an unfinished file may still be being written."""
READ_INTERVAL_FACTOR = 20
"""A file that is being written is read again only after this many times the duration of the last read."""


@dataclass(frozen=True, slots=True)
class IndexReport:
    """Differences between the files of a folder and the catalogue's earlier state, as run ids."""

    new: Annotated[tuple[str, ...], NUMBER.of("Runs whose files were not in the catalogue")]
    changed: Annotated[tuple[str, ...], NUMBER.of("Runs whose files have changed")]
    missing: Annotated[tuple[str, ...], NUMBER.of("Runs whose files are gone")]
    damaged: Annotated[tuple[str, ...], NUMBER.of("Runs whose files are incomplete or cannot be read, new or not")]
    unchanged: Annotated[int, NUMBER.of("Number of files that have not changed")]


@dataclass(frozen=True, slots=True)
class CachedRun:
    """An entry read from the database or a file, and how long it is valid.

    Parameters
    ----------
    entry : RunEntry
        The entry.
    annotations_modified_ns : int
        Modification time of the annotations in the entry, ns since 1970; 0 without annotations.
    revision : int
        Revision of the folder's rows when it was read; -1 if it was read from the file itself.
    is_summarised : bool
        Whether the summary is stored too.
    next_read_at : float
        Monotonic time before which a file that is being written is not read again, s.
    """

    entry: RunEntry
    annotations_modified_ns: int
    revision: int
    is_summarised: bool = False
    next_read_at: float = 0.0

    @classmethod
    def from_file(cls, file: RunFile) -> Self:
        """Return the entry read from the file itself."""
        started = time.monotonic()
        entry = read_entry(file.path, file.size, file.modified_ns)
        added = load_annotations(file.path) if file.annotations_modified_ns else Annotations()
        ended = time.monotonic()
        return cls(
            replace(entry, remark=added.remark, tags=added.tags),
            file.annotations_modified_ns,
            revision=-1,
            next_read_at=ended + READ_INTERVAL_FACTOR * (ended - started),
        )

    @property
    def is_growing(self) -> bool:
        """Whether the recording may still be in progress; such an entry is not stored in the database."""
        entry = self.entry
        age_ns = time.time_ns() - entry.modified_ns
        return self.revision < 0 and not entry.is_complete and age_ns < MAX_WRITE_PAUSE * NANOSECONDS

    def is_valid(self, file: RunFile, revision: int) -> bool:
        """Return whether the entry describes the file, or may be used until a growing file is due to be read again."""
        entry = self.entry
        if self.annotations_modified_ns != file.annotations_modified_ns or self.revision not in (-1, revision):
            return False
        if (entry.size, entry.modified_ns) == (file.size, file.modified_ns):
            return self.revision >= 0 or self.is_growing
        has_grown = not entry.is_complete and entry.header is not None and file.size >= entry.size
        return has_grown and time.monotonic() < self.next_read_at and not has_end_magic(file.path)

    def describes(self, file: RunFile) -> bool:
        """Return whether the entry from the database describes the file in its present state."""
        entry = self.entry
        is_same = (entry.size, entry.modified_ns) == (file.size, file.modified_ns)
        return is_same and (entry.header is not None or entry.fault != "")


def compare(before: Mapping[str, CachedRun], present: Mapping[str, RunEntry]) -> IndexReport:
    """Return how the present runs differ from the catalogue's earlier state."""
    known = {run_id: (stored.entry.size, stored.entry.modified_ns) for run_id, stored in before.items()}
    changed = [run_id for run_id, entry in present.items() if known.get(run_id, ()) != (entry.size, entry.modified_ns)]
    return IndexReport(
        new=tuple(sorted(run_id for run_id in changed if run_id not in known)),
        changed=tuple(sorted(run_id for run_id in changed if run_id in known)),
        missing=tuple(sorted(known.keys() - present.keys())),
        damaged=tuple(sorted(run_id for run_id, entry in present.items() if entry.fault)),
        unchanged=len(present) - len(changed),
    )

"""Comparison of the catalogue with the files of a data folder, and the validity of cached entries."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from analysis.live.summary import RunSummary
from recordings.catalogue import annotations
from recordings.catalogue.entry import RunEntry, RunFile, read_entry
from recordings.catalogue.run_store import StoredRun
from recordings.errors import RecordingError
from recordings.integrity.verify import verify
from recordings.mcap.container import has_end_magic
from recordings.mcap.layout import NANOSECONDS
from recordings.mcap.reader import RunReader

Summarise = Callable[[RunReader], RunSummary]
UNREADABLE = "unreadable"
MAX_WRITE_PAUSE = 10.0
"""Seconds after its last change in which an unfinished file may still be being written."""
READ_INTERVAL_FACTOR = 20
"""A file that is being written is read again only after this many times the duration of the last read."""


@dataclass(frozen=True, slots=True)
class IndexReport:
    """Differences between the files of a folder and the catalogue's earlier state, as run ids.

    Parameters
    ----------
    new, changed, missing : tuple of str
        Files that were not in the catalogue, have changed, or are gone.
    damaged : tuple of str
        Files that are incomplete or cannot be read, whether new or not.
    unchanged : int
        Number of files that have not changed.
    """

    new: tuple[str, ...]
    changed: tuple[str, ...]
    missing: tuple[str, ...]
    damaged: tuple[str, ...]
    unchanged: int


def compare(before: Mapping[str, StoredRun], present: Mapping[str, RunEntry]) -> IndexReport:
    """Return how the present runs differ from the catalogue's earlier state."""
    known = {run_id: (stored.entry.size, stored.entry.changed_ns) for run_id, stored in before.items()}
    changed = [run_id for run_id, entry in present.items() if known.get(run_id, ()) != (entry.size, entry.changed_ns)]
    return IndexReport(
        new=tuple(sorted(run_id for run_id in changed if run_id not in known)),
        changed=tuple(sorted(run_id for run_id in changed if run_id in known)),
        missing=tuple(sorted(known.keys() - present.keys())),
        damaged=tuple(sorted(run_id for run_id, entry in present.items() if entry.fault)),
        unchanged=len(present) - len(changed),
    )


def verdict_of(path: Path) -> str:
    """Return the `Verdict` on a file, or "unreadable"."""
    try:
        return verify(path).verdict.value
    except RecordingError:
        return UNREADABLE


@dataclass(frozen=True, slots=True)
class CachedRun:
    """An entry in memory, and how long it is valid.

    Parameters
    ----------
    entry : RunEntry
        The entry.
    remarked_ns : int
        Modification time of the annotations in the entry, ns since 1970; 0 without annotations.
    revision : int
        Revision of the folder's rows when it was read; -1 if it was read from the file itself.
    next_read_at : float
        Monotonic time before which a file that is being written is not read again, s.
    """

    entry: RunEntry
    remarked_ns: int
    revision: int
    next_read_at: float = 0.0

    @classmethod
    def from_stored(cls, stored: StoredRun) -> Self:
        """Return the entry from the database's rows."""
        return cls(stored.entry, stored.remarked_ns, stored.revision)

    @classmethod
    def from_file(cls, file: RunFile) -> Self:
        """Return the entry read from the file itself."""
        started = time.monotonic()
        entry = read_entry(file.path, file.size, file.changed_ns)
        added = annotations.load(file.path) if file.remarked_ns else annotations.Annotations()
        ended = time.monotonic()
        next_read_at = ended + READ_INTERVAL_FACTOR * (ended - started)
        return cls(replace(entry, remark=added.remark, tags=added.tags), file.remarked_ns, -1, next_read_at)

    @property
    def is_growing(self) -> bool:
        """Whether the recording may still be in progress; such an entry is not stored in the database."""
        entry = self.entry
        age_ns = time.time_ns() - entry.changed_ns
        return self.revision < 0 and not entry.is_complete and age_ns < MAX_WRITE_PAUSE * NANOSECONDS

    def is_valid(self, file: RunFile, revision: int) -> bool:
        """Return whether the entry describes the file, or may be used until a growing file is due to be read again."""
        entry = self.entry
        if self.remarked_ns != file.remarked_ns or self.revision not in (-1, revision):
            return False
        if (entry.size, entry.changed_ns) == (file.size, file.changed_ns):
            return self.revision >= 0 or self.is_growing
        has_grown = not entry.is_complete and entry.header is not None and file.size >= entry.size
        return has_grown and time.monotonic() < self.next_read_at and not has_end_magic(file.path)


def is_current(stored: StoredRun | None, file: RunFile) -> bool:
    """Return whether the stored entry describes the file in its present state."""
    if stored is None or (stored.entry.size, stored.entry.changed_ns) != (file.size, file.changed_ns):
        return False
    return stored.entry.header is not None or stored.entry.fault != ""

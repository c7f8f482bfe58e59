"""What the index of a data folder finds changed since it was last made.

What is known of a run, and for how long that is worth not looking again.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from analysis.live.summary import RunSummary
from recordings.catalogue import annotations
from recordings.catalogue.entry import RunEntry, read_entry
from recordings.catalogue.run_file import RunFile
from recordings.catalogue.run_store import StoredRun
from recordings.errors import RecordingError
from recordings.integrity.verify import verify
from recordings.mcap.container import is_ended
from recordings.mcap.layout import NANOSECONDS
from recordings.mcap.reader import RunReader

Summarise = Callable[[RunReader], RunSummary]
UNREADABLE = "unreadable"


@dataclass(frozen=True, slots=True)
class IndexReport:
    """How the files of a folder differ from what was known of them, by their runs' ids.

    Parameters
    ----------
    new, changed, vanished : tuple of str
        Files that were not known, that are not as they were, and that are gone.
    damaged : tuple of str
        Files that are not whole or cannot be read, known before or not.
    unchanged : int
        Files that are as they were.
    """

    new: tuple[str, ...]
    changed: tuple[str, ...]
    vanished: tuple[str, ...]
    damaged: tuple[str, ...]
    unchanged: int


def compare(before: Mapping[str, StoredRun], present: Mapping[str, RunEntry]) -> IndexReport:
    """Return how the runs that are there differ from what was known."""
    known = {run_id: (kept.entry.size, kept.entry.changed_ns) for run_id, kept in before.items()}
    changed = [run_id for run_id, entry in present.items() if known.get(run_id, ()) != (entry.size, entry.changed_ns)]
    return IndexReport(
        new=tuple(sorted(run_id for run_id in changed if run_id not in known)),
        changed=tuple(sorted(run_id for run_id in changed if run_id in known)),
        vanished=tuple(sorted(known.keys() - present.keys())),
        damaged=tuple(sorted(run_id for run_id, entry in present.items() if entry.fault)),
        unchanged=len(present) - len(changed),
    )


def verdict_of(path: Path) -> str:
    """Return the verdict on a file as it is kept."""
    try:
        return verify(path).verdict.value
    except RecordingError:
        return UNREADABLE


GROWING = 10.0
"""Seconds since its last change in which an unfinished file may still be being written."""
READING_SHARE = 20
"""A file that is being written is read again after so many times as long as that took."""


@dataclass(frozen=True, slots=True)
class CachedRun:
    """An entry in memory, and how long it is worth not looking again.

    Parameters
    ----------
    entry : RunEntry
        The entry.
    remarked_ns : int
        Last change of the annotations in it, ns since 1970; 0 where there were none.
    revision : int
        Of the folder's rows from which it came; -1 where it was read from the file itself.
    again_at : float
        Monotonic time before which a file that is being written is not read again, s.
    """

    entry: RunEntry
    remarked_ns: int
    revision: int
    again_at: float = 0.0

    @classmethod
    def of(cls, kept: StoredRun) -> Self:
        """Return what the catalogue's rows tell."""
        return cls(kept.entry, kept.remarked_ns, kept.revision)

    @classmethod
    def read(cls, file: RunFile) -> Self:
        """Return what the file itself tells."""
        begun = time.monotonic()
        entry = read_entry(file.path, file.size, file.changed_ns)
        words = annotations.load(file.path) if file.remarked_ns else annotations.Annotations()
        ended = time.monotonic()
        again_at = ended + READING_SHARE * (ended - begun)
        return cls(replace(entry, remark=words.remark, tags=words.tags), file.remarked_ns, -1, again_at)

    @property
    def is_growing(self) -> bool:
        """Whether it may be of a run that is being recorded: such an entry is not worth keeping."""
        entry = self.entry
        return self.revision < 0 and not entry.is_complete and time.time_ns() - entry.changed_ns < GROWING * NANOSECONDS

    def serves(self, file: RunFile, revision: int) -> bool:
        """Whether the entry still tells of the file, or nearly so where it is being written and long to read."""
        entry = self.entry
        if self.remarked_ns != file.remarked_ns or self.revision not in (-1, revision):
            return False
        if (entry.size, entry.changed_ns) == (file.size, file.changed_ns):
            return self.revision >= 0 or self.is_growing
        is_growing = not entry.is_complete and entry.header is not None and file.size >= entry.size
        return is_growing and time.monotonic() < self.again_at and not is_ended(file.path)


def holds(kept: StoredRun | None, file: RunFile) -> bool:
    """Whether what is kept tells of the file as it is."""
    if kept is None or (kept.entry.size, kept.entry.changed_ns) != (file.size, file.changed_ns):
        return False
    return kept.entry.header is not None or kept.entry.fault != ""

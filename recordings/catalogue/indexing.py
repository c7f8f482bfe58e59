"""What the index of a data folder finds changed since it was last made."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from analysis.live.summary import RunSummary
from recordings.catalogue.entry import RunEntry
from recordings.catalogue.run_store import Kept
from recordings.errors import RecordingError
from recordings.integrity.verify import verify
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


def compare(before: Mapping[str, Kept], present: Mapping[str, RunEntry]) -> IndexReport:
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

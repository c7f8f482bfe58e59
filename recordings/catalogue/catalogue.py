"""The catalogue of the runs in a data folder."""

import os
import re
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

from recordings.catalogue import trash
from recordings.catalogue.database import Database
from recordings.catalogue.entry import (
    ANNOTATIONS_SUFFIX,
    UNREADABLE,
    CachedRun,
    IndexReport,
    RunEntry,
    RunFile,
    Summarise,
    compare,
    load_annotations,
    store_annotations,
    validated_annotations,
)
from recordings.catalogue.run_store import RunStore, Search, SummarisedRun
from recordings.catalogue.trash import TrashedRun
from recordings.errors import NotFoundError, RecordingError, StorageError
from recordings.file_operations import storage_errors
from recordings.integrity.verify import verify
from recordings.mcap.layout import NANOSECONDS
from recordings.mcap.reader import RunReader

__all__ = ["Catalogue", "RunEntry", "data_folder"]

SUFFIX = ".mcap"
RUN_ID = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9_(). -]{0,98}[A-Za-z0-9_)-])?")
"""A valid run id, which is the file's name without suffix; no valid id leads out of the data folder."""
WRITE_INTERVAL = 1.0
"""Seconds for which summaries are collected before they are written: one transaction each would cost more."""
DATA_VARIABLE = "RIG_DATA"
DEFAULT_FOLDER = "data"


def data_folder(setting: str = "") -> Path:
    """Return the data folder.

    Parameters
    ----------
    setting : str
        ``folder`` of the rig's ``[storage]``; empty for the environment's RIG_DATA, or else ./data.
    """
    return Path(setting or os.environ.get(DATA_VARIABLE, "") or DEFAULT_FOLDER).expanduser()


class Catalogue:
    """The runs of a data folder; the files are authoritative, a database caches what was read from them.

    Safe for several threads, and for several processes on one folder.

    Parameters
    ----------
    folder : Path
        The data folder; it need not exist before the first run.
    url : str
        SQLAlchemy URL of the database; empty for the environment's RIG_CATALOGUE, or else SQLite in the folder.
    """

    def __init__(self, folder: Path, url: str = "") -> None:
        self.folder = folder
        self.url = url
        self._store = RunStore(folder, Database(folder, url))
        self._lock = threading.Lock()
        self._cache: dict[str, CachedRun] = {}

    def __reduce__(self) -> tuple[type["Catalogue"], tuple[Path, str]]:
        """Return the class and its arguments: another process opens the catalogue again."""
        return Catalogue, (self.folder, self.url)

    def runs(self) -> list[RunEntry]:
        """Return all runs, newest first; an unreadable file is listed with its fault.

        Raises
        ------
        StorageError
            If the folder or the database cannot be read. A folder that does not exist yet has no runs.
        """
        files = self._files()
        entries = self._entries(files, None) if files else []
        with self._lock:
            self._cache = {run_id: cached for run_id, cached in self._cache.items() if run_id in files}
        return sorted(entries, key=lambda entry: (entry.started_ns, entry.id), reverse=True)

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError if there is none."""
        path = self.path(run_id)
        file = RunFile.from_path(path)
        entries = [] if file is None else self._entries({run_id: file}, run_id)
        if not entries:
            raise NotFoundError(f"run {run_id!r}: there is no such run in {self.folder}")
        return entries[0]

    def search(self, search: Search) -> list[RunEntry]:
        """Return the runs that match a search, newest first.

        Speeds, findings and markers are those of the runs that `index` has summarised.
        """
        present = {entry.id for entry in self.runs()}
        return [stored.entry for run_id, stored in self._store.entries(search).items() if run_id in present]

    def annotate(self, run_id: str, *, remark: str | None = None, tags: Iterable[str] | None = None) -> RunEntry:
        """Change the remark or the tags of a run and return its entry; they are stored in a file beside it.

        Parameters
        ----------
        run_id : str
            The run.
        remark : str or None
            New remark; None leaves it.
        tags : iterable of str or None
            All its tags; None leaves them.

        Raises
        ------
        NotFoundError
            If there is no such run.
        AnnotationError
            If a tag or the remark is not valid.
        StorageError
            If they cannot be stored.
        """
        path = self.path(run_id)
        with self._store.writer_lock():  # no other process may change the file between reading and writing it
            before = load_annotations(path)
            changed = validated_annotations(
                before.remark if remark is None else remark, before.tags if tags is None else tuple(tags)
            )
            store_annotations(path, changed)
        return self.run(run_id)

    def index(
        self, summarise: Summarise, *, verify_files: bool = False, on_status: Callable[[str], object] = str
    ) -> IndexReport:
        """Update the catalogue from the files, and summarise the runs that have no summary yet.

        Parameters
        ----------
        summarise : callable
            Returns the summary of a reader's run.
        verify_files : bool
            Whether to verify the files that were not verified since they changed.
        on_status : callable
            Called with a line of text before each run that is read or verified.

        Raises
        ------
        StorageError
            If the folder or the database cannot be read or written.
        """
        before = self._store.entries()
        present = {entry.id: entry for entry in self.runs()}
        report = compare(before, present)
        self._store.delete_runs(list(report.missing))
        runs = {run_id: stored for run_id, stored in self._store.entries().items() if run_id in present}
        self._summarise([stored.entry for stored in runs.values() if not stored.is_summarised], summarise, on_status)
        for run_id, stored in runs.items():
            if verify_files and not stored.entry.verdict:
                on_status(f"verifying {run_id}")
                verdict = UNREADABLE
                with suppress(RecordingError):
                    verdict = verify(stored.entry.path).verdict.value
                self._store.store_verdict(run_id, verdict)
        return report

    def store_verdict(self, run_id: str, verdict: str) -> None:
        """Store the `Verdict` of a verification of a run; NotFoundError, StorageError."""
        self._store.store_verdict(self.run(run_id).id, verdict)

    def path(self, run_id: str) -> Path:
        """Return the file of a run.

        Raises
        ------
        NotFoundError
            If there is no such run, or the id is not valid. Invalid ids never reach the file system.
        StorageError
            If the folder cannot be read.
        """
        if RUN_ID.fullmatch(run_id):
            path = self.folder / f"{run_id}{SUFFIX}"
            with storage_errors(path, "cannot be read"):
                if path.is_file():
                    return path
        raise NotFoundError(f"run {run_id[:120]!r}: there is no such run in {self.folder}")

    def path_for(self, run_id: str) -> Path:
        """Return the path that a run of this id has or would have; NotFoundError if the id is not valid."""
        if not RUN_ID.fullmatch(run_id):
            raise NotFoundError(f"run {run_id[:120]!r}: not a valid run id")
        return self.folder / f"{run_id}{SUFFIX}"

    def move_to_trash(self, run_id: str) -> Path:
        """Move a run into the folder `trash` of the data folder; return its new path. NotFoundError, StorageError."""
        path = trash.move_to_trash(self.path(run_id))
        with suppress(StorageError):  # on a full disk the row stays; runs without a file are not listed
            self._store.delete_runs([run_id])
        return path

    def trashed_runs(self) -> list[TrashedRun]:
        """Return the runs in the trash, sorted by name; StorageError if it cannot be read."""
        return list(trash.list_trash(self.folder, SUFFIX))

    def restore(self, name: str, run_id: str = "") -> RunEntry:
        """Move a run out of the trash, and return its entry.

        Parameters
        ----------
        name : str
            Its name in the trash.
        run_id : str
            Its new id; empty for its name in the trash.

        Raises
        ------
        NotFoundError
            If the trash has no run of this name, or the id is not valid.
        RunExistsError, StorageError
            If a run of this id exists, or the run cannot be moved.
        """
        path = self.path_for(run_id or name)
        trash.restore(self.folder, name, path)
        return self.run(path.stem)

    def new_run(self, rig_name: str, started_ns: int) -> tuple[str, Path]:
        """Return an unused run id and the path for its file; the folder is created if missing.

        Parameters
        ----------
        rig_name : str
            Name of the rig.
        started_ns : int
            Start of the run, ns since 1970; the id shows it in the computer's time zone.

        Raises
        ------
        StorageError
            If the folder cannot be created.
        """
        with storage_errors(self.folder, "the data folder cannot be created"):
            self.folder.mkdir(parents=True, exist_ok=True)
        started = datetime.fromtimestamp(started_ns // NANOSECONDS, UTC).astimezone()
        name = re.sub(r"[^a-z0-9]+", "-", rig_name.lower()).strip("-")[:40].strip("-") or "rig"
        first = f"{started:%Y-%m-%dT%H-%M-%S}-{name}"
        paths = (self.folder / f"{first}{'' if k == 1 else f'-{k}'}{SUFFIX}" for k in count(1))
        path = next(path for path in paths if not path.exists())
        return path.stem, path

    def load_cached(self, run_id: str, name: str) -> dict[str, Any] | None:
        """Return a cached result of a run; None if there is none for the file in its present state."""
        file = RunFile.from_path(self.path(run_id))
        with suppress(StorageError):  # the result can be computed again
            return None if file is None else self._store.load_cached(run_id, name, file.size, file.modified_ns)
        return None

    def store_cached(self, run_id: str, name: str, result: dict[str, Any]) -> None:
        """Cache a result of a run until its file changes."""
        file = RunFile.from_path(self.path(run_id))
        with suppress(StorageError):
            if file is not None:
                self._store.store_cached(run_id, name, file.size, file.modified_ns, result)

    def _files(self) -> dict[str, RunFile]:
        """Return the run files of the folder by id."""
        with storage_errors(self.folder, "the data folder cannot be read"):
            try:
                names = os.listdir(self.folder)  # noqa: PTH208 - ten thousand Path objects would cost as much as the rest
            except FileNotFoundError:
                return {}
        stems = (name.removesuffix(SUFFIX) for name in names if name.endswith(SUFFIX))
        annotated = {name.removesuffix(ANNOTATIONS_SUFFIX) for name in names if name.endswith(ANNOTATIONS_SUFFIX)}
        paths = (self.folder / f"{stem}{SUFFIX}" for stem in stems if RUN_ID.fullmatch(stem))
        files = ((path.stem, RunFile.from_path(path, may_have_annotations=path.stem in annotated)) for path in paths)
        return {stem: file for stem, file in files if file is not None}

    def _entries(self, files: dict[str, RunFile], only: str | None) -> list[RunEntry]:
        """Return the entries of files: from memory, else from the database, else from the files themselves.

        `only` is the id of the run when `files` holds just one, so that one row is read instead of all.
        """
        revision = self._store.revision()
        with self._lock:
            cached = {run_id: self._cache.get(run_id) for run_id in files}
        entries = {
            run_id: run.entry
            for run_id, run in cached.items()
            if run is not None and run.is_valid(files[run_id], revision)
        }
        if len(entries) < len(files):
            missing = {run_id: file for run_id, file in files.items() if run_id not in entries}
            found = self._read_entries(files, missing, only)
            with self._lock:
                self._cache |= found
            entries |= {run_id: run.entry for run_id, run in found.items()}
        return list(entries.values())

    def _read_entries(
        self, files: dict[str, RunFile], missing: dict[str, RunFile], only: str | None
    ) -> dict[str, CachedRun]:
        """Return entries that are not in memory, and store in the database what had to be read from files."""
        stored = self._store.entries(run_id=only or "")
        unread = [
            run_id for run_id, file in missing.items() if run_id not in stored or not stored[run_id].describes(file)
        ]
        fresh = {run_id: CachedRun.from_file(files[run_id]) for run_id in unread}
        ended = [run_id for run_id in unread if not fresh[run_id].is_growing]
        annotated = [
            run_id
            for run_id in files
            if (run_id in ended and files[run_id].annotations_modified_ns)
            or (run_id in stored and stored[run_id].annotations_modified_ns != files[run_id].annotations_modified_ns)
        ]
        try:
            self._store.store_entries([fresh[run_id].entry for run_id in ended])
            for run_id in annotated:
                file = files[run_id]
                self._store.annotate(run_id, load_annotations(file.path), file.annotations_modified_ns)
            if ended or annotated:
                stored = self._store.entries(run_id=only or "")
        except StorageError:  # a full disk: nothing can be stored, but the files can still be read
            fresh |= {run_id: CachedRun.from_file(files[run_id]) for run_id in annotated if run_id not in fresh}
            stored = {run_id: run for run_id, run in stored.items() if run_id not in fresh}
        entries = {run_id: stored[run_id] for run_id in missing if run_id in stored}
        return entries | {run_id: run for run_id, run in fresh.items() if run_id not in entries or run.is_growing}

    def _summarise(self, entries: Iterable[RunEntry], summarise: Summarise, on_status: Callable[[str], object]) -> None:
        """Store the summaries and markers of runs; a run that cannot be read has none."""
        summarised: list[SummarisedRun] = []
        written_at = time.monotonic()
        try:
            for entry in entries:
                if entry.header is None:
                    continue
                on_status(f"reading {entry.id}")
                with suppress(RecordingError), RunReader(entry.path) as reader:
                    summarised.append((entry, summarise(reader), reader.markers()))
                if time.monotonic() > written_at + WRITE_INTERVAL:
                    self._store.store_summaries(summarised)
                    summarised, written_at = [], time.monotonic()
        finally:
            self._store.store_summaries(summarised)

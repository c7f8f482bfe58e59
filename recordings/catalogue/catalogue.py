"""The runs of a data folder."""

import os
import re
import shutil
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

from recordings.catalogue import annotations, trash
from recordings.catalogue.database import Database
from recordings.catalogue.entry import RunEntry
from recordings.catalogue.indexing import CachedRun, IndexReport, Summarise, compare, holds, verdict_of
from recordings.catalogue.run_file import RunFile
from recordings.catalogue.run_store import RunStore
from recordings.catalogue.run_summary import SummarisedRun
from recordings.catalogue.search import Search
from recordings.catalogue.trash import TrashedRun
from recordings.errors import NotFoundError, RecordingError, StorageError
from recordings.mcap.layout import NANOSECONDS
from recordings.mcap.reader import RunReader

__all__ = ["Catalogue", "RunEntry", "data_folder"]

SUFFIX = ".mcap"
RUN_ID = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9_(). -]{0,98}[A-Za-z0-9_)-])?")
"""What the id of a run, the name of its file without suffix, may look like: nothing that leads out of the folder."""
WRITING_INTERVAL = 1.0
"""Seconds for which summaries are gathered before they are written: a transaction for each costs more than they do."""
DATA_VARIABLE = "RIG_DATA"
DEFAULT_FOLDER = "data"


def data_folder(setting: str = "") -> Path:
    """Return the folder where runs go.

    Parameters
    ----------
    setting : str
        ``folder`` of the rig's ``[storage]``; empty for the environment's RIG_DATA, or else ./data.
    """
    return Path(setting or os.environ.get(DATA_VARIABLE, "") or DEFAULT_FOLDER).expanduser()


class Catalogue:
    """The runs of a data folder: the files are the truth, what is known of them is kept in a database.

    It may be used from several threads, and on one folder by several processes.

    Parameters
    ----------
    folder : Path
        The data folder; it need not exist before the first run.
    url : str
        Database as SQLAlchemy takes it; empty for the environment's RIG_CATALOGUE, or else SQLite in the folder.
    """

    def __init__(self, folder: Path, url: str = "") -> None:
        self.folder = folder
        self.url = url
        self._store = RunStore(folder, Database(folder, url))
        self._lock = threading.Lock()
        self._known: dict[str, CachedRun] = {}

    def runs(self) -> list[RunEntry]:
        """Return all runs, newest first; a file that cannot be read is listed with what is wrong with it.

        Raises
        ------
        StorageError
            Where the folder or the database cannot be read. A folder that does not exist yet holds no runs.
        """
        files = self._files()
        entries = self._looked_up(files, None) if files else []
        with self._lock:
            self._known = {run_id: known for run_id, known in self._known.items() if run_id in files}
        return sorted(entries, key=lambda entry: (entry.started_ns, entry.id), reverse=True)

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none."""
        path = self.path(run_id)
        file = RunFile.seen(path)
        entries = [] if file is None else self._looked_up({run_id: file}, run_id)
        if not entries:
            raise NotFoundError(f"run {run_id!r}: there is no such run in {self.folder}")
        return entries[0]

    def search(self, search: Search) -> list[RunEntry]:
        """Return the runs that a search asks for, newest first.

        Speeds and findings are those of the runs that `index` has summed up.
        """
        present = {entry.id for entry in self.runs()}
        return [kept.entry for run_id, kept in self._store.entries(search).items() if run_id in present]

    def annotate(self, run_id: str, *, remark: str | None = None, tags: Iterable[str] | None = None) -> RunEntry:
        """Give a run other words or tags; they are kept in a file beside it.

        Parameters
        ----------
        run_id : str
            The run.
        remark : str or None
            Words on it; None leaves them.
        tags : iterable of str or None
            All its tags; None leaves them.

        Raises
        ------
        NotFoundError
            Where there is no such run.
        ValueError
            Where a tag or the remark cannot be one.
        StorageError
            Where they cannot be kept.
        """
        path = self.path(run_id)
        with self._store.turn():  # what is read and written again must not change in between
            before = annotations.load(path)
            words = annotations.checked(
                before.remark if remark is None else remark, before.tags if tags is None else tuple(tags)
            )
            annotations.store(path, words)
        return self.run(run_id)

    def index(
        self, summarise: Summarise, *, verify_files: bool = False, on_status: Callable[[str], object] = str
    ) -> IndexReport:
        """Bring what is kept up to date with the files, and sum up the runs that have not been.

        Parameters
        ----------
        summarise : callable
            Returns the summary of a reader's run.
        verify_files : bool
            Whether to verify the files that have not been since they changed.
        on_status : callable
            Called with a line of text before each run that is read or verified.

        Raises
        ------
        StorageError
            Where the folder or the database cannot be read or written.
        """
        before = self._store.entries()
        present = {entry.id: entry for entry in self.runs()}
        report = compare(before, present)
        self._store.forget(list(report.vanished))
        kept = {run_id: each for run_id, each in self._store.entries().items() if run_id in present}
        self._summarise([each.entry for each in kept.values() if not each.is_summarised], summarise, on_status)
        for run_id, each in kept.items():
            if verify_files and not each.entry.verdict:
                on_status(f"verifying {run_id}")
                self._store.store_verdict(run_id, verdict_of(each.entry.path))
        return report

    def store_verdict(self, run_id: str, verdict: str) -> None:
        """Keep what a verification of a run came to (a `Verdict`). NotFoundError, StorageError."""
        self._store.store_verdict(self.run(run_id).id, verdict)

    def path(self, run_id: str) -> Path:
        """Return the file of a run.

        Raises
        ------
        NotFoundError
            Where there is no such run, or the id is none. Only ids that cannot lead out of the folder reach the disk.
        StorageError
            Where the folder cannot be read.
        """
        if RUN_ID.fullmatch(run_id):
            path = self.folder / f"{run_id}{SUFFIX}"
            try:
                if path.is_file():
                    return path
            except OSError as error:
                raise StorageError(f"{path}: cannot be read: {error.strerror or error}") from error
        raise NotFoundError(f"run {run_id[:120]!r}: there is no such run in {self.folder}")

    def path_for(self, run_id: str) -> Path:
        """Return where the file of a run of this id belongs, whether it is there or not; NotFoundError for no id."""
        if not RUN_ID.fullmatch(run_id):
            raise NotFoundError(f"run {run_id[:120]!r}: no run can have this id")
        return self.folder / f"{run_id}{SUFFIX}"

    def move_to_trash(self, run_id: str) -> Path:
        """Move a run into the folder `trash` of the data folder; return where it is. NotFoundError, StorageError."""
        place = trash.move_to_trash(self.path(run_id))
        with suppress(StorageError):  # a full disk: that it has gone is seen by whoever looks
            self._store.forget([run_id])
        return place

    def trashed_runs(self) -> list[TrashedRun]:
        """Return what lies in the trash, by name. StorageError where it cannot be read."""
        return list(trash.listed(self.folder, SUFFIX))

    def restore(self, name: str, run_id: str = "") -> RunEntry:
        """Move a run out of the trash again, and return it.

        Parameters
        ----------
        name : str
            Its name there.
        run_id : str
            What it is to be called; empty: its name in the trash.

        Raises
        ------
        NotFoundError
            There is none of this name, or no run can be called so.
        RunExistsError, StorageError
            There is a run of this id already, or it cannot be moved.
        """
        place = self.path_for(run_id or name)
        trash.restore(self.folder, name, place)
        return self.run(place.stem)

    def new_run(self, rig_name: str, started_ns: int) -> tuple[str, Path]:
        """Return an id that is free, and the path for its file; the folder is made where it is missing.

        Parameters
        ----------
        rig_name : str
            Name of the rig.
        started_ns : int
            When the run begins, ns since 1970; the id shows it as the computer's own clock does.

        Raises
        ------
        StorageError
            Where the folder cannot be made.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StorageError(f"{self.folder}: the data folder cannot be made: {error.strerror or error}") from error
        started = datetime.fromtimestamp(started_ns // NANOSECONDS, UTC).astimezone()
        name = re.sub(r"[^a-z0-9]+", "-", rig_name.lower()).strip("-")[:40].strip("-") or "rig"
        first = f"{started:%Y-%m-%dT%H-%M-%S}-{name}"
        for number in count(1):
            run_id = first if number == 1 else f"{first}-{number}"
            path = self.folder / f"{run_id}{SUFFIX}"
            if not path.exists():
                break
        return run_id, path

    def free_bytes(self) -> int:
        """Return the room left on the disk of the folder, bytes.

        Raises
        ------
        StorageError
            Where that cannot be found out.
        """
        folder = self.folder.absolute()
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        try:
            return shutil.disk_usage(folder).free
        except OSError as error:
            raise StorageError(f"{folder}: free room cannot be found out: {error.strerror or error}") from error

    def load_cached(self, run_id: str, name: str) -> dict[str, Any] | None:
        """Return a document kept for a run, or None where there is none for its file as it is now."""
        file = RunFile.seen(self.path(run_id))
        with suppress(StorageError):  # nothing depends on it: it is computed again
            return None if file is None else self._store.load_cached(run_id, name, file.size, file.changed_ns)
        return None

    def store_cached(self, run_id: str, name: str, document: dict[str, Any]) -> None:
        """Keep a document for a run as long as its file does not change."""
        file = RunFile.seen(self.path(run_id))
        with suppress(StorageError):
            if file is not None:
                self._store.store_cached(run_id, name, file.size, file.changed_ns, document)

    def _files(self) -> dict[str, RunFile]:
        """Return the files of runs by id."""
        try:
            names = os.listdir(self.folder)  # noqa: PTH208 - ten thousand paths would cost as much as the rest
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise StorageError(f"{self.folder}: the data folder cannot be read: {error.strerror or error}") from error
        stems = (name.removesuffix(SUFFIX) for name in names if name.endswith(SUFFIX))
        annotated = {name.removesuffix(annotations.SUFFIX) for name in names if name.endswith(annotations.SUFFIX)}
        paths = (self.folder / f"{stem}{SUFFIX}" for stem in stems if RUN_ID.fullmatch(stem))
        files = ((path.stem, RunFile.seen(path, may_have_words=path.stem in annotated)) for path in paths)
        return {stem: file for stem, file in files if file is not None}

    def _looked_up(self, files: dict[str, RunFile], only: str | None) -> list[RunEntry]:
        """Return the entries of files: from memory, else from the database, else from the files themselves."""
        revision = self._store.revision()
        with self._lock:
            known = {run_id: self._known.get(run_id) for run_id in files}
        served = {
            run_id: each.entry
            for run_id, each in known.items()
            if each is not None and each.serves(files[run_id], revision)
        }
        if len(served) < len(files):
            kept = self._store.entries(run_id=only or "")
            unread = [run_id for run_id in files if run_id not in served and not holds(kept.get(run_id), files[run_id])]
            fresh = {run_id: CachedRun.read(files[run_id]) for run_id in unread}
            settled = [run_id for run_id in unread if not fresh[run_id].is_growing]
            words = [
                run_id
                for run_id in files
                if (run_id in settled and files[run_id].remarked_ns)
                or (run_id in kept and kept[run_id].remarked_ns != files[run_id].remarked_ns)
            ]
            try:
                self._keep([fresh[run_id].entry for run_id in settled], [files[run_id] for run_id in words])
                if settled or words:
                    kept = self._store.entries(run_id=only or "")
            except StorageError:  # a full disk: what is known cannot be kept, but the files tell it all the same
                fresh |= {run_id: CachedRun.read(files[run_id]) for run_id in words if run_id not in fresh}
                kept = {run_id: each for run_id, each in kept.items() if run_id not in fresh}
            found = {run_id: CachedRun.of(kept[run_id]) for run_id in files if run_id in kept and run_id not in served}
            found |= {run_id: each for run_id, each in fresh.items() if run_id not in found or each.is_growing}
            with self._lock:
                self._known |= found
            served |= {run_id: each.entry for run_id, each in found.items()}
        return list(served.values())

    def _keep(self, entries: list[RunEntry], annotated: list[RunFile]) -> None:
        """Keep what files have told, and what is said of runs."""
        self._store.put(entries)
        for file in annotated:
            self._store.annotate(file.path.stem, annotations.load(file.path), file.remarked_ns)

    def _summarise(self, entries: Iterable[RunEntry], summarise: Summarise, on_status: Callable[[str], object]) -> None:
        """Keep what a search needs of runs' summaries; a run that cannot be read has none."""
        found: list[SummarisedRun] = []
        written_at = time.monotonic()
        try:
            for entry in entries:
                if entry.header is None:
                    continue
                on_status(f"reading {entry.id}")
                with suppress(RecordingError), RunReader(entry.path) as reader:
                    found.append(SummarisedRun(entry, summarise(reader), reader.markers()))
                if time.monotonic() > written_at + WRITING_INTERVAL:
                    self._store.summarise(found)
                    found, written_at = [], time.monotonic()
        finally:
            self._store.summarise(found)

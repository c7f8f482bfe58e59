"""The runs of a data folder."""

import os
import re
import shutil
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any

from analysis.run import RunHeader
from recordings.cache import DocumentCache
from recordings.container import is_ended
from recordings.errors import NotFoundError, RecordingError, StorageError
from recordings.layout import NANOSECONDS
from recordings.reader import RunReader

SUFFIX = ".mcap"
RUN_ID = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9_(). -]{0,98}[A-Za-z0-9_)-])?")
"""What the id of a run, the name of its file without suffix, may look like: nothing that leads out of the folder."""
READING_SHARE = 20
"""A file that is being written is read again after so many times as long as that took."""
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


@dataclass(frozen=True, slots=True)
class RunEntry:
    """A run as the catalogue lists it.

    Parameters
    ----------
    id : str
        The run's id.
    path : Path
        Its file.
    size : int
        Size of the file, bytes.
    changed_ns : int
        When the file was last written to, ns since 1970.
    header : RunHeader or None
        What was known when it started; None where the file cannot be read.
    duration : float
        Sample time, s.
    samples : int
        Samples per channel.
    is_complete : bool
        Whether it was finished properly.
    is_gap_free : bool
        Whether it is one segment without a loss.
    fault : str
        What is wrong with the file, for the operator; empty where all is well.
    """

    id: str
    path: Path
    size: int
    changed_ns: int
    header: RunHeader | None = None
    duration: float = 0.0
    samples: int = 0
    is_complete: bool = False
    is_gap_free: bool = False
    fault: str = ""

    @property
    def started_ns(self) -> int:
        """When the run began, ns since 1970; the file's last change where that cannot be read."""
        return self.changed_ns if self.header is None else self.header.started_ns


class Catalogue:
    """The runs of a data folder, found by looking into it; it may be used from several threads.

    Parameters
    ----------
    folder : Path
        The data folder; it need not exist before the first run.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._documents = DocumentCache(folder)
        self._lock = threading.Lock()
        self._kept: dict[str, _Kept] = {}

    def runs(self) -> list[RunEntry]:
        """Return all runs, newest first; a file that cannot be read is listed with what is wrong with it.

        Raises
        ------
        StorageError
            Where the folder cannot be read. One that does not exist yet holds no runs.
        """
        entries = {entry.id: entry for entry in (self._entry(path) for path in self._files()) if entry is not None}
        with self._lock:
            self._kept = {run_id: kept for run_id, kept in self._kept.items() if run_id in entries}
        return sorted(entries.values(), key=lambda entry: (entry.started_ns, entry.id), reverse=True)

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none."""
        entry = self._entry(self.path(run_id))
        if entry is None:
            raise NotFoundError(f"run {run_id!r}: there is no such run in {self.folder}")
        return entry

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

    def load_document(self, run_id: str, name: str) -> dict[str, Any] | None:
        """Return a document kept for a run, or None where there is none for its file as it is now."""
        return self._documents.load(self.path(run_id), name)

    def store_document(self, run_id: str, name: str, document: dict[str, Any]) -> None:
        """Keep a document for a run as long as its file does not change."""
        self._documents.store(self.path(run_id), name, document)

    def _files(self) -> Iterator[Path]:
        try:
            paths = list(self.folder.iterdir())
        except FileNotFoundError:
            return
        except OSError as error:
            raise StorageError(f"{self.folder}: the data folder cannot be read: {error.strerror or error}") from error
        yield from (path for path in paths if path.suffix == SUFFIX and RUN_ID.fullmatch(path.stem))

    def _entry(self, path: Path) -> RunEntry | None:
        """Return the entry of a file, from memory where nothing speaks against it; None where it is gone or no file."""
        try:
            status = path.stat()
            if not path.is_file():
                return None
        except OSError:
            return None
        with self._lock:
            kept = self._kept.get(path.stem)
        if kept is not None and kept.serves(path, status.st_size, status.st_mtime_ns):
            return kept.entry
        begun = time.monotonic()
        entry = RunEntry(path.stem, path, status.st_size, status.st_mtime_ns)
        try:
            with RunReader(path) as reader:
                entry = _read_entry(entry, reader)
        except RecordingError as error:
            entry = replace(entry, fault=str(error))
        ended = time.monotonic()
        with self._lock:
            self._kept[path.stem] = _Kept(entry, again_at=ended + READING_SHARE * (ended - begun))
        return entry


@dataclass(frozen=True, slots=True)
class _Kept:
    """An entry and when it is worth reading its file again while that grows."""

    entry: RunEntry
    again_at: float

    def serves(self, path: Path, size: int, changed_ns: int) -> bool:
        """Whether the entry still tells of the file, or nearly so where it is being written and long to read."""
        if (self.entry.size, self.entry.changed_ns) == (size, changed_ns):
            return True
        is_growing = not self.entry.is_complete and self.entry.header is not None and size >= self.entry.size
        return is_growing and time.monotonic() < self.again_at and not is_ended(path)


def _read_entry(entry: RunEntry, reader: RunReader) -> RunEntry:
    return replace(
        entry,
        header=reader.header,
        duration=reader.duration,
        samples=reader.n_samples,
        is_complete=reader.is_complete,
        is_gap_free=reader.is_gap_free,
        fault="" if reader.is_complete else "not finished: it is still being written, or its writer was ended by force",
    )

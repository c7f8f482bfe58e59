"""A recording that is copied into the data folder: written to a temporary file, verified, then moved to its path."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

from recordings.errors import DamagedError
from recordings.file_operations import move_without_overwriting, run_exists_error, storage_errors
from recordings.integrity.verify import verify


class IncomingRun:
    """A temporary file in the data folder that becomes a run with `commit`; `discard` removes it otherwise.

    Parameters
    ----------
    path : Path
        The run's future path; its folder is created if missing.

    Raises
    ------
    RunExistsError
        If there is a file at the path.
    StorageError
        If the folder cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        if path.exists():
            raise run_exists_error(path)
        with storage_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=".part")
        self.temporary = Path(name)
        self._file = os.fdopen(handle, "wb")

    def write(self, data: bytes) -> None:
        """Append data; StorageError if the disk is full or fails."""
        with storage_errors(self._path):
            self._file.write(data)

    def close(self) -> None:
        """Flush the data to the disk and close the file; StorageError if the disk is full or fails."""
        with storage_errors(self._path):
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()

    def commit(self) -> None:
        """Move the file to the run's path, never over another file; RunExistsError, StorageError."""
        move_without_overwriting(self.temporary, self._path)

    def discard(self) -> None:
        """Remove the temporary file; no effect after `commit`."""
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            self.temporary.unlink(missing_ok=True)


def require_intact(path: Path) -> None:
    """Raise DamagedError with all faults if a file is not a complete, intact recording."""
    faults = verify(path).faults
    if faults:
        raise DamagedError("not an intact recording: " + "; ".join(f"{fault.where}: {fault.what}" for fault in faults))

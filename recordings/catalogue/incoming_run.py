"""A recording that comes from elsewhere: written aside, looked through, and only then given its place."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

from recordings.atomic_file import replace_with_retry
from recordings.errors import DamagedError, RunExistsError, StorageError
from recordings.integrity.verify import verify


class IncomingRun:
    """A file that is on its way in; nothing is left of it unless it was settled.

    Parameters
    ----------
    place : Path
        Where it is to lie; its folder is made where it is missing.

    Raises
    ------
    RunExistsError
        There is a file already.
    StorageError
        Nothing can be written there.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        if place.exists():
            raise RunExistsError(f"{place.name}: there is such a run already")
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=place.parent, prefix=f".{place.stem}.", suffix=".part")
        except OSError as error:
            raise StorageError(f"{place}: cannot be written: {error.strerror or error}") from error
        self.temporary = Path(name)
        self._file = os.fdopen(handle, "wb")

    def write(self, portion: bytes) -> None:
        """Write a further portion; StorageError where the disk takes no more."""
        try:
            self._file.write(portion)
        except OSError as error:
            raise StorageError(f"{self._place}: cannot be written: {error.strerror or error}") from error

    def close(self) -> None:
        """End the writing; StorageError where the disk takes no more."""
        try:
            self._file.flush()
            os.fsync(self._file.fileno())
            self._file.close()
        except OSError as error:
            raise StorageError(f"{self._place}: cannot be written: {error.strerror or error}") from error

    def commit(self) -> None:
        """Give the file its place; never in place of another. RunExistsError, StorageError."""
        move_without_overwriting(self.temporary, self._place)

    def discard(self) -> None:
        """Leave nothing behind; harmless when settled."""
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            self.temporary.unlink(missing_ok=True)


def move_without_overwriting(temporary: Path, place: Path) -> None:
    """Give a finished file its place in the data folder; never in place of another. RunExistsError, StorageError."""
    try:
        place.open("xb").close()
    except FileExistsError as error:
        raise RunExistsError(f"{place.name}: there is such a run already") from error
    except OSError as error:
        raise StorageError(f"{place}: cannot be written: {error.strerror or error}") from error
    try:
        replace_with_retry(temporary, place)
    except OSError as error:
        place.unlink(missing_ok=True)
        raise StorageError(f"{place}: cannot be written: {error.strerror or error}") from error


def require_sound(temporary: Path) -> None:
    """Raise DamagedError with what is wrong where a file is no whole recording."""
    found = verify(temporary)
    if found.faults:
        raise DamagedError("no whole recording: " + "; ".join(f"{fault.where}: {fault.what}" for fault in found.faults))

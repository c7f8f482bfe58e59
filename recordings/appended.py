"""A new file that is only appended to."""

import io
from contextlib import suppress
from pathlib import Path

from recordings.errors import StorageError


class AppendedFile:
    """A new file without a buffer of its own, that knows up to where it is whole.

    Parameters
    ----------
    path : Path
        The file; it must not exist, its folder must.

    Raises
    ------
    StorageError
        Where it cannot be created.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = io.FileIO(path, "xb")
        except FileExistsError as error:
            raise StorageError(f"{path}: exists already; a run is never written over another") from error
        except FileNotFoundError as error:
            raise StorageError(f"{path}: cannot be created: there is no folder {path.parent}") from error
        except OSError as error:
            raise StorageError(f"{path}: cannot be created: {error.strerror or error}") from error
        self._path = path
        self._length = 0
        self._settled = 0

    @property
    def length(self) -> int:
        """Bytes written."""
        return self._length

    def write(self, data: bytes) -> None:
        """Append all of the data; OSError where the disk is full."""
        left = memoryview(data)
        while left:
            left = left[self._file.write(left) :]
        self._length += len(data)

    def settle(self) -> None:
        """Remember that the file is whole up to here."""
        self._settled = self._length

    def cut_back(self) -> None:
        """Drop what was written since the file was last whole, and close; where nothing is whole, there is no file."""
        with suppress(
            OSError
        ):  # the disk is gone: what it holds is all there is, and readers find the last whole chunk
            self._file.truncate(self._settled)
        with suppress(OSError):
            self._file.close()
        if self._settled == 0:
            with suppress(OSError):
                self._path.unlink()

    def close(self) -> None:
        """Close the file; OSError where the system only now finds that it cannot keep it."""
        self._file.close()

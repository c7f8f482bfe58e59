"""A new file that is only appended to."""

import io
import os
import threading
from contextlib import suppress
from pathlib import Path

from recordings.errors import StorageError

SYNC_INTERVAL = 1.0
"""Seconds between the moments at which what was written is made to survive a loss of power."""


ALLOCATION = 1 << 20
"""Bytes by which room is asked for ahead."""


class AppendedFile:
    """A new file without a buffer of its own, that knows up to where it is whole.

    Where the system can (POSIX), room on the disk is taken ahead of what is written, so that a file can still be
    finished when the disk has become full. Until it is closed it therefore ends in zeros.

    A thread of its own has the operating system bring what it holds to the disk every second: a pulled plug costs about
    so much of a run, and the writing thread need not wait for it.

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
        self._allocated = 0
        self._closing = threading.Event()
        self._syncer = threading.Thread(target=self._sync, name=f"sync {path.name}", daemon=True)
        self._syncer.start()

    @property
    def length(self) -> int:
        """Bytes written."""
        return self._length

    def write(self, data: bytes, reserve: int = 0) -> None:
        """Append all of the data, or nothing and raise OSError where the disk is full.

        Parameters
        ----------
        data : bytes
            What to append.
        reserve : int
            Bytes for which there must be room behind it.
        """
        self._allocate(self._length + len(data) + reserve)
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError:
            self._file.seek(self._length)
            raise
        self._length += len(data)

    def settle(self) -> None:
        """Remember that the file is whole up to here."""
        self._settled = self._length

    def cut_back(self) -> None:
        """Drop what was written since the file was last whole, and close; where nothing is whole, there is no file."""
        self._end_syncing()
        with suppress(OSError):  # the disk is gone: readers find the last whole chunk of what it holds
            self._file.truncate(self._settled)
        with suppress(OSError):
            self._file.close()
        if self._settled == 0:
            with suppress(OSError):
                self._path.unlink()

    def close(self) -> None:
        """Bring all to the disk and close the file; OSError where the system only now finds that it cannot keep it."""
        self._end_syncing()
        self._file.truncate(self._length)
        os.fsync(self._file.fileno())
        self._file.close()

    def _allocate(self, stop: int) -> None:
        """Make sure of the room up to a place in the file; OSError where there is none."""
        if stop <= self._allocated or not hasattr(os, "posix_fallocate"):  # Windows: the disk is full when it is
            return
        for wanted in (max(stop, self._allocated + ALLOCATION), stop):
            try:
                os.posix_fallocate(self._file.fileno(), self._allocated, wanted - self._allocated)
            except OSError:
                if wanted == stop:
                    raise
            else:
                self._allocated = wanted
                return

    def _end_syncing(self) -> None:
        self._closing.set()
        self._syncer.join()

    def _sync(self) -> None:
        synced = 0
        while not self._closing.wait(SYNC_INTERVAL):
            length = self._length
            if length > synced:
                with suppress(OSError):  # the next write or the close meets the same trouble and says so
                    os.fsync(self._file.fileno())
                synced = length

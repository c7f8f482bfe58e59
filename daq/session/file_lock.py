"""A file lock between processes: exclusive, released when its holder ends, with the holder's progress as text."""

import os
import sys
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

LOCKED_BYTE = 2**30  # offset: on Windows a locked byte cannot be read, so it lies beyond the text


class FileLock:
    """An exclusive lock on a file in which the holder writes its progress.

    Parameters
    ----------
    path : Path
        The file, which exists while a process holds or requests the lock. Its folder must exist.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._handle: int | None = None

    def try_acquire(self) -> bool:
        """Acquire the lock without waiting; return whether it is held. OSError where the file cannot be created."""
        handle = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            _lock(handle)
            is_current = os.fstat(handle).st_ino == self._path.stat().st_ino  # else the last holder has deleted it
        except OSError:
            is_current = False
        if not is_current:
            os.close(handle)
            return False
        self._handle = handle
        return True

    def write_progress(self, text: str) -> None:
        """Write the holder's progress for waiting processes, at most 40 bytes; nothing where the lock is not held."""
        if self._handle is not None:
            with suppress(OSError):  # a full disk
                os.lseek(self._handle, 0, os.SEEK_SET)
                os.write(self._handle, text.encode().ljust(40))

    def read_progress(self) -> str:
        """Return the progress last written by the holder; empty for none."""
        try:
            return self._path.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError):
            return ""

    def release(self) -> None:
        """Release the lock and delete its file; nothing where the lock is not held."""
        if self._handle is None:
            return
        if sys.platform != "win32":
            self._path.unlink(missing_ok=True)
        os.close(self._handle)
        self._handle = None
        if sys.platform == "win32":
            with suppress(OSError):  # another process has already acquired it
                self._path.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.release()


def _lock(handle: int) -> None:
    """Lock a file without waiting; OSError where another process holds the lock."""
    if sys.platform == "win32":
        os.lseek(handle, LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)

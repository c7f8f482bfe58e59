"""A claim on work that several processes may want done: held by one at a time, and given back when that one ends."""

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

BEYOND = 2**30  # bytes: Windows keeps others from reading what is locked, so that lies behind all that is written


class FileLock:
    """A file that is locked as long as the work goes on, with a word in it on how far that is.

    Parameters
    ----------
    path : Path
        The file; it is there as long as somebody holds or wants the claim. Its folder must be there.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._handle: int | None = None

    def take(self) -> bool:
        """Take the claim where nobody else holds it; return whether it is held. OSError where there can be none."""
        handle = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            _lock(handle)
            is_there = os.fstat(handle).st_ino == self._path.stat().st_ino  # else its last holder took it away
        except OSError:
            is_there = False
        if not is_there:
            os.close(handle)
            return False
        self._handle = handle
        return True

    def say(self, word: str) -> None:
        """Tell those who wait how far the work is."""
        if self._handle is not None:
            with suppress(OSError):  # a full disk
                os.lseek(self._handle, 0, os.SEEK_SET)
                os.write(self._handle, word.encode().ljust(40))

    def heard(self) -> str:
        """Return the last word of whoever holds the claim; empty where there is none."""
        try:
            return self._path.read_text(encoding="utf-8").strip()
        except (OSError, UnicodeDecodeError):
            return ""

    def give_back(self) -> None:
        """Let others have the claim; harmless where it is not held."""
        if self._handle is None:
            return
        if sys.platform != "win32":
            self._path.unlink(missing_ok=True)
        os.close(self._handle)
        self._handle = None
        if sys.platform == "win32":
            with suppress(OSError):  # somebody has it already
                self._path.unlink()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.give_back()


def _lock(handle: int) -> None:
    """Lock a file at once; OSError where somebody else has."""
    if sys.platform == "win32":
        os.lseek(handle, BEYOND, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)

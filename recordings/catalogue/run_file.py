"""A run's file as its folder shows it."""

import stat
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from recordings.catalogue import annotations


@dataclass(frozen=True, slots=True)
class RunFile:
    """A file as the folder shows it.

    Parameters
    ----------
    path : Path
        The file.
    size : int
        Bytes.
    changed_ns : int
        When it was last written to, ns since 1970.
    remarked_ns : int
        When the annotations beside it were last written to; 0 where there are none.
    """

    path: Path
    size: int
    changed_ns: int
    remarked_ns: int

    @classmethod
    def seen(cls, path: Path, *, may_have_words: bool = True) -> Self | None:
        """Return a file as the folder shows it; None where it is gone or no file."""
        try:
            status = path.stat()
        except OSError:
            return None
        if not stat.S_ISREG(status.st_mode):
            return None
        remarked_ns = 0
        if may_have_words:
            with suppress(OSError):
                remarked_ns = annotations.place_of(path).stat().st_mtime_ns
        return cls(path, status.st_size, status.st_mtime_ns, remarked_ns)

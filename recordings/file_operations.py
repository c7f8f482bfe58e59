"""File operations: atomic writes (a file is complete or absent, however the writing ends), and progress callbacks."""

import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

RETRY_DELAYS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # s between attempts to replace a file that another process reads


class Replaceable(Protocol):
    """A file that can be moved over another; a `Path`."""

    def replace(self, target: Path, /) -> object:
        """Move the file to the target, replacing what is there."""
        ...


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside the file; on success the temporary file replaces the file.

    If writing fails or is interrupted, the temporary file is removed and an existing file stays as it was.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        replace_with_retry(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def replace_with_retry(source: Replaceable, target: Path) -> None:
    """Move a file over the target, retrying for up to 1.6 s; OSError if it still fails.

    On Windows neither a file that another process has open nor a file it would replace can be moved. A virus scanner
    holds a new file for a moment, so PermissionError is retried.
    """
    for delay in RETRY_DELAYS:
        try:
            source.replace(target)
        except PermissionError:
            time.sleep(delay)
        else:
            return
    source.replace(target)


Progress = Callable[[float], None]
"""Called with the fraction done, 0 to 1."""


def ignore_progress(_fraction: float) -> None:
    """Do nothing: the default progress callback."""

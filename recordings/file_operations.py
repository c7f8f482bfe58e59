"""File operations: atomic writes, moves that never overwrite, free space, operating system errors, progress."""

import secrets
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from recordings.errors import RunExistsError, StorageError

RETRY_DELAYS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # s between attempts to replace a file that another process reads

Progress = Callable[[float], None]
"""Called with the fraction done, 0 to 1."""


def ignore_progress(_fraction: float) -> None:
    """Do nothing: the default progress callback."""


@contextmanager
def storage_errors(path: Path, problem: str = "cannot be written") -> Iterator[None]:
    """Raise OSError as StorageError with the path, the problem and the operating system's reason."""
    try:
        yield
    except OSError as error:
        raise StorageError(f"{path}: {problem}: {error.strerror or error}") from error


def free_bytes(folder: Path) -> int:
    """Return the free space on the disk of a folder that exists or will be created, bytes; StorageError if unknown."""
    existing = folder.absolute()
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    with storage_errors(existing, "free space cannot be determined"):
        return shutil.disk_usage(existing).free


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside the file; on success the temporary file replaces the file.

    If writing fails or is interrupted, the temporary file is removed and an existing file stays as it was: the file is
    complete or absent, however the writing ends.
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        yield temporary
        replace_with_retry(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def replace_with_retry(source: Path, target: Path) -> None:
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


def move_without_overwriting(source: Path, target: Path) -> None:
    """Move a complete run into the data folder, never over another file; RunExistsError, StorageError."""
    with storage_errors(target):
        try:
            target.open("xb").close()  # reserves the name, so that no other process can take it
        except FileExistsError as error:
            raise run_exists_error(target) from error
        try:
            replace_with_retry(source, target)
        except OSError:
            target.unlink(missing_ok=True)
            raise


def run_exists_error(path: Path) -> RunExistsError:
    """Return the error to raise for a run whose file exists already."""
    return RunExistsError(f"{path.name}: a run of this name exists already")

"""Files of other programs that were sent in, kept until they are imported: no name of theirs reaches the disk.

Files that are sent in: few at once, none too large or too slow, and nothing is left of what does not come whole.
"""

import secrets
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import Final

from anyio import CapacityLimiter, fail_after, to_thread
from fastapi import Request

from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from recordings.catalogue.incoming_run import IncomingRun
from recordings.errors import RunExistsError
from recordings.exchange.formats import IMPORT_FORMATS

MOST_KEPT: Final = 16
MOST_BYTES: Final = 2 * 1024**3  # of one file
MAX_NAME_LENGTH: Final = 200
RETENTION_TIME: Final = 3600.0  # s
ABANDONED_AFTER: Final = 24 * 3600.0  # s: what is so old is of a service that was ended by force


class UploadNotFoundError(LookupError):
    """There is no such upload."""


class UploadStoreFullError(RuntimeError):
    """Too many are kept."""


@dataclass(frozen=True, slots=True)
class Upload:
    """A file that was sent in.

    Parameters
    ----------
    id : str
        Its id, which cannot be guessed.
    name : str
        What its sender calls it.
    path : Path
        Where it lies; only the suffix is of its name.
    size : int
        Bytes.
    uploaded, expires : float
        Wall clock when it was there and when it is deleted, s since 1970.
    """

    id: str
    name: str
    path: Path
    size: int
    uploaded: float
    expires: float


def require_name(name: str) -> None:
    """Raise ValueError where a file cannot be called so: a plain name of a format that can be imported."""
    if not name.isprintable() or not 0 < len(name) <= MAX_NAME_LENGTH or set(name) & set("/\\:"):
        raise ValueError(f"name {name[:60]!r}: expected a file's name without its folders")
    if PurePath(name).suffix.lower() not in IMPORT_FORMATS:
        raise ValueError(f"name {name[-60:]!r}: expected one that ends with {', '.join(IMPORT_FORMATS)}")


class UploadStore:
    """Keeps uploads for a while; may be used from any thread.

    Parameters
    ----------
    folder : Path
        The data folder; they lie in `.rig/uploads`.
    kept_for : float
        How long, s.
    """

    def __init__(self, folder: Path, retention_time: float = RETENTION_TIME) -> None:
        self._retention_time = retention_time
        self._folder = folder / ".rig" / "uploads"
        self._lock = threading.Lock()
        self._uploads: dict[str, Upload] = {}  # in the order in which they came

    def place(self, name: str) -> Path:
        """Return where a file of a name is to be written.

        Raises
        ------
        ValueError
            It cannot be called so.
        UploadStoreFullError
            Too many are kept.
        """
        require_name(name)
        with self._lock:
            self._tidy()
            if len(self._uploads) >= MOST_KEPT:
                raise UploadStoreFullError(f"{len(self._uploads)} uploads are kept already")
        return self._folder / secrets.token_hex(8) / f"upload{PurePath(name).suffix.lower()}"

    def add(self, name: str, path: Path, size: int) -> Upload:
        """Register a file written at the path from `place`; return it or raise UploadStoreFullError."""
        now = time.time()
        upload = Upload(path.parent.name, name, path, size, now, now + self._retention_time)
        with self._lock:
            if len(self._uploads) >= MOST_KEPT:
                _discard(path.parent)
                raise UploadStoreFullError(f"{len(self._uploads)} uploads are kept already")
            self._uploads[upload.id] = upload
        return upload

    def all(self) -> tuple[Upload, ...]:
        """Return all uploads, the one sent last first."""
        with self._lock:
            self._tidy()
            return tuple(reversed(self._uploads.values()))

    def upload(self, upload_id: str) -> Upload:
        """Return an upload; UploadNotFoundError where there is none."""
        with self._lock:
            self._tidy()
            return self._known(upload_id)

    def remove(self, upload_id: str) -> Upload:
        """Delete an upload and return it."""
        with self._lock:
            upload = self._known(upload_id)
            self._drop(upload)
        return upload

    def close(self) -> None:
        """Leave nothing behind."""
        with self._lock:
            for upload in tuple(self._uploads.values()):
                self._drop(upload)

    def _known(self, upload_id: str) -> Upload:
        if upload_id not in self._uploads:
            raise UploadNotFoundError(f"upload {upload_id[:40]!r}: there is none of this id")
        return self._uploads[upload_id]

    def _tidy(self) -> None:
        """Forget what is too old, and throw away what services that were ended by force have left."""
        now = time.time()
        for upload in tuple(self._uploads.values()):
            if now >= upload.expires:
                self._drop(upload)
        for folder in self._folder.glob("*"):
            try:
                is_old = now - folder.stat().st_mtime > ABANDONED_AFTER
            except OSError:  # another service has been faster
                continue
            if is_old and folder.name not in self._uploads:
                _discard(folder)

    def _drop(self, upload: Upload) -> None:
        del self._uploads[upload.id]
        _discard(upload.path.parent)


def _discard(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


DISK_RESERVE: Final = 1024**3  # bytes that stay free on the disk
AT_ONCE: Final = 2
LEAST: Final = 64 * 1024  # bytes that must come at a time, but for the last
PATIENCE: Final = 30.0  # s for them


class UploadReceiver:
    """Takes the content of requests into files.

    Parameters
    ----------
    free_bytes : callable
        Returns the room left on the disk, bytes.
    most_bytes : int
        Most that one file may have.
    patience : float
        Longest time for a portion of 64 KiB, s.
    """

    def __init__(self, free_bytes: Callable[[], int], most_bytes: int, patience: float = PATIENCE) -> None:
        self._free_bytes = free_bytes
        self._most_bytes = most_bytes
        self._patience = patience
        self._threads = CapacityLimiter(AT_ONCE)
        self._arriving = 0

    async def take(self, request: Request, place: Path, look: Callable[[Path], None] | None = None) -> int:
        """Write the content of a request into a new file; return its size, bytes.

        Parameters
        ----------
        request : Request
            Whose content it is.
        place : Path
            Where it is to lie; its folder is made where it is missing.
        look : callable or None
            Looks through the file before it gets its place, and raises where it must not have it.

        Raises
        ------
        ProblemError, StorageError
            It cannot be taken; nothing is left of it.
        """
        limit = min(self._most_bytes, await to_thread.run_sync(self._free_bytes) - DISK_RESERVE)
        sent = request.headers.get("content-length", "0")
        if sent.isdecimal() and int(sent) > limit:
            raise ProblemError(
                ProblemType.CONTENT_TOO_LARGE, f"{int(sent):,} bytes, expected at most {max(limit, 0):,}"
            )
        if self._arriving >= AT_ONCE:
            raise ProblemError(ProblemType.BUSY, f"{self._arriving} files are being sent in already")
        self._arriving += 1
        try:
            return await self._take(request, place, limit, look)
        except RunExistsError as error:
            raise ProblemError(ProblemType.RUN_EXISTS, str(error)) from error
        finally:
            self._arriving -= 1

    async def _take(self, request: Request, place: Path, limit: int, look: Callable[[Path], None] | None) -> int:
        aside = partial(to_thread.run_sync, limiter=self._threads)
        incoming = await aside(partial(IncomingRun, place))
        try:
            size = await self._received(request, incoming, limit)
            await aside(incoming.close)
            if look is not None:
                await aside(look, incoming.temporary)
            await aside(incoming.commit)
        finally:
            await to_thread.run_sync(incoming.discard)
        return size

    async def _received(self, request: Request, incoming: IncomingRun, limit: int) -> int:
        size, stream = 0, request.stream()
        is_whole = False
        while not is_whole:
            portion = bytearray()
            try:
                with fail_after(self._patience):
                    while len(portion) < LEAST and not is_whole:
                        piece = await anext(stream, None)
                        is_whole = piece is None
                        portion += piece or b""
            except TimeoutError as error:
                told = f"{len(portion):,} bytes in {self._patience:g} s after {size:,}"
                raise ProblemError(ProblemType.REQUEST_TIMEOUT, told) from error
            size += len(portion)
            if size > limit:
                raise ProblemError(ProblemType.CONTENT_TOO_LARGE, f"more than {max(limit, 0):,} bytes")
            await to_thread.run_sync(incoming.write, bytes(portion), limiter=self._threads)
        return size

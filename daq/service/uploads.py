"""Uploads: receiving request bodies as files, and storing them for an hour until they are imported.

Nothing of a client's file name reaches the disk but the suffix; incomplete uploads are deleted.
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

MAX_UPLOADS: Final = 16
MAX_UPLOAD_SIZE: Final = 2 * 1024**3  # bytes of one file
MAX_NAME_LENGTH: Final = 200
RETENTION_TIME: Final = 3600.0  # s
ABANDONED_AFTER: Final = 24 * 3600.0  # s: older files were left behind by a killed service


class UploadNameError(Exception):
    """A name is no plain file name with the suffix of an import format."""


class UploadNotFoundError(LookupError):
    """No upload has this id."""


class UploadStoreFullError(RuntimeError):
    """Too many uploads are stored."""


@dataclass(frozen=True, slots=True)
class Upload:
    """An uploaded file.

    Parameters
    ----------
    id : str
        Its random id.
    name : str
        The client's name of the file.
    path : Path
        Its path; only the suffix comes from the name.
    size : int
        Size, bytes.
    uploaded, expires : float
        Wall clock of the complete upload and of the deletion, s since 1970.
    """

    id: str
    name: str
    path: Path
    size: int
    uploaded: float
    expires: float


def check_name(name: str) -> None:
    """Raise UploadNameError unless the name is a plain file name with the suffix of an import format."""
    if not name.isprintable() or not 0 < len(name) <= MAX_NAME_LENGTH or set(name) & set("/\\:"):
        raise UploadNameError(f"name {name[:60]!r}: expected a file's name without its folders")
    if PurePath(name).suffix.lower() not in IMPORT_FORMATS:
        raise UploadNameError(f"name {name[-60:]!r}: expected one that ends with {', '.join(IMPORT_FORMATS)}")


class UploadStore:
    """Stores uploads for a limited time; thread-safe.

    Parameters
    ----------
    folder : Path
        The data folder; uploads are in its `.rig/uploads`.
    retention_time : float
        Time until an upload is deleted, s.
    """

    def __init__(self, folder: Path, retention_time: float = RETENTION_TIME) -> None:
        self._retention_time = retention_time
        self._folder = folder / ".rig" / "uploads"
        self._lock = threading.Lock()
        self._uploads: dict[str, Upload] = {}  # in order of upload

    def path_for(self, name: str) -> Path:
        """Return the path for a new file with this name.

        Raises
        ------
        UploadNameError
            The name is invalid.
        UploadStoreFullError
            Too many uploads are stored.
        """
        check_name(name)
        with self._lock:
            self._delete_expired()
            if len(self._uploads) >= MAX_UPLOADS:
                raise UploadStoreFullError(f"{len(self._uploads)} uploads are stored; the limit is {MAX_UPLOADS}")
        return self._folder / secrets.token_hex(8) / f"upload{PurePath(name).suffix.lower()}"

    def add(self, name: str, path: Path, size: int) -> Upload:
        """Register a file written at the path from `path_for`; UploadStoreFullError if there are too many."""
        now = time.time()
        upload = Upload(path.parent.name, name, path, size, now, now + self._retention_time)
        with self._lock:
            if len(self._uploads) >= MAX_UPLOADS:
                _delete_folder(path.parent)
                raise UploadStoreFullError(f"{len(self._uploads)} uploads are stored; the limit is {MAX_UPLOADS}")
            self._uploads[upload.id] = upload
        return upload

    def list_uploads(self) -> tuple[Upload, ...]:
        """Return all uploads, the newest first."""
        with self._lock:
            self._delete_expired()
            return tuple(reversed(self._uploads.values()))

    def upload(self, upload_id: str) -> Upload:
        """Return an upload by its id; UploadNotFoundError if there is none."""
        with self._lock:
            self._delete_expired()
            return self._find(upload_id)

    def delete(self, upload_id: str) -> Upload:
        """Delete an upload and return it."""
        with self._lock:
            upload = self._find(upload_id)
            self._delete(upload)
        return upload

    def close(self) -> None:
        """Delete all uploads."""
        with self._lock:
            for upload in tuple(self._uploads.values()):
                self._delete(upload)

    def _find(self, upload_id: str) -> Upload:
        if upload_id not in self._uploads:
            raise UploadNotFoundError(f"no upload has the id {upload_id[:40]!r}")
        return self._uploads[upload_id]

    def _delete_expired(self) -> None:
        """Delete expired uploads, and files left behind by killed services."""
        now = time.time()
        for upload in tuple(self._uploads.values()):
            if now >= upload.expires:
                self._delete(upload)
        for folder in self._folder.glob("*"):
            try:
                is_old = now - folder.stat().st_mtime > ABANDONED_AFTER
            except OSError:  # another service has deleted it meanwhile
                continue
            if is_old and folder.name not in self._uploads:
                _delete_folder(folder)

    def _delete(self, upload: Upload) -> None:
        del self._uploads[upload.id]
        _delete_folder(upload.path.parent)


def _delete_folder(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)


DISK_RESERVE: Final = 1024**3  # bytes that stay free on the disk
MAX_CONCURRENT: Final = 2
MIN_CHUNK_SIZE: Final = 64 * 1024  # bytes; only the last chunk is smaller
CHUNK_TIMEOUT: Final = 30.0  # s for a chunk to arrive


class UploadReceiver:
    """Writes request bodies to files, with limits on size, speed and concurrency.

    Parameters
    ----------
    free_bytes : callable
        Returns the free disk space, bytes.
    max_size : int
        Maximum size of one file, bytes.
    chunk_timeout : float
        Maximum time for a chunk of 64 KiB, s.
    """

    def __init__(self, free_bytes: Callable[[], int], max_size: int, chunk_timeout: float = CHUNK_TIMEOUT) -> None:
        self._free_bytes = free_bytes
        self._max_size = max_size
        self._chunk_timeout = chunk_timeout
        self._threads = CapacityLimiter(MAX_CONCURRENT)
        self._active = 0

    async def receive(self, request: Request, path: Path, check: Callable[[Path], None] | None = None) -> int:
        """Write a request's body to a new file; return its size, bytes.

        Parameters
        ----------
        request : Request
            The request.
        path : Path
            The new file; a missing folder is created.
        check : callable or None
            Checks the complete temporary file, and raises to reject it.

        Raises
        ------
        ProblemError, StorageError
            The body is rejected; no file is left.
        """
        limit = min(self._max_size, await to_thread.run_sync(self._free_bytes) - DISK_RESERVE)
        sent = request.headers.get("content-length", "0")
        if sent.isdecimal() and int(sent) > limit:
            raise ProblemError(
                ProblemType.CONTENT_TOO_LARGE, f"{int(sent):,} bytes, expected at most {max(limit, 0):,}"
            )
        if self._active >= MAX_CONCURRENT:
            raise ProblemError(
                ProblemType.BUSY, f"{self._active} uploads are in progress; the limit is {MAX_CONCURRENT}"
            )
        self._active += 1
        try:
            return await self._receive(request, path, limit, check)
        except RunExistsError as error:
            raise ProblemError(ProblemType.RUN_EXISTS, str(error)) from error
        finally:
            self._active -= 1

    async def _receive(self, request: Request, path: Path, limit: int, check: Callable[[Path], None] | None) -> int:
        in_thread = partial(to_thread.run_sync, limiter=self._threads)
        incoming = await in_thread(partial(IncomingRun, path))
        try:
            size = await self._write_body(request, incoming, limit)
            await in_thread(incoming.close)
            if check is not None:
                await in_thread(check, incoming.temporary)
            await in_thread(incoming.commit)
        finally:
            await to_thread.run_sync(incoming.discard)
        return size

    async def _write_body(self, request: Request, incoming: IncomingRun, limit: int) -> int:
        size, stream = 0, request.stream()
        is_whole = False
        while not is_whole:
            chunk = bytearray()
            try:
                with fail_after(self._chunk_timeout):
                    while len(chunk) < MIN_CHUNK_SIZE and not is_whole:
                        piece = await anext(stream, None)
                        is_whole = piece is None
                        chunk += piece or b""
            except TimeoutError as error:
                detail = f"{len(chunk):,} bytes in {self._chunk_timeout:g} s after {size:,}"
                raise ProblemError(ProblemType.REQUEST_TIMEOUT, detail) from error
            size += len(chunk)
            if size > limit:
                raise ProblemError(ProblemType.CONTENT_TOO_LARGE, f"more than {max(limit, 0):,} bytes")
            await to_thread.run_sync(incoming.write, bytes(chunk), limiter=self._threads)
        return size

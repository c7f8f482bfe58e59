"""Uploads: receiving request bodies as files, and storing them for an hour until they are imported.

Nothing of a client's file name reaches the disk but the suffix; incomplete uploads are deleted.
"""

import math
import secrets
import shutil
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path, PurePath
from typing import Final

from anyio import CapacityLimiter, fail_after, to_thread
from fastapi import Request
from pydantic import Field

from daq.schemas.units import Schema, utc_time
from daq.service.problems import ProblemError, ProblemType
from recordings.catalogue.incoming_run import IncomingRun
from recordings.exchange.formats import IMPORT_FORMATS
from recordings.exchange.table import Column, Table
from recordings.file_operations import free_bytes

DISK_RESERVE: Final = 1024**3  # bytes that stay free on the disk
MAX_CONCURRENT: Final = 2
MIN_CHUNK_SIZE: Final = 64 * 1024  # bytes; only the last chunk is smaller
CHUNK_TIMEOUT: Final = 30.0  # s for a chunk to arrive
ABANDONED_AFTER: Final = 24 * 3600.0  # s: older files were left behind by a killed service
MAX_UPLOADS: Final = 16
MAX_UPLOAD_SIZE: Final = 2 * 1024**3  # bytes of one file
MAX_RECORDING_SIZE: Final = 64 * 1024**3  # bytes of one recording
MAX_NAME_LENGTH: Final = 200
RETENTION_TIME: Final = 3600.0  # s
UPLOADS: Final = "/api/v1/uploads"


class UploadSchema(Schema):
    """An uploaded file; a job of kind `import` converts it into a run."""

    upload: str = Field(description="Its id", examples=["5d41402abc4b2a76"])
    name: str = Field(description="Its file name", examples=["run-up.tdms"])
    size_bytes: int = Field(description="Its size, bytes", ge=0, examples=[48_000_000])
    uploaded_at: datetime = Field(description="Time of the complete upload, UTC", examples=["2026-11-24T10:00:00Z"])
    expires_at: datetime = Field(description="Time of its deletion, UTC", examples=["2026-11-24T11:00:00Z"])
    columns: str = Field(description="URL of its columns", examples=[f"{UPLOADS}/5d41402abc4b2a76/columns"])


class UploadListSchema(Schema):
    """All uploaded files."""

    uploads: tuple[UploadSchema, ...] = Field(description="Newest first")


class ColumnSchema(Schema):
    """A numeric column."""

    name: str = Field(description="Its name, for use in a mapping", examples=["group/Kaman 1"])
    unit: str = Field(description="Unit from the file; empty if it gives none", examples=["V"])
    lowest: float | None = Field(description="Minimum, in that unit; null: not finite", examples=[-1.25])
    highest: float | None = Field(description="Maximum, in that unit; null: not finite", examples=[1.31])


class ColumnsSchema(Schema):
    """Content of an uploaded file."""

    name: str = Field(description="File name", examples=["run-up.tdms"])
    rows: int = Field(description="Numbers in each column", ge=0, examples=[2_000_000])
    rate_hz: float | None = Field(description="Sampling rate, Hz; null: not in the file", examples=[20_000.0])
    started_at: datetime | None = Field(
        description="Wall clock at the first row, UTC; null: not in the file", examples=["2012-05-01T08:30:00Z"]
    )
    columns: tuple[ColumnSchema, ...] = Field(description="In the order of the file")


def columns_schema(name: str, table: Table) -> ColumnsSchema:
    """Return the schema of a table from the named file."""
    return ColumnsSchema(
        name=name,
        rows=table.n_rows,
        rate_hz=table.rate,
        started_at=None if table.started_ns is None else utc_time(table.started_ns),
        columns=tuple(map(_column_schema, table.columns)),
    )


def _column_schema(column: Column) -> ColumnSchema:
    extremes = float(column.values.min()), float(column.values.max())
    lowest, highest = (extreme if math.isfinite(extreme) else None for extreme in extremes)
    return ColumnSchema(name=column.name, unit=column.unit, lowest=lowest, highest=highest)


def upload_suffix(name: str) -> str:
    """Return the suffix of a plain file name, in lower case; ProblemError unless it is that of an import format."""
    suffix = PurePath(name).suffix.lower()
    if not name.isprintable() or not 0 < len(name) <= MAX_NAME_LENGTH or set(name) & set("/\\:"):
        detail = f"name {name[:60]!r}: expected a file's name without its folders"
        raise ProblemError(ProblemType.INVALID_PARAMETER, detail)
    if suffix not in IMPORT_FORMATS:
        detail = f"name {name[-60:]!r}: expected one that ends with {', '.join(IMPORT_FORMATS)}"
        raise ProblemError(ProblemType.INVALID_PARAMETER, detail)
    return suffix


def delete_abandoned(folder: Path) -> None:
    """Delete the folders in a folder that killed services left behind a day ago."""
    for abandoned in folder.glob("*"):
        try:
            if time.time() - abandoned.stat().st_mtime > ABANDONED_AFTER:
                shutil.rmtree(abandoned, ignore_errors=True)
        except OSError:  # another service has deleted it meanwhile
            continue


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
        self._retention_time = timedelta(seconds=retention_time)
        self._folder = folder / ".rig" / "uploads"
        self._lock = threading.Lock()
        self._uploads: dict[str, UploadSchema] = {}  # in order of upload

    def new_path(self, name: str) -> Path:
        """Return the path for a new file with this name; ProblemError if the name is invalid or the store is full."""
        suffix = upload_suffix(name)
        with self._lock:
            self._delete_expired()
            delete_abandoned(self._folder)
            self._require_space()
        return self._folder / secrets.token_hex(8) / f"upload{suffix}"

    def add(self, name: str, path: Path, size: int) -> UploadSchema:
        """Register a file written at the path from `new_path`; ProblemError if there are too many."""
        upload_id, now = path.parent.name, datetime.now(UTC)
        upload = UploadSchema(
            upload=upload_id,
            name=name,
            size_bytes=size,
            uploaded_at=now,
            expires_at=now + self._retention_time,
            columns=f"{UPLOADS}/{upload_id}/columns",
        )
        with self._lock:
            try:
                self._require_space()
            except ProblemError:
                shutil.rmtree(path.parent, ignore_errors=True)
                raise
            self._uploads[upload_id] = upload
        return upload

    def list_uploads(self) -> tuple[UploadSchema, ...]:
        """Return all uploads, the newest first."""
        with self._lock:
            self._delete_expired()
            return tuple(reversed(self._uploads.values()))

    def upload(self, upload_id: str) -> UploadSchema:
        """Return an upload by its id; ProblemError if there is none."""
        with self._lock:
            self._delete_expired()
            if upload_id not in self._uploads:
                raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, f"no upload has the id {upload_id[:40]!r}")
            return self._uploads[upload_id]

    def path(self, upload: UploadSchema) -> Path:
        """Return the path of an upload's file."""
        return self._folder / upload.upload / f"upload{upload_suffix(upload.name)}"

    def delete(self, upload_id: str) -> UploadSchema:
        """Delete an upload and return it; ProblemError if there is none."""
        upload = self.upload(upload_id)
        with self._lock:
            self._delete(upload_id)
        return upload

    def close(self) -> None:
        """Delete all uploads."""
        with self._lock:
            for upload_id in tuple(self._uploads):
                self._delete(upload_id)

    def _require_space(self) -> None:
        if len(self._uploads) >= MAX_UPLOADS:
            detail = f"{len(self._uploads)} uploads are stored; the limit is {MAX_UPLOADS}"
            raise ProblemError(ProblemType.TOO_MANY_UPLOADS, detail)

    def _delete_expired(self) -> None:
        now = datetime.now(UTC)
        for upload_id in [each.upload for each in self._uploads.values() if now >= each.expires_at]:
            self._delete(upload_id)

    def _delete(self, upload_id: str) -> None:
        self._uploads.pop(upload_id, None)
        shutil.rmtree(self._folder / upload_id, ignore_errors=True)


class UploadReceiver:
    """Writes request bodies to files, with limits on size, speed and concurrency.

    Parameters
    ----------
    max_size : int
        Maximum size of one file, bytes.
    chunk_timeout : float
        Maximum time for a chunk of 64 KiB, s.
    """

    def __init__(self, max_size: int, chunk_timeout: float = CHUNK_TIMEOUT) -> None:
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
        limit = min(self._max_size, await to_thread.run_sync(free_bytes, path.parent) - DISK_RESERVE)
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

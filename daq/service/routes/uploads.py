"""Routes of uploaded files; a job of kind `import` converts one into a run."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Final

from fastapi import Path, Query, Request, Response

from daq.reports.parameters import QueryParameters
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import OCTET_STREAM
from daq.service.results_reader import ResultsReader
from daq.service.routing import API_PREFIX, Routing
from daq.service.schemas.uploads import (
    ColumnsSchema,
    UploadListSchema,
    UploadSchema,
    upload_schema,
)
from daq.service.state import BoundedThreadPool
from daq.service.uploads import (
    MAX_NAME_LENGTH,
    MAX_UPLOAD_SIZE,
    Upload,
    UploadNameError,
    UploadNotFoundError,
    UploadReceiver,
    UploadStore,
    UploadStoreFullError,
)

UPLOAD_BODY: Final = {"content": {OCTET_STREAM: {"schema": {"type": "string", "format": "binary"}}}, "required": True}

UploadId = Annotated[str, Path(description="Id of the upload, from /api/v1/uploads", examples=["5d41402abc4b2a76"])]


class NameQuery(QueryParameters):
    """Query parameters of an upload."""

    name: Annotated[
        str,
        Query(
            description="File name without folders; its suffix gives the format",
            min_length=1, max_length=MAX_NAME_LENGTH, examples=["run-up.tdms"],
        ),
    ]  # fmt: skip


class UploadRoutes:
    """Routes of uploads.

    Parameters
    ----------
    uploads : UploadStore
        Stores the files.
    results : ResultsReader
        Reads their columns.
    free_bytes : callable
        Returns the free disk space, bytes.
    """

    def __init__(self, uploads: UploadStore, results: ResultsReader, free_bytes: Callable[[], int]) -> None:
        self._uploads = uploads
        self._results = results
        self._receiver = UploadReceiver(free_bytes, MAX_UPLOAD_SIZE)
        self._lookup_threads = BoundedThreadPool(threads=2, waiting=32)
        self._result_threads = BoundedThreadPool(threads=1, waiting=4)

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        routing.add(
            "POST /uploads",
            self.create,
            "create_upload",
            "uploads",
            "Upload another program's file",
            ProblemType.INVALID_PARAMETER,
            ProblemType.CROSS_SITE_REQUEST,
            ProblemType.UNSUPPORTED_MEDIA_TYPE,
            ProblemType.CONTENT_TOO_LARGE,
            ProblemType.REQUEST_TIMEOUT,
            ProblemType.TOO_MANY_UPLOADS,
            ProblemType.STORAGE_UNAVAILABLE,
            ProblemType.BUSY,
            status=201,
            content=UPLOAD_BODY,
        )
        routing.add(
            "/uploads", self.list_uploads, "list_uploads", "uploads", "List the uploads, newest first", ProblemType.BUSY
        )
        upload_problems = (ProblemType.UPLOAD_NOT_FOUND, ProblemType.INVALID_PARAMETER, ProblemType.BUSY)
        routing.add(
            "/uploads/{upload}", self.upload, "get_upload", "uploads", "Properties of an upload", *upload_problems
        )
        routing.add(
            "/uploads/{upload}/columns",
            self.columns,
            "get_upload_columns",
            "uploads",
            "Columns of an upload",
            *upload_problems,
            ProblemType.UNREADABLE_UPLOAD,
            ProblemType.TIME_LIMIT_EXCEEDED,
        )
        routing.add(
            "DELETE /uploads/{upload}",
            self.delete,
            "delete_upload",
            "uploads",
            "Delete an upload",
            *upload_problems,
            ProblemType.CROSS_SITE_REQUEST,
        )

    async def create(self, request: Request, query: Annotated[NameQuery, Query()], response: Response) -> UploadSchema:
        """Store a TDMS, LVM, CSV, MATLAB, UFF or WAV file for an hour; a job of kind `import` converts it into a run.

        Up to 2 GiB. The content is not checked yet, and nothing of its name reaches the disk but the suffix.
        """
        sent = request.headers.get("content-type", "")
        if sent.partition(";")[0].strip().lower() != OCTET_STREAM:
            raise ProblemError(ProblemType.UNSUPPORTED_MEDIA_TYPE, f"{sent or 'no type'!r}, expected {OCTET_STREAM}")
        try:
            path = await self._lookup_threads.run(partial(self._uploads.path_for, query.name))
            size = await self._receiver.receive(request, path)
            upload = await self._lookup_threads.run(partial(self._uploads.add, query.name, path, size))
        except UploadStoreFullError as error:
            raise ProblemError(ProblemType.TOO_MANY_UPLOADS, str(error)) from error
        except UploadNameError as error:
            raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error
        response.headers["Location"] = f"{API_PREFIX}/uploads/{upload.id}"
        return upload_schema(upload)

    async def list_uploads(self) -> UploadListSchema:
        """List the files uploaded during the last hour."""
        return UploadListSchema(
            uploads=tuple(map(upload_schema, await self._lookup_threads.run(self._uploads.list_uploads)))
        )

    async def upload(self, upload: UploadId) -> UploadSchema:
        """Return the file's name, size and time of deletion."""
        return upload_schema(await self._find(upload))

    async def columns(self, upload: UploadId) -> ColumnsSchema:
        """Read the file and return what a mapping needs: names, units and ranges of its columns, and its rate."""
        found = await self._find(upload)
        return await self._result_threads.run(partial(self._results.columns, found.path, found.name))

    async def delete(self, upload: UploadId) -> UploadSchema:
        """Delete the file and return its properties."""
        try:
            return upload_schema(await self._lookup_threads.run(partial(self._uploads.delete, upload)))
        except UploadNotFoundError as error:
            raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, str(error)) from error

    async def _find(self, upload_id: str) -> Upload:
        try:
            return await self._lookup_threads.run(partial(self._uploads.upload, upload_id))
        except UploadNotFoundError as error:
            raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, str(error)) from error

"""Files of other programs: sent in, looked into, deleted; a job makes one into a run."""

from collections.abc import Callable
from functools import partial
from typing import Annotated, Final

from fastapi import Path, Query, Request, Response

from daq.reports.parameters import QueryParameters
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import OCTET_STREAM
from daq.service.results_reader import ResultsReader
from daq.service.routing import API_PREFIX, BoundedThreadPool, Routing
from daq.service.schemas.uploads import (
    ColumnsSchema,
    UploadListSchema,
    UploadSchema,
    upload_schema,
)
from daq.service.uploads import (
    MAX_NAME_LENGTH,
    MAX_UPLOAD_SIZE,
    Upload,
    UploadNotFoundError,
    UploadReceiver,
    UploadStore,
    UploadStoreFullError,
)

CONTENT: Final = {"content": {OCTET_STREAM: {"schema": {"type": "string", "format": "binary"}}}, "required": True}

UploadId = Annotated[
    str, Path(description="Id of the upload, as /api/v1/uploads lists it", examples=["5d41402abc4b2a76"])
]


class NameQuery(QueryParameters):
    """What is sent."""

    name: Annotated[
        str,
        Query(
            description="What the file is called, without folders; its suffix tells the format",
            min_length=1, max_length=MAX_NAME_LENGTH, examples=["run-up.tdms"],
        ),
    ]  # fmt: skip


class UploadRoutes:
    """Uploads as resources.

    Parameters
    ----------
    uploads : UploadStore
        Who keeps them.
    results : ResultsReader
        Who looks into them.
    free_bytes : callable
        Returns the room left on the disk, bytes.
    """

    def __init__(self, uploads: UploadStore, results: ResultsReader, free_bytes: Callable[[], int]) -> None:
        self._uploads = uploads
        self._results = results
        self._incoming = UploadReceiver(free_bytes, MAX_UPLOAD_SIZE)
        self._lookup_threads = BoundedThreadPool(threads=2, waiting=32)
        self._result_threads = BoundedThreadPool(threads=1, waiting=4)

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        routing.add(
            "POST /uploads",
            self.arrive,
            "create_upload",
            "uploads",
            "Send another program's file in",
            ProblemType.INVALID_PARAMETER,
            ProblemType.CROSS_SITE_REQUEST,
            ProblemType.UNSUPPORTED_MEDIA_TYPE,
            ProblemType.CONTENT_TOO_LARGE,
            ProblemType.REQUEST_TIMEOUT,
            ProblemType.TOO_MANY_UPLOADS,
            ProblemType.STORAGE_UNAVAILABLE,
            ProblemType.BUSY,
            status=201,
            content=CONTENT,
        )
        routing.add(
            "/uploads", self.all, "list_uploads", "uploads", "List what was sent in, the last first", ProblemType.BUSY
        )
        known = (ProblemType.UPLOAD_NOT_FOUND, ProblemType.INVALID_PARAMETER, ProblemType.BUSY)
        routing.add("/uploads/{upload}", self.upload, "get_upload", "uploads", "What was sent in", *known)
        routing.add(
            "/uploads/{upload}/columns",
            self.columns,
            "get_upload_columns",
            "uploads",
            "The columns in it",
            *known,
            ProblemType.UNREADABLE_UPLOAD,
            ProblemType.TIME_LIMIT_EXCEEDED,
        )
        routing.add(
            "DELETE /uploads/{upload}",
            self.remove,
            "delete_upload",
            "uploads",
            "Delete what was sent in",
            *known,
            ProblemType.CROSS_SITE_REQUEST,
        )

    async def arrive(self, request: Request, query: Annotated[NameQuery, Query()], response: Response) -> UploadSchema:
        """Keep a TDMS, LVM, CSV, MATLAB, UFF or WAV file for an hour; a job of kind `import` makes it into a run.

        Up to 2 GiB. Nothing is looked at yet, and nothing of its name reaches the disk but the suffix.
        """
        sent = request.headers.get("content-type", "")
        if sent.partition(";")[0].strip().lower() != OCTET_STREAM:
            raise ProblemError(ProblemType.UNSUPPORTED_MEDIA_TYPE, f"{sent or 'no type'!r}, expected {OCTET_STREAM}")
        try:
            path = await self._lookup_threads.run(partial(self._uploads.path_for, query.name))
            size = await self._incoming.receive(request, path)
            upload = await self._lookup_threads.run(partial(self._uploads.add, query.name, path, size))
        except UploadStoreFullError as error:
            raise ProblemError(ProblemType.TOO_MANY_UPLOADS, str(error)) from error
        except ValueError as error:
            raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error
        response.headers["Location"] = f"{API_PREFIX}/uploads/{upload.id}"
        return upload_schema(upload)

    async def all(self) -> UploadListSchema:
        """List the files that were sent in during the last hour."""
        return UploadListSchema(
            uploads=tuple(map(upload_schema, await self._lookup_threads.run(self._uploads.list_uploads)))
        )

    async def upload(self, upload: UploadId) -> UploadSchema:
        """Tell what the file is called, and until when it is kept."""
        return upload_schema(await self._known(upload))

    async def columns(self, upload: UploadId) -> ColumnsSchema:
        """Read the file and tell what a mapping must choose from: names, units and ends of its columns, its rate."""
        known = await self._known(upload)
        return await self._result_threads.run(partial(self._results.columns, known.path, known.name))

    async def remove(self, upload: UploadId) -> UploadSchema:
        """Delete the file and tell what it was."""
        try:
            return upload_schema(await self._lookup_threads.run(partial(self._uploads.delete, upload)))
        except UploadNotFoundError as error:
            raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, str(error)) from error

    async def _known(self, upload_id: str) -> Upload:
        try:
            return await self._lookup_threads.run(partial(self._uploads.upload, upload_id))
        except UploadNotFoundError as error:
            raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, str(error)) from error

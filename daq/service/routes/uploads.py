"""Routes of uploaded files; a job of kind `import` converts one into a run."""

from typing import Annotated, Final

from fastapi import APIRouter, Path, Query, Request, Response

from daq.reports.parameters import QueryParameters
from daq.service.http_semantics import API_PREFIX, BINARY, OCTET_STREAM
from daq.service.problems import ProblemError, ProblemType, problems
from daq.service.state import State
from daq.service.uploads import MAX_NAME_LENGTH, ColumnsSchema, UploadListSchema, UploadSchema

UPLOAD_PROBLEMS: Final = (ProblemType.UPLOAD_NOT_FOUND, ProblemType.INVALID_PARAMETER, ProblemType.BUSY)
UPLOAD_BODY: Final = {"requestBody": {"content": {OCTET_STREAM: BINARY}, "required": True}}

UploadId = Annotated[str, Path(description="Id of the upload, from /api/v1/uploads", examples=["5d41402abc4b2a76"])]

router = APIRouter(tags=["uploads"])


class NameQuery(QueryParameters):
    """Query parameters of an upload."""

    name: Annotated[
        str,
        Query(
            description="File name without folders; its suffix gives the format",
            min_length=1, max_length=MAX_NAME_LENGTH, examples=["run-up.tdms"],
        ),
    ]  # fmt: skip


@router.post(
    "/uploads",
    status_code=201,
    summary="Upload another program's file",
    openapi_extra=UPLOAD_BODY,
    responses=problems(
        ProblemType.INVALID_PARAMETER,
        ProblemType.CROSS_SITE_REQUEST,
        ProblemType.UNSUPPORTED_MEDIA_TYPE,
        ProblemType.CONTENT_TOO_LARGE,
        ProblemType.REQUEST_TIMEOUT,
        ProblemType.TOO_MANY_UPLOADS,
        ProblemType.STORAGE_UNAVAILABLE,
        ProblemType.BUSY,
    ),
)
async def create_upload(
    state: State, request: Request, query: Annotated[NameQuery, Query()], response: Response
) -> UploadSchema:
    """Store a TDMS, LVM, CSV, MATLAB, UFF or WAV file for an hour; a job of kind `import` converts it into a run.

    Up to 2 GiB. The content is not checked yet, and nothing of its name reaches the disk but the suffix.
    """
    sent = request.headers.get("content-type", "")
    if sent.partition(";")[0].strip().lower() != OCTET_STREAM:
        raise ProblemError(ProblemType.UNSUPPORTED_MEDIA_TYPE, f"{sent or 'no type'!r}, expected {OCTET_STREAM}")
    path = await state.lookups.run(state.uploads.new_path, query.name)
    size = await state.upload_receiver.receive(request, path)
    upload = await state.lookups.run(state.uploads.add, query.name, path, size)
    response.headers["Location"] = f"{API_PREFIX}/uploads/{upload.upload}"
    return upload


@router.get("/uploads", summary="List the uploads, newest first", responses=problems(ProblemType.BUSY))
async def list_uploads(state: State) -> UploadListSchema:
    """List the files uploaded during the last hour."""
    return UploadListSchema(uploads=await state.lookups.run(state.uploads.list_uploads))


@router.get("/uploads/{upload}", summary="Properties of an upload", responses=problems(*UPLOAD_PROBLEMS))
async def get_upload(state: State, upload: UploadId) -> UploadSchema:
    """Return the file's name, size and time of deletion."""
    return await state.lookups.run(state.uploads.upload, upload)


@router.get(
    "/uploads/{upload}/columns",
    summary="Columns of an upload",
    responses=problems(*UPLOAD_PROBLEMS, ProblemType.UNREADABLE_UPLOAD, ProblemType.TIME_LIMIT_EXCEEDED),
)
async def get_upload_columns(state: State, upload: UploadId) -> ColumnsSchema:
    """Read the file and return what a mapping needs: names, units and ranges of its columns, and its rate."""
    stored = await state.lookups.run(state.uploads.upload, upload)
    return await state.result_threads.run(state.results.columns, state.uploads.path(stored), stored.name)


@router.delete(
    "/uploads/{upload}",
    summary="Delete an upload",
    responses=problems(*UPLOAD_PROBLEMS, ProblemType.CROSS_SITE_REQUEST),
)
async def delete_upload(state: State, upload: UploadId) -> UploadSchema:
    """Delete the file and return its properties."""
    return await state.lookups.run(state.uploads.delete, upload)

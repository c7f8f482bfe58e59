"""Routes of the recorded runs: list, properties, summary, file, annotations and trash; and the start of a run."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request, Response
from fastapi import Path as PathParameter
from fastapi.responses import FileResponse

from daq.errors import RigError
from daq.schemas.runs import RunListSchema, RunSchema, run_list_schema, run_schema
from daq.schemas.summary import SummarySchema
from daq.schemas.units import utc_time
from daq.service.http_semantics import (
    API_PREFIX,
    BINARY,
    BODY_PROBLEMS,
    NOT_MODIFIED,
    OCTET_STREAM,
    IfMatch,
    JsonRoute,
    allows_change,
    file_response,
    require_modified,
    strong_etag,
)
from daq.service.problems import ProblemError, ProblemType, problems
from daq.service.routes.run_schemas import (
    AnnotationRequest,
    RestoreRequest,
    RunQuery,
    StartedRunSchema,
    StartRequest,
    TrashedRunSchema,
    TrashEntrySchema,
    TrashSchema,
)
from daq.service.state import EndedRun, RunId, ServiceState, State, require_ended
from daq.session.run import RunManager
from recordings.catalogue.catalogue import RunEntry
from recordings.catalogue.run_store import Search
from recordings.errors import NotFoundError
from recordings.mcap.container import MAGIC

LISTING_PROBLEMS: Final = (ProblemType.INVALID_PARAMETER, ProblemType.STORAGE_UNAVAILABLE, ProblemType.BUSY)
EDIT_PROBLEMS: Final = (*LISTING_PROBLEMS, ProblemType.RUN_NOT_FOUND, ProblemType.CROSS_SITE_REQUEST)
FILE_RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    200: {"description": "The whole file, MCAP", "content": {OCTET_STREAM: BINARY}},
    206: {"description": "The byte range of `Range`", "content": {OCTET_STREAM: BINARY}},
    **NOT_MODIFIED,
}
RECORDING_BODY: Final = {"requestBody": {"content": {OCTET_STREAM: BINARY}, "required": True}}

TrashName = Annotated[
    str,
    PathParameter(description="Name in the trash, from /api/v1/trash", examples=["2026-11-24T09-12-07-gj90c"]),
]

router = APIRouter(tags=["runs"], route_class=JsonRoute)
start_router = APIRouter(tags=["runs"], route_class=JsonRoute)


@router.get("/runs", summary="List the runs", responses=problems(*LISTING_PROBLEMS))
async def list_runs(state: State, query: Annotated[RunQuery, Query()]) -> RunListSchema:
    """List the runs of the data folder; unfinished and truncated ones have `is_complete` false.

    Filters by measured values (speed, onset) find runs that `rig index` or the job `index` has summarised.
    """
    search = query.search()
    if search == Search():
        entries = await state.lookups.run(state.catalogue.runs)
    else:
        entries = await state.lookups.run(state.catalogue.search, search)
    chosen = query.matching(entries)
    return run_list_schema(chosen[query.offset :][: query.limit], len(chosen), query.limit, query.offset)


@start_router.post(
    "/runs",
    status_code=201,
    summary="Start a run",
    responses=problems(ProblemType.RUN_CANNOT_START, ProblemType.BUSY, ProblemType.STORAGE_UNAVAILABLE, *BODY_PROBLEMS),
)
async def start_run(state: State, request: StartRequest, response: Response) -> StartedRunSchema:
    """Start a run with one of the service's rigs, and respond once samples arrive, which takes seconds.

    Only one run at a time. `/live` returns its values; `/live/stop` or the end of the service stops it.
    """
    manager: RunManager = state.run_manager  # type: ignore[assignment]  # without one this router is not included
    try:
        header = await state.starts.run(manager.start, request.rig, request.note, request.duration_s)
    except RigError as error:
        raise ProblemError(ProblemType.RUN_CANNOT_START, str(error)) from error
    response.headers["Location"] = f"{API_PREFIX}/runs/{header.run}"
    return StartedRunSchema(run=header.run, rig=header.rig, started_at=utc_time(header.started_ns))


@router.get(
    "/runs/{run}",
    summary="Properties of a run",
    responses={**problems(ProblemType.RUN_NOT_FOUND, *LISTING_PROBLEMS), **NOT_MODIFIED},
)
async def get_run(state: State, request: Request, run: RunId, response: Response) -> RunSchema:
    """Return the run's properties from the recording's header and footer, within milliseconds."""
    schema = run_schema(await state.lookups.run(state.catalogue.run, run))
    response.headers["ETag"] = strong_etag(schema)
    require_modified(request, response.headers)
    return schema


@router.get(
    "/runs/{run}/summary",
    summary="Summary of a run",
    responses=problems(
        *LISTING_PROBLEMS,
        ProblemType.RUN_NOT_FOUND,
        ProblemType.RUN_UNDER_WAY,
        ProblemType.RUN_DAMAGED,
        ProblemType.RUN_FORMAT_UNKNOWN,
        ProblemType.TIME_LIMIT_EXCEEDED,
    ),
)
async def get_run_summary(state: State, run: RunId) -> SummarySchema:
    """Return speeds, amplitudes, phases, sub-synchronous components, losses, and the agreement with the model.

    If the run has no stored summary, it is computed from the whole recording, which takes a while.
    """
    require_ended(state.live, run)
    return await state.summary_threads.run(state.summaries.summary, run)


@router.get(
    "/runs/{run}/file",
    summary="Download the recording's file",
    response_class=FileResponse,
    responses={
        **problems(
            *LISTING_PROBLEMS,
            ProblemType.RUN_NOT_FOUND,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.RUN_DAMAGED,
            ProblemType.RANGE_NOT_SATISFIABLE,
        ),
        **FILE_RESPONSES,
    },
)
async def get_run_file(state: State, request: Request, run: EndedRun) -> FileResponse:
    """Return the recording, or with `Range` a byte range of it; `If-Range` guards against a changed file."""
    try:
        return await state.lookups.run(partial(file_response, request, run.path, magic=MAGIC))
    except FileNotFoundError as error:
        raise ProblemError(ProblemType.RUN_NOT_FOUND, f"run {run.id}: its file no longer exists") from error
    except OSError as error:
        raise ProblemError(ProblemType.STORAGE_UNAVAILABLE, f"run {run.id}: {error.strerror or error}") from error


@router.put(
    "/runs/{run}/file",
    status_code=201,
    summary="Upload a recording",
    openapi_extra=RECORDING_BODY,
    responses=problems(
        *EDIT_PROBLEMS,
        ProblemType.RUN_EXISTS,
        ProblemType.INVALID_RECORDING,
        ProblemType.CONTENT_TOO_LARGE,
        ProblemType.REQUEST_TIMEOUT,
    ),
)
async def upload_run(state: State, request: Request, run: RunId, response: Response) -> RunSchema:
    """Store a recording under the path's id once it is complete and all its checksums are correct.

    An existing run is never overwritten, and nothing of a rejected recording is left.
    """
    path = state.catalogue.path_for(run)
    await state.recording_receiver.receive(request, path, state.results.require_intact)
    response.headers["Location"] = f"{API_PREFIX}/runs/{run}"
    return run_schema(await state.edits.run(state.catalogue.run, run))


@router.patch(
    "/runs/{run}",
    summary="Change a run's remark and tags",
    responses=problems(*EDIT_PROBLEMS, ProblemType.PRECONDITION_FAILED, *BODY_PROBLEMS),
)
async def annotate_run(
    state: State, run: RunId, annotation: AnnotationRequest, response: Response, if_match: IfMatch = None
) -> RunSchema:
    """Change the run's remark and tags, stored in a file beside the recording, which is not changed."""

    def annotate() -> RunEntry:
        _require_match(state, run, if_match)
        return state.catalogue.annotate(run, remark=annotation.remark, tags=annotation.tags)

    schema = run_schema(await state.edits.run(annotate))
    response.headers["ETag"] = strong_etag(schema)
    return schema


@router.delete(
    "/runs/{run}",
    summary="Move a run into the trash",
    responses=problems(*EDIT_PROBLEMS, ProblemType.RUN_UNDER_WAY, ProblemType.PRECONDITION_FAILED),
)
async def delete_run(state: State, run: RunId, if_match: IfMatch = None) -> TrashedRunSchema:
    """Move the recording into the folder `trash` of the data folder; nothing is deleted."""
    require_ended(state.live, run)

    def move() -> Path:
        _require_match(state, run, if_match)
        return state.catalogue.move_to_trash(run)

    path = await state.edits.run(move)
    return TrashedRunSchema(run=run, trash=f"{path.parent.name}/{path.name}", name=path.stem)


def _require_match(state: ServiceState, run: str, if_match: str | None) -> None:
    """Raise ProblemError if a run has changed since the version in If-Match; the only edit thread calls it."""
    if if_match is not None and not allows_change(if_match, strong_etag(run_schema(state.catalogue.run(run)))):
        raise ProblemError(ProblemType.PRECONDITION_FAILED, f"run {run} has changed")


@router.get(
    "/trash",
    summary="List the runs in the trash",
    responses=problems(ProblemType.STORAGE_UNAVAILABLE, ProblemType.BUSY),
)
async def list_trash(state: State) -> TrashSchema:
    """List the runs in the trash; the service never deletes them permanently."""
    trashed = await state.edits.run(state.catalogue.trashed_runs)
    return TrashSchema(runs=tuple(TrashEntrySchema(name=each.name, size_bytes=each.size) for each in trashed))


@router.post(
    "/trash/{name}/restore",
    status_code=201,
    summary="Restore a run from the trash",
    responses=problems(ProblemType.NOT_IN_TRASH, ProblemType.RUN_EXISTS, *EDIT_PROBLEMS, *BODY_PROBLEMS),
)
async def restore_run(state: State, name: TrashName, request: RestoreRequest, response: Response) -> RunSchema:
    """Move a run and its annotations back into the data folder; an existing run is never replaced."""
    try:
        entry = await state.edits.run(state.catalogue.restore, name, request.run or "")
    except NotFoundError as error:
        raise ProblemError(ProblemType.NOT_IN_TRASH, str(error)) from error
    response.headers["Location"] = f"{API_PREFIX}/runs/{entry.id}"
    return run_schema(entry)

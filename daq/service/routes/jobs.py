"""Routes of jobs: create, list, follow, cancel, and download results."""

from collections.abc import AsyncIterator
from functools import partial
from typing import Annotated, Any, Final

from anyio import to_thread
from fastapi import APIRouter, Body, Path, Request, Response
from fastapi.responses import FileResponse, StreamingResponse

from daq.errors import ConfigError
from daq.schemas.study import RotorStudyRequest
from daq.service.http_semantics import (
    API_PREFIX,
    BINARY,
    BODY_PROBLEMS,
    NOT_MODIFIED,
    OCTET_STREAM,
    JsonRoute,
    event_stream,
    file_response,
)
from daq.service.jobs.queue import Task, cancelled
from daq.service.jobs.schemas import (
    ImportRequest,
    IndexRequest,
    JobListSchema,
    JobRequest,
    JobSchema,
    RigFromRun,
)
from daq.service.jobs.tasks import header_of, import_task, index_task, rig_from_toml, rig_of_run, run_task, study_task
from daq.service.problems import ProblemError, ProblemType, problems
from daq.service.routes.results import ANALYSIS_CONTENT, JSON, MEDIA_TYPES
from daq.service.state import ServiceState, State, ended_run

RESULT_RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "description": "The result",
        "content": {
            JSON: {"schema": {"type": "object"}},
            OCTET_STREAM: BINARY,
            **ANALYSIS_CONTENT,
        },
    },
    206: {"description": "The byte range of `Range`", "content": {OCTET_STREAM: BINARY}},
    **NOT_MODIFIED,
}
JOB_PROBLEMS: Final = (ProblemType.JOB_NOT_FOUND, ProblemType.INVALID_PARAMETER, ProblemType.BUSY)

JobId = Annotated[str, Path(description="Id of the job, from /api/v1/jobs", examples=["9f3c0f6e2d1b4a57"])]

router = APIRouter(tags=["jobs"], route_class=JsonRoute)


@router.post(
    "/jobs",
    status_code=202,
    summary="Create a job",
    responses=problems(
        ProblemType.RUN_NOT_FOUND,
        ProblemType.UPLOAD_NOT_FOUND,
        ProblemType.RUN_UNDER_WAY,
        ProblemType.RUN_DAMAGED,
        ProblemType.TOO_MANY_JOBS,
        ProblemType.BUSY,
        ProblemType.STORAGE_UNAVAILABLE,
        *BODY_PROBLEMS,
    ),
)
async def create_job(state: State, request: Annotated[JobRequest, Body()], response: Response) -> JobSchema:
    """Queue work that takes longer than a request may, and respond at once; `Location` is the job's URL.

    One job runs at a time, in a low-priority process that does not disturb a recording; at most 8 are queued.
    Job and result are deleted an hour after its end; at most 32 are stored.
    """
    job = await state.lookups.run(state.jobs.submit, await _task(state, request))
    response.headers["Location"] = f"{API_PREFIX}/jobs/{job.job}"
    return job


async def _task(state: ServiceState, request: JobRequest) -> Task:
    """Return the task of a job request."""
    match request:
        case IndexRequest():
            return index_task(request)
        case ImportRequest():
            return await _import_task(state, request)
        case RotorStudyRequest():
            if request.run is not None:
                header_of(await ended_run(state, request.run))
            return study_task(request)
        case _:
            return run_task(request, await ended_run(state, request.run))


async def _import_task(state: ServiceState, request: ImportRequest) -> Task:
    upload = await state.lookups.run(state.uploads.upload, request.upload)
    try:
        if isinstance(request.rig, RigFromRun):
            rig = rig_of_run(header_of(await ended_run(state, request.rig.run)))
        else:
            rig = await state.lookups.run(rig_from_toml, request.rig)
        return import_task(request, upload, state.uploads.path(upload), rig)
    except ConfigError as error:
        raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error


@router.get("/jobs", summary="List the jobs, newest first", responses=problems(ProblemType.BUSY))
async def list_jobs(state: State) -> JobListSchema:
    """List waiting, running and recently ended jobs."""
    return JobListSchema(jobs=await state.lookups.run(state.jobs.list_jobs))


@router.get("/jobs/{job}", summary="State of a job", responses=problems(*JOB_PROBLEMS))
async def get_job(state: State, job: JobId) -> JobSchema:
    """Return the job's state and progress, and the URL of its result once it is done."""
    return await state.lookups.run(state.jobs.job, job)


@router.delete(
    "/jobs/{job}",
    summary="Cancel and delete a job",
    responses=problems(*JOB_PROBLEMS, ProblemType.CROSS_SITE_REQUEST),
)
async def delete_job(state: State, job: JobId) -> JobSchema:
    """Cancel the job if it has not ended, delete it with its result, and return its last state."""
    return await state.lookups.run(state.jobs.delete, job)


@router.get(
    "/jobs/{job}/events",
    summary="State of a job as server-sent events",
    response_class=StreamingResponse,
    responses={**problems(*JOB_PROBLEMS), **event_stream("job")},
)
async def stream_job(state: State, request: Request, job: JobId) -> Response:
    """Send server-sent events of type `job` with the job's JSON as data, until the job ends."""
    current = await state.lookups.run(state.jobs.job, job)
    return state.job_changes.event_response(request, "job", _texts(state, current))


async def _texts(state: ServiceState, job: JobSchema) -> AsyncIterator[str]:
    """Yield the state of a job whenever it is requested, until it is final."""
    yield job.model_dump_json()
    while not job.state.is_final:
        job = await to_thread.run_sync(_latest, state, job)
        yield job.model_dump_json()


def _latest(state: ServiceState, job: JobSchema) -> JobSchema:
    """Return the current state of a job; a deleted one as cancelled."""
    try:
        return state.jobs.job(job.job)
    except ProblemError:
        return cancelled(job)


@router.get(
    "/jobs/{job}/result",
    summary="Result of a job",
    response_class=FileResponse,
    responses={
        **problems(
            *JOB_PROBLEMS, ProblemType.NO_RESULT, ProblemType.RANGE_NOT_SATISFIABLE, ProblemType.STORAGE_UNAVAILABLE
        ),
        **RESULT_RESPONSES,
    },
)
async def get_job_result(state: State, request: Request, job: JobId) -> FileResponse:
    """Return the job's result, JSON or an exported file, or with `Range` a byte range of it."""
    path = await state.lookups.run(state.jobs.result_file, job)
    media_type = MEDIA_TYPES.get(path.suffix.removeprefix("."), OCTET_STREAM)
    try:
        return await state.lookups.run(partial(file_response, request, path, media_type, etag=f'"{job}"'))
    except OSError as error:
        detail = f"job {job}: its result file no longer exists"
        raise ProblemError(ProblemType.STORAGE_UNAVAILABLE, detail) from error

"""Routes of jobs: create, list, follow, cancel, and download results."""

import asyncio
import threading
from collections.abc import AsyncIterator
from functools import partial
from typing import Annotated, Final, Protocol

from anyio import to_thread
from fastapi import Body, Path, Request, Response
from fastapi.responses import StreamingResponse

from daq.errors import ConfigError
from daq.schemas.study import RotorStudyRequest
from daq.service.jobs.imports import import_task, rig_from_toml, rig_of_run
from daq.service.jobs.queue import Job, JobNotFoundError, JobQueue, JobQueueFullError, Task
from daq.service.jobs.schemas import IndexRequest, JobListSchema, JobRequest, JobSchema, job_schema
from daq.service.jobs.studies import study_task
from daq.service.jobs.tasks import header_of, index_task, run_task
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.service.responses import NOT_MODIFIED, OCTET_STREAM, file_response
from daq.service.routes.analyses import PLOT_SCHEMAS, PLOT_TYPES
from daq.service.routing import API_PREFIX, EVENT_STREAM, Routing, event_stream
from daq.service.schemas.uploads import ImportRequest, RigFromRun, RigFromToml
from daq.service.state import BoundedThreadPool
from daq.service.stream import LiveRun, require_ended
from daq.service.uploads import UploadNotFoundError, UploadStore
from recordings.catalogue.catalogue import RunEntry

POLL_INTERVAL: Final = 0.2  # s
KEEP_ALIVE_INTERVAL: Final = 15.0  # s without a change until a comment shows that the service is alive
MAX_FOLLOWERS: Final = 16
BINARY_CONTENT: Final = {"schema": {"type": "string", "format": "binary"}}
JSON_CONTENT: Final = {"schema": {"type": "object"}}

MEDIA_TYPES: Final = {"json": "application/json", **PLOT_TYPES}
RESULT_CONTENT: Final = {
    "application/json": JSON_CONTENT,
    OCTET_STREAM: BINARY_CONTENT,
    **{media_type: {"schema": PLOT_SCHEMAS[form]} for form, media_type in PLOT_TYPES.items()},
}

JobId = Annotated[str, Path(description="Id of the job, from /api/v1/jobs", examples=["9f3c0f6e2d1b4a57"])]


class Catalogue(Protocol):
    """The runs of a data folder."""

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError if there is none."""
        ...


class JobRoutes:
    """Routes of jobs.

    Parameters
    ----------
    catalogue : Catalogue
        The runs that jobs process.
    live : LiveRun
        The current run, which jobs cannot process.
    jobs : JobQueue
        Runs the jobs.
    uploads : UploadStore
        Uploaded files for import.
    closing : Event
        Ends the event streams of all jobs.
    """

    def __init__(
        self, catalogue: Catalogue, live: LiveRun, jobs: JobQueue, uploads: UploadStore, closing: threading.Event
    ) -> None:
        self._uploads = uploads
        self._catalogue = catalogue
        self._live = live
        self._jobs = jobs
        self._lookup_threads = BoundedThreadPool(threads=2, waiting=32)
        self._followers = 0
        self._closing = closing

    def add_to(self, routing: Routing) -> None:
        """Add the routes."""
        routing.add(
            "POST /jobs",
            self.create,
            "create_job",
            "jobs",
            "Create a job",
            ProblemType.RUN_NOT_FOUND,
            ProblemType.UPLOAD_NOT_FOUND,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.RUN_DAMAGED,
            ProblemType.TOO_MANY_JOBS,
            ProblemType.BUSY,
            ProblemType.STORAGE_UNAVAILABLE,
            status=202,
        )
        routing.add("/jobs", self.list_jobs, "list_jobs", "jobs", "List the jobs, newest first", ProblemType.BUSY)
        job_problems = (ProblemType.JOB_NOT_FOUND, ProblemType.INVALID_PARAMETER, ProblemType.BUSY)
        routing.add("/jobs/{job}", self.job, "get_job", "jobs", "State of a job", *job_problems)
        routing.add(
            "DELETE /jobs/{job}",
            self.delete,
            "delete_job",
            "jobs",
            "Cancel and delete a job",
            *job_problems,
            ProblemType.CROSS_SITE_REQUEST,
        )
        routing.add(
            "/jobs/{job}/events",
            self.events,
            "stream_job",
            "jobs",
            "State of a job as server-sent events",
            *job_problems,
            responses=event_stream("job"),
        )
        routing.add(
            "/jobs/{job}/result",
            self.result,
            "get_job_result",
            "jobs",
            "Result of a job",
            *job_problems,
            ProblemType.NO_RESULT,
            ProblemType.RANGE_NOT_SATISFIABLE,
            ProblemType.STORAGE_UNAVAILABLE,
            responses={
                200: {"description": "The result", "content": RESULT_CONTENT},
                206: {"description": "The byte range of `Range`", "content": {OCTET_STREAM: BINARY_CONTENT}},
                **NOT_MODIFIED,
            },
        )

    async def create(self, request: Annotated[JobRequest, Body()], response: Response) -> JobSchema:
        """Queue work that takes longer than a request may, and respond at once; `Location` is the job's URL.

        One job runs at a time, in a low-priority process that does not disturb a recording; at most 8 are queued.
        Job and result are deleted an hour after its end; at most 32 are stored.
        """
        task = await self._task(request)
        try:
            job = await self._lookup_threads.run(partial(self._jobs.submit, task))
        except JobQueueFullError as error:
            raise ProblemError(ProblemType.TOO_MANY_JOBS, str(error)) from error
        response.headers["Location"] = f"{API_PREFIX}/jobs/{job.id}"
        return job_schema(job)

    async def _task(self, request: JobRequest) -> Task:
        """Return the task of a job request."""
        match request:
            case IndexRequest():
                return index_task(request, self._jobs.location)
            case ImportRequest():
                return await self._import(request)
            case RotorStudyRequest():
                return study_task(request, None if request.run is None else header_of(await self._run(request.run)))
            case _:
                return run_task(request, await self._run(request.run), self._jobs.location)

    async def _import(self, request: ImportRequest) -> Task:
        try:
            upload = await self._lookup_threads.run(partial(self._uploads.upload, request.upload))
            match request.rig:
                case RigFromRun(run=run):
                    rig = rig_of_run(header_of(await self._run(run)))
                case RigFromToml() as text:
                    rig = await self._lookup_threads.run(partial(rig_from_toml, text))
            return import_task(request, upload, rig, self._jobs.location)
        except UploadNotFoundError as error:
            raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, str(error)) from error
        except ConfigError as error:
            raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error

    async def _run(self, run: str) -> RunEntry:
        """Return a run; ProblemError if it is still in progress."""
        require_ended(self._live, run)
        return await self._lookup_threads.run(partial(self._catalogue.run, run))

    async def list_jobs(self) -> JobListSchema:
        """List waiting, running and recently ended jobs."""
        jobs = await self._lookup_threads.run(self._jobs.list_jobs)
        return JobListSchema(jobs=tuple(map(job_schema, jobs)))

    async def job(self, job: JobId) -> JobSchema:
        """Return the job's state and progress, and the URL of its result once it is done."""
        return job_schema(await self._find(job))

    async def delete(self, job: JobId) -> JobSchema:
        """Cancel the job if it has not ended, delete it with its result, and return its last state."""
        try:
            return job_schema(await self._lookup_threads.run(partial(self._jobs.delete, job)))
        except JobNotFoundError as error:
            raise ProblemError(ProblemType.JOB_NOT_FOUND, str(error)) from error

    async def result(self, request: Request, job: JobId) -> Response:
        """Return the job's result, JSON or an exported file, or with `Range` a byte range of it."""
        found = await self._find(job)
        if found.result is None:
            raise ProblemError(ProblemType.NO_RESULT, found.error or f"job {job} is {found.state.value}")
        media_type = MEDIA_TYPES.get(found.result.suffix.removeprefix("."), OCTET_STREAM)
        try:
            etag = f'"{job}"'
            return await self._lookup_threads.run(partial(file_response, request, found.result, media_type, etag=etag))
        except OSError as error:
            raise ProblemError(
                ProblemType.STORAGE_UNAVAILABLE, f"job {job}: its result file no longer exists"
            ) from error

    async def events(self, request: Request, job: JobId) -> Response:
        """Send server-sent events of type `job` with the job's JSON as data, until the job ends."""
        found = await self._find(job)
        if request.scope.get("rig.head"):
            return Response(media_type=EVENT_STREAM)
        if self._followers >= MAX_FOLLOWERS or self._closing.is_set():
            raise ProblemError(ProblemType.BUSY, f"{self._followers} clients follow jobs; the limit is {MAX_FOLLOWERS}")
        return StreamingResponse(self._events(found), media_type=EVENT_STREAM, headers={"X-Accel-Buffering": "no"})

    async def _events(self, job: Job) -> AsyncIterator[str]:
        self._followers += 1
        try:
            yield _event_text(job)
            idle_time = 0.0
            while not job.state.is_final and not self._closing.is_set():
                await asyncio.sleep(POLL_INTERVAL)
                idle_time += POLL_INTERVAL
                previous, job = job, await to_thread.run_sync(self._latest, job)
                if job != previous:
                    idle_time = 0.0
                    yield _event_text(job)
                elif idle_time >= KEEP_ALIVE_INTERVAL:
                    idle_time = 0.0
                    yield ": keep-alive\n\n"
        finally:
            self._followers -= 1

    def _latest(self, job: Job) -> Job:
        """Return the current state of a job; a deleted one as cancelled."""
        try:
            return self._jobs.job(job.id)
        except JobNotFoundError:
            return job.as_cancelled()

    async def _find(self, job_id: str) -> Job:
        try:
            return await self._lookup_threads.run(partial(self._jobs.job, job_id))
        except JobNotFoundError as error:
            raise ProblemError(ProblemType.JOB_NOT_FOUND, str(error)) from error


def _event_text(job: Job) -> str:
    return f"event: job\ndata: {job_schema(job).model_dump_json()}\n\n"

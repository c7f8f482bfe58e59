"""Jobs as resources: asked for, followed, cancelled, and their results fetched."""

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
from daq.service.routes.analyses import CONTENT, PLOT_TYPES
from daq.service.routing import API_PREFIX, EVENT_STREAM, BoundedThreadPool, Routing, event_stream
from daq.service.schemas.importing import ImportRequest, RigFromRun, RigFromToml
from daq.service.stream import LiveFeed, require_ended
from daq.service.uploads import UploadNotFoundError, UploadStore
from recordings.catalogue.catalogue import RunEntry

LOOK: Final = 0.2  # s between two looks at a job that is followed
KEEP_ALIVE_INTERVAL: Final = 15.0  # s without news before a client is told that the service is still there
MAX_FOLLOWERS: Final = 16
BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
JSON: Final = {"schema": {"type": "object"}}

MEDIA_TYPES: Final = {"json": "application/json", **PLOT_TYPES}
RESULTS: Final = {
    "application/json": JSON,
    OCTET_STREAM: BINARY,
    **{media_type: {"schema": CONTENT[form]} for form, media_type in PLOT_TYPES.items()},
}

JobId = Annotated[str, Path(description="Id of the job, as /api/v1/jobs lists it", examples=["9f3c0f6e2d1b4a57"])]


class Catalogue(Protocol):
    """The runs of a data folder."""

    def run(self, run_id: str) -> RunEntry:
        """Return one run; NotFoundError where there is none."""
        ...


class JobRoutes:
    """Long work.

    Parameters
    ----------
    catalogue : Catalogue
        The runs that jobs are about.
    live : LiveFeed
        The run under way, which is left alone.
    jobs : JobQueue
        Who does them.
    uploads : UploadStore
        Files of other programs that jobs import.
    """

    def __init__(self, catalogue: Catalogue, live: LiveFeed, jobs: JobQueue, uploads: UploadStore) -> None:
        self._uploads = uploads
        self._catalogue = catalogue
        self._live = live
        self._jobs = jobs
        self._lookup_threads = BoundedThreadPool(threads=2, waiting=32)
        self._followers = 0
        self._ended = threading.Event()

    def add_to(self, routing: Routing) -> None:
        """Make the addresses known."""
        routing.add(
            "POST /jobs",
            self.begin,
            "create_job",
            "jobs",
            "Begin a job",
            ProblemType.RUN_NOT_FOUND,
            ProblemType.UPLOAD_NOT_FOUND,
            ProblemType.RUN_UNDER_WAY,
            ProblemType.RUN_DAMAGED,
            ProblemType.TOO_MANY_JOBS,
            ProblemType.BUSY,
            ProblemType.STORAGE_UNAVAILABLE,
            status=202,
        )
        routing.add(
            "/jobs", self.all, "list_jobs", "jobs", "List the jobs, the one asked for last first", ProblemType.BUSY
        )
        known = (ProblemType.JOB_NOT_FOUND, ProblemType.INVALID_PARAMETER, ProblemType.BUSY)
        routing.add("/jobs/{job}", self.job, "get_job", "jobs", "How a job stands", *known)
        routing.add(
            "DELETE /jobs/{job}",
            self.remove,
            "delete_job",
            "jobs",
            "Cancel a job, or forget it",
            *known,
            ProblemType.CROSS_SITE_REQUEST,
        )
        routing.add(
            "/jobs/{job}/events",
            self.events,
            "stream_job",
            "jobs",
            "A job, whenever it changes",
            *known,
            responses=event_stream("job"),
        )
        routing.add(
            "/jobs/{job}/result",
            self.result,
            "get_job_result",
            "jobs",
            "What came of a job",
            *known,
            ProblemType.NO_RESULT,
            ProblemType.RANGE_NOT_SATISFIABLE,
            ProblemType.STORAGE_UNAVAILABLE,
            responses={
                200: {"description": "The result", "content": RESULTS},
                206: {"description": "The stretch that `Range` asks for", "content": {OCTET_STREAM: BINARY}},
                **NOT_MODIFIED,
            },
        )

    def close_streams(self) -> None:
        """Let all who follow jobs go."""
        self._ended.set()

    async def begin(self, order: Annotated[JobRequest, Body()], response: Response) -> JobSchema:
        """Take on what would take too long to wait for, and answer at once; `Location` tells where it stands.

        One job is done at a time, in a process of its own at low priority, so that a run that is recorded is not
        disturbed; at most 8 wait. Job and result are kept for an hour after its end, of the last 32.
        """
        task = await self._task(order)
        try:
            job = await self._lookup_threads.run(partial(self._jobs.submit, task))
        except JobQueueFullError as error:
            raise ProblemError(ProblemType.TOO_MANY_JOBS, str(error)) from error
        response.headers["Location"] = f"{API_PREFIX}/jobs/{job.id}"
        return job_schema(job)

    async def _task(self, order: JobRequest) -> Task:
        """Return what is to be done."""
        match order:
            case IndexRequest():
                return index_task(order, self._jobs.location)
            case ImportRequest():
                return await self._import(order)
            case RotorStudyRequest():
                return study_task(order, None if order.run is None else header_of(await self._run(order.run)))
            case _:
                return run_task(order, await self._run(order.run), self._jobs.location)

    async def _import(self, order: ImportRequest) -> Task:
        try:
            upload = await self._lookup_threads.run(partial(self._uploads.upload, order.upload))
            match order.rig:
                case RigFromRun(run=run):
                    rig = rig_of_run(header_of(await self._run(run)))
                case RigFromToml() as text:
                    rig = await self._lookup_threads.run(partial(rig_from_toml, text))
            return import_task(order, upload, rig, self._jobs.location)
        except UploadNotFoundError as error:
            raise ProblemError(ProblemType.UPLOAD_NOT_FOUND, str(error)) from error
        except ConfigError as error:
            raise ProblemError(ProblemType.INVALID_PARAMETER, str(error)) from error

    async def _run(self, run: str) -> RunEntry:
        """Return a run that is not under way."""
        require_ended(self._live, run)
        return await self._lookup_threads.run(partial(self._catalogue.run, run))

    async def all(self) -> JobListSchema:
        """List the jobs that wait, go on, or ended not long ago."""
        jobs = await self._lookup_threads.run(self._jobs.list_jobs)
        return JobListSchema(jobs=tuple(map(job_schema, jobs)))

    async def job(self, job: JobId) -> JobSchema:
        """Tell how far the job is, and once it is done, where its result is."""
        return job_schema(await self._known(job))

    async def remove(self, job: JobId) -> JobSchema:
        """End the job's process where it has not ended, forget the job and its result, and tell how it stood last."""
        try:
            return job_schema(await self._lookup_threads.run(partial(self._jobs.delete, job)))
        except JobNotFoundError as error:
            raise ProblemError(ProblemType.JOB_NOT_FOUND, str(error)) from error

    async def result(self, request: Request, job: JobId) -> Response:
        """Send what came of the job, or with `Range` a stretch of it: JSON, or the file that was exported."""
        known = await self._known(job)
        if known.result is None:
            raise ProblemError(ProblemType.NO_RESULT, known.error or f"job {job} is {known.state.value}")
        media_type = MEDIA_TYPES.get(known.result.suffix.removeprefix("."), OCTET_STREAM)
        try:
            return await file_response(request, known.result, media_type, etag=f'"{job}"')
        except OSError as error:
            raise ProblemError(ProblemType.STORAGE_UNAVAILABLE, f"job {job}: its result has gone") from error

    async def events(self, request: Request, job: JobId) -> Response:
        """Send server-sent events of type `job` whose data is the document of the job; they end with the job."""
        known = await self._known(job)
        if request.scope.get("rig.head"):
            return Response(media_type=EVENT_STREAM)
        if self._followers >= MAX_FOLLOWERS or self._ended.is_set():
            raise ProblemError(ProblemType.BUSY, f"{self._followers} clients follow jobs already")
        return StreamingResponse(self._events(known), media_type=EVENT_STREAM, headers={"X-Accel-Buffering": "no"})

    async def _events(self, job: Job) -> AsyncIterator[str]:
        self._followers += 1
        try:
            yield _event(job)
            silent = 0.0
            while not job.state.is_final and not self._ended.is_set():
                await asyncio.sleep(LOOK)
                silent += LOOK
                before, job = job, await to_thread.run_sync(self._latest, job)
                if job != before:
                    silent = 0.0
                    yield _event(job)
                elif silent >= KEEP_ALIVE_INTERVAL:
                    silent = 0.0
                    yield ": still here\n\n"
        finally:
            self._followers -= 1

    def _latest(self, job: Job) -> Job:
        """Return a job as it stands now; one that was deleted is cancelled."""
        try:
            return self._jobs.job(job.id)
        except JobNotFoundError:
            return job.as_cancelled()

    async def _known(self, job_id: str) -> Job:
        try:
            return await self._lookup_threads.run(partial(self._jobs.job, job_id))
        except JobNotFoundError as error:
            raise ProblemError(ProblemType.JOB_NOT_FOUND, str(error)) from error


def _event(job: Job) -> str:
    return f"event: job\ndata: {job_schema(job).model_dump_json()}\n\n"

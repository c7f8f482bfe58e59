"""Job queue: one job at a time in a worker process, with progress, cancellation and results for an hour."""

import logging
import secrets
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Final, Self, TypeAlias

from analysis.signals.errors import AnalysisError
from daq.errors import RigError
from daq.session.processes import WorkerProcess
from model.errors import ModelError
from recordings.catalogue.catalogue import Catalogue
from recordings.errors import RecordingError, StorageError

MAX_UNFINISHED_JOBS: Final = 8
MAX_JOBS: Final = 32
RETENTION_TIME: Final = 3600.0  # s after a job's end until it and its result are deleted
JOB_TIME_LIMIT: Final = 6 * 3600.0  # s for one job
CLEANUP_INTERVAL: Final = 60.0  # s between two deletions of expired jobs
ABANDONED_AFTER: Final = 24 * 3600.0  # s: older results were left behind by a killed service
JOIN_TIMEOUT: Final = 5.0  # s
NICENESS: Final = 15  # increase, of the worker process: below the acquisition and the live view

logger = logging.getLogger(__name__)


class JobNotFoundError(LookupError):
    """No job has this id."""


class JobQueueFullError(RuntimeError):
    """Too many jobs are waiting, or the service is shutting down."""


class JobState(StrEnum):
    """State of a job."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_final(self) -> bool:
        """Whether the job has ended."""
        return self not in {JobState.WAITING, JobState.RUNNING}


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a job.

    Parameters
    ----------
    step : str
        Current step, in words.
    fraction : float or None
        Completed fraction of the step, 0 to 1; None if unknown.
    """

    step: str
    fraction: float | None = None


ReportProgress: TypeAlias = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class Task:
    """The function that a job runs, its arguments and its result file.

    Parameters
    ----------
    kind, description : str
        Kind of job, and its description in words.
    run : str
        Id of its run; empty if it concerns none.
    work : callable
        A module-level function of a `ReportProgress`, the result file's path, and ``arguments``.
    arguments : tuple
        Further arguments; all can be pickled.
    file : str
        Name of the result file; its suffix gives the format.
    """

    kind: str
    description: str
    run: str
    work: Callable[..., None]
    arguments: tuple[object, ...]
    file: str


@dataclass(frozen=True, slots=True)
class Job:
    """State of a job at one time; times are wall clock, s since 1970.

    Parameters
    ----------
    id : str
        Its random id.
    task : Task
        Its task.
    state : JobState
        Its state.
    submitted, started, ended : float
        Time of the request, of the start and of the end; 0 if not yet.
    progress : Progress
        Its progress.
    error : str
        Why it failed.
    result : Path or None
        Result file of a completed job.
    """

    id: str
    task: Task
    state: JobState
    submitted: float
    started: float = 0.0
    ended: float = 0.0
    progress: Progress = Progress("")
    error: str = ""
    result: Path | None = None

    def as_cancelled(self) -> Self:
        """Return the job in the state after cancellation; a job that has ended is unchanged."""
        return self if self.state.is_final else replace(self, state=JobState.CANCELLED, ended=time.time())


@dataclass(frozen=True, slots=True)
class CatalogueLocation:
    """Picklable location of a catalogue, for worker processes.

    Parameters
    ----------
    folder : Path
        The data folder.
    url : str
        URL of the catalogue's database, as for `Catalogue`.
    """

    folder: Path
    url: str = ""

    def catalogue(self) -> Catalogue:
        """Open the catalogue."""
        return Catalogue(self.folder, self.url)


class JobQueue:
    """Runs jobs one after the other in a low-priority process; cancelling a job kills that process.

    Parameters
    ----------
    location : CatalogueLocation
        The runs; results are in the folder `.rig/jobs` beside them.
    retention_time : float
        Time from the end of a job until its deletion, s.
    time_limit : float
        Time limit of one job, s.
    """

    def __init__(
        self, location: CatalogueLocation, retention_time: float = RETENTION_TIME, time_limit: float = JOB_TIME_LIMIT
    ) -> None:
        self.location = location
        self._folder = location.folder / ".rig" / "jobs"
        self._retention_time = retention_time
        self._time_limit = time_limit
        self._changed = threading.Condition()
        self._jobs: dict[str, Job] = {}  # in order of submission
        self._worker = WorkerProcess(NICENESS)
        self._running = ""
        self._thread: threading.Thread | None = None
        self._is_stopped = False

    def submit(self, task: Task) -> Job:
        """Queue a job and return it; JobQueueFullError if too many are waiting."""
        with self._changed:
            self._delete_expired(reserve=1)
            unfinished = sum(not job.state.is_final for job in self._jobs.values())
            if self._is_stopped or unfinished >= MAX_UNFINISHED_JOBS:
                raise JobQueueFullError(f"{unfinished} jobs are running or waiting; the limit is {MAX_UNFINISHED_JOBS}")
            job = Job(secrets.token_hex(8), task, JobState.WAITING, time.time())
            self._jobs[job.id] = job
            if self._thread is None:
                self._thread = threading.Thread(target=self._run_jobs, name="jobs", daemon=True)
                self._thread.start()
            self._changed.notify_all()
            return job

    def list_jobs(self) -> tuple[Job, ...]:
        """Return all jobs, the newest first."""
        with self._changed:
            self._delete_expired()
            return tuple(reversed(self._jobs.values()))

    def job(self, job_id: str) -> Job:
        """Return a job by its id; JobNotFoundError if there is none."""
        with self._changed:
            self._delete_expired()
            if job_id not in self._jobs:
                raise JobNotFoundError(f"no job has the id {job_id[:40]!r}")
            return self._jobs[job_id]

    def delete(self, job_id: str) -> Job:
        """Cancel a job if it has not ended, delete it with its result, and return its last state."""
        with self._changed:
            job = self.job(job_id)
            del self._jobs[job_id]
            running = self._worker if self._running == job_id else None
        if running is None:
            self._discard(job_id)
        else:
            running.close()  # the next job gets another one
        return job.as_cancelled()

    def close(self) -> None:
        """Cancel the running job, wait for its end, and delete all results; further jobs are refused."""
        with self._changed:
            self._is_stopped = True
            self._changed.notify_all()
        self._worker.close()
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT)
        with self._changed:
            for job_id in self._jobs:
                self._discard(job_id)
            self._jobs.clear()

    def _run_jobs(self) -> None:
        """Run one job after the other: the body of the thread."""
        self._delete_abandoned()
        while (job := self._wait_for_job()) is not None:
            self._run_job(job)
            with self._changed:
                self._running = ""
                if job.id not in self._jobs:  # it was cancelled, and its process ended with it
                    self._discard(job.id)
                    if not self._is_stopped:
                        self._worker = WorkerProcess(NICENESS)

    def _wait_for_job(self) -> Job | None:
        """Wait for a job, mark it as running and return it; None when the queue is stopped."""
        with self._changed:
            while not self._is_stopped:
                waiting = [job for job in self._jobs.values() if job.state is JobState.WAITING]
                if waiting:
                    job = replace(waiting[0], state=JobState.RUNNING, started=time.time())
                    self._jobs[job.id] = job
                    self._running = job.id
                    return job
                if not self._changed.wait(CLEANUP_INTERVAL):
                    self._delete_expired()
                    self._worker.kill()  # frees its memory; the next job starts it again
        return None

    def _run_job(self, job: Job) -> None:
        """Run a job and store its outcome."""

        def on_progress(progress: Progress) -> None:
            self._update(job.id, progress=progress)

        target = self._folder / job.id / job.task.file
        try:
            _create_folder(target.parent)
            arguments = (target, *job.task.arguments)
            self._worker.run(job.task.work, *arguments, time_limit=self._time_limit, on_progress=on_progress)
        except (RigError, RecordingError, AnalysisError, ModelError) as error:
            self._update(job.id, state=JobState.FAILED, ended=time.time(), error=str(error))
        except Exception as error:  # the next job must run regardless
            logger.exception("job %s (%s) failed", job.id, job.task.description)
            message = f"internal error: {type(error).__name__}; see the service's log"
            self._update(job.id, state=JobState.FAILED, ended=time.time(), error=message)
        else:
            self._update(job.id, state=JobState.DONE, ended=time.time(), progress=Progress("done", 1.0), result=target)

    def _update(self, job_id: str, **changes: object) -> None:
        with self._changed:
            if job_id in self._jobs:
                self._jobs[job_id] = replace(self._jobs[job_id], **changes)  # type: ignore[arg-type]  # names are Job's

    def _delete_expired(self, reserve: int = 0) -> None:
        """Delete expired jobs, and the oldest ended ones above the limit."""
        ended = sorted((job for job in self._jobs.values() if job.state.is_final), key=lambda job: job.ended)
        too_many = len(self._jobs) + reserve - MAX_JOBS
        for index, job in enumerate(ended):
            if index < too_many or time.time() - job.ended > self._retention_time:
                del self._jobs[job.id]
                self._discard(job.id)

    def _discard(self, job_id: str) -> None:
        shutil.rmtree(self._folder / job_id, ignore_errors=True)

    def _delete_abandoned(self) -> None:
        """Delete results left behind by killed services."""
        for folder in self._folder.glob("*"):
            try:
                if time.time() - folder.stat().st_mtime > ABANDONED_AFTER:
                    shutil.rmtree(folder, ignore_errors=True)
            except OSError:  # another service has deleted it meanwhile
                continue

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()


def _create_folder(folder: Path) -> None:
    """Create the folder of a job's result; StorageError if that fails."""
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise StorageError(f"{folder}: cannot be created: {error.strerror or error}") from error

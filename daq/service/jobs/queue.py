"""Job queue: one job at a time in a worker process, with progress, cancellation and results for an hour."""

import logging
import queue
import secrets
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from analysis.signals.errors import AnalysisError
from daq.errors import RigError
from daq.schemas.units import Schema
from daq.service.jobs.schemas import JOBS, JobRequest, JobSchema, JobState
from daq.service.problems import ProblemError, ProblemType
from daq.service.uploads import delete_abandoned
from daq.session.processes import WorkerProcess
from model.errors import ModelError
from recordings.catalogue.catalogue import Catalogue
from recordings.errors import RecordingError
from recordings.file_operations import storage_errors

MAX_UNFINISHED_JOBS: Final = 8
MAX_JOBS: Final = 32
RETENTION_TIME: Final = 3600.0  # s after a job's end until it and its result are deleted
JOB_TIME_LIMIT: Final = 6 * 3600.0  # s for one job
CLEANUP_INTERVAL: Final = 60.0  # s without a job until the process ends
JOIN_TIMEOUT: Final = 5.0  # s
NICENESS: Final = 15  # increase, of the worker process: below the acquisition and the live view
REPORT_INTERVAL: Final = 0.1  # s between two progress reports of one step

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Task:
    """What a job does.

    Parameters
    ----------
    request : JobRequest
        The request.
    description : str
        Description in words.
    work : callable
        Function of a `ProgressCallback`, the result file's path, the catalogue and the request, which can be pickled.
        It writes the file, or returns the content.
    file : str
        Name of the result file; its suffix gives the format.
    """

    request: JobRequest
    description: str
    work: Callable[..., Schema | bytes | None]
    file: str


class JobQueue:
    """Runs jobs one after the other in a low-priority process; cancelling a job ends that process.

    Parameters
    ----------
    catalogue : Catalogue
        The runs; results are in the folder `.rig/jobs` beside them.
    retention_time : float
        Time from the end of a job until its deletion, s.
    time_limit : float
        Time limit of one job, s.
    """

    def __init__(
        self, catalogue: Catalogue, retention_time: float = RETENTION_TIME, time_limit: float = JOB_TIME_LIMIT
    ) -> None:
        self._catalogue = catalogue
        self._folder = catalogue.folder / ".rig" / "jobs"
        self._retention_time = retention_time
        self._time_limit = time_limit
        self._lock = threading.RLock()
        self._jobs: dict[str, JobSchema] = {}  # in order of submission
        self._tasks: dict[str, Task] = {}
        self._waiting: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._worker = WorkerProcess(NICENESS)
        self._running = ""
        self._thread = threading.Thread(target=self._run_jobs, name="jobs", daemon=True)
        self._is_closed = False

    def submit(self, task: Task) -> JobSchema:
        """Queue a job and return it; ProblemError if too many are waiting."""
        with self._lock:
            self._delete_expired(reserve=1)
            unfinished = sum(not job.state.is_final for job in self._jobs.values())
            if self._is_closed or unfinished >= MAX_UNFINISHED_JOBS:
                detail = f"{unfinished} jobs are running or waiting; the limit is {MAX_UNFINISHED_JOBS}"
                raise ProblemError(ProblemType.TOO_MANY_JOBS, detail)
            job = _waiting_job(task)
            self._jobs[job.job], self._tasks[job.job] = job, task
            if self._thread.ident is None:
                self._thread.start()
            self._waiting.put(job.job)
            return job

    def list_jobs(self) -> tuple[JobSchema, ...]:
        """Return all jobs, the newest first."""
        with self._lock:
            self._delete_expired()
            return tuple(reversed(self._jobs.values()))

    def job(self, job_id: str) -> JobSchema:
        """Return a job by its id; ProblemError if there is none."""
        with self._lock:
            self._delete_expired()
            if job_id not in self._jobs:
                raise ProblemError(ProblemType.JOB_NOT_FOUND, f"no job has the id {job_id[:40]!r}")
            return self._jobs[job_id]

    def result_file(self, job_id: str) -> Path:
        """Return the result file of a job; ProblemError if there is none."""
        with self._lock:
            job = self.job(job_id)
            if job.result is None:
                raise ProblemError(ProblemType.NO_RESULT, job.detail or f"job {job_id} is {job.state.value}")
            return self._folder / job_id / self._tasks[job_id].file

    def delete(self, job_id: str) -> JobSchema:
        """Cancel a job if it has not ended, delete it with its result, and return its last state."""
        with self._lock:
            job = self.job(job_id)
            self._remove(job_id)
            running = self._worker if self._running == job_id else None
        if running is not None:
            running.close()  # the next job gets another one
        return cancelled(job)

    def close(self) -> None:
        """Cancel the running job, wait for its end, and delete all results; further jobs are refused."""
        with self._lock:
            self._is_closed = True
        self._worker.close()
        self._waiting.put("")
        if self._thread.ident is not None:
            self._thread.join(JOIN_TIMEOUT)
        with self._lock:
            for job_id in tuple(self._jobs):
                self._remove(job_id)

    def _run_jobs(self) -> None:
        """Run one job after the other: the body of the thread."""
        delete_abandoned(self._folder)
        while not self._is_closed:
            try:
                job_id = self._waiting.get(timeout=CLEANUP_INTERVAL)
            except queue.Empty:
                with self._lock:
                    self._delete_expired()
                self._worker.kill()  # frees its memory; the next job starts it again
            else:
                self._run_job(job_id)

    def _run_job(self, job_id: str) -> None:
        """Run a job and store its outcome."""
        with self._lock:
            if self._is_closed or job_id not in self._jobs:  # it was cancelled
                return
            task, worker, self._running = self._tasks[job_id], self._worker, job_id
            self._update(job_id, state=JobState.RUNNING, started_at=datetime.now(UTC))
        target = self._folder / job_id / task.file
        try:
            with storage_errors(target.parent, "cannot be created"):
                target.parent.mkdir(parents=True)
            worker.run(
                perform, task, target, self._catalogue, time_limit=self._time_limit,
                on_progress=lambda step, fraction: self._update(job_id, step=step, progress=fraction),
            )  # fmt: skip
        except (RigError, RecordingError, AnalysisError, ModelError) as error:
            outcome: dict[str, object] = {"state": JobState.FAILED, "detail": str(error)}
        except Exception as error:  # the next job must run regardless
            logger.exception("job %s (%s) failed", job_id, task.description)
            detail = f"internal error: {type(error).__name__}; see the service's log"
            outcome = {"state": JobState.FAILED, "detail": detail}
        else:
            result = f"{JOBS}/{job_id}/result"
            outcome = {"state": JobState.DONE, "progress": 1.0, "step": "done", "result": result}
        with self._lock:
            self._running = ""
            self._update(job_id, ended_at=datetime.now(UTC), **outcome)
            if job_id not in self._jobs:  # it was cancelled, and its process ended with it
                shutil.rmtree(target.parent, ignore_errors=True)
                if not self._is_closed:
                    self._worker = WorkerProcess(NICENESS)

    def _update(self, job_id: str, **changes: object) -> None:
        """Change a job unless it has been deleted."""
        with self._lock:
            if job_id in self._jobs:
                self._jobs[job_id] = self._jobs[job_id].model_copy(update=changes)

    def _delete_expired(self, reserve: int = 0) -> None:
        """Delete expired jobs, and the oldest ended ones above the limit."""
        now, too_many = datetime.now(UTC), len(self._jobs) + reserve - MAX_JOBS
        ended = sorted((job.ended_at, job_id) for job_id, job in self._jobs.items() if job.ended_at is not None)
        for index, (ended_at, job_id) in enumerate(ended):
            if index < too_many or (now - ended_at).total_seconds() > self._retention_time:
                self._remove(job_id)

    def _remove(self, job_id: str) -> None:
        """Remove a job with its result."""
        del self._jobs[job_id], self._tasks[job_id]
        if job_id != self._running:
            shutil.rmtree(self._folder / job_id, ignore_errors=True)


def _waiting_job(task: Task) -> JobSchema:
    """Return a new job with a random id."""
    job_id = secrets.token_hex(8)
    return JobSchema(
        job=job_id,
        kind=task.request.kind,
        description=task.description,
        run=getattr(task.request, "run", None),
        state=JobState.WAITING,
        progress=None,
        step="",
        detail="",
        created_at=datetime.now(UTC),
        started_at=None,
        ended_at=None,
        events=f"{JOBS}/{job_id}/events",
        result=None,
    )


def cancelled(job: JobSchema) -> JobSchema:
    """Return a job in the state after its cancellation; one that has ended is unchanged."""
    if job.state.is_final:
        return job
    return job.model_copy(update={"state": JobState.CANCELLED, "ended_at": datetime.now(UTC)})


def perform(report: Callable[[str, float | None], None], task: Task, target: Path, catalogue: Catalogue) -> None:
    """Do the work of a job, in its process; report each step and, at limited rate, its completed fraction."""
    last_step, reported_at = "", 0.0

    def report_progress(step: str, fraction: float | None) -> None:
        nonlocal last_step, reported_at
        now = time.monotonic()
        if step != last_step or now - reported_at >= REPORT_INTERVAL:
            last_step, reported_at = step, now
            report(step, fraction)

    content = task.work(report_progress, target, catalogue, task.request)
    if content is None:
        return
    with storage_errors(target):
        target.write_bytes(content if isinstance(content, bytes) else content.model_dump_json().encode())

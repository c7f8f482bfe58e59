"""Long work that nobody waits for: begun, told of, cancelled, and its results kept for a while."""

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

from daq.errors import RigError
from daq.service.worker_pool import WorkerProcess, WorkerStoppedError
from model.errors import ModelError
from recordings.catalogue.catalogue import Catalogue
from recordings.errors import RecordingError

MOST_UNFINISHED: Final = 8
MOST_KEPT: Final = 32
KEPT_FOR: Final = 3600.0  # s after its end that a job and its result are kept
LIMIT: Final = 6 * 3600.0  # s that one job may take
TIDYING: Final = 60.0  # s between two looks at what is too old
ABANDONED: Final = 24 * 3600.0  # s: results this old are of a service that was ended by force
JOIN_TIMEOUT: Final = 5.0  # s

logger = logging.getLogger(__name__)


class JobNotFoundError(LookupError):
    """There is no such job."""


class JobQueueFullError(RuntimeError):
    """Too many jobs wait already, or the service ends."""


class JobState(StrEnum):
    """How a job stands."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_final(self) -> bool:
        """Whether nothing more comes."""
        return self not in {JobState.WAITING, JobState.RUNNING}


@dataclass(frozen=True, slots=True)
class Progress:
    """Where a job stands.

    Parameters
    ----------
    step : str
        What it does.
    fraction : float or None
        What part of that is done, 0 to 1; None where that cannot be told.
    """

    step: str
    fraction: float | None = None


ReportProgress: TypeAlias = Callable[[Progress], None]


@dataclass(frozen=True, slots=True)
class Task:
    """What a job is to do.

    Parameters
    ----------
    kind, description : str
        What kind of work it is, and what it is in words.
    run : str
        Id of the run that it is about; empty where it is about none.
    work : callable
        A function of a module that takes a `ReportProgress`, the file to write its result to, and ``arguments``.
    arguments : tuple
        What else it is given; all of it can be sent to another process.
    file : str
        Name of the result's file; its suffix tells the form.
    """

    kind: str
    description: str
    run: str
    work: Callable[..., None]
    arguments: tuple[object, ...]
    file: str


@dataclass(frozen=True, slots=True)
class Job:
    """A job as it stands; times are wall clock, s since 1970.

    Parameters
    ----------
    id : str
        Its id, which cannot be guessed.
    task : Task
        What it does.
    state : JobState
        How it stands.
    created, started, ended : float
        When it was asked for, began and ended; 0 where it has not.
    progress : Progress
        Where it stands.
    fault : str
        Why it failed.
    result : Path or None
        Its result, once it is done.
    """

    id: str
    task: Task
    state: JobState
    created: float
    started: float = 0.0
    ended: float = 0.0
    progress: Progress = Progress("")
    fault: str = ""
    result: Path | None = None

    def cancelled(self) -> Self:
        """Return the job as it is when nobody wants it any more."""
        return self if self.state.is_final else replace(self, state=JobState.CANCELLED, ended=time.time())


@dataclass(frozen=True, slots=True)
class CatalogueLocation:
    """Where a process finds the runs.

    Parameters
    ----------
    folder : Path
        The data folder.
    url : str
        The catalogue's database, as `Catalogue` takes it.
    """

    folder: Path
    url: str = ""

    def catalogue(self) -> Catalogue:
        """Return the catalogue."""
        return Catalogue(self.folder, self.url)


class JobQueue:
    """Does jobs one after the other, in a process of low priority; one that is cancelled is ended with that process.

    Parameters
    ----------
    place : CatalogueLocation
        The runs; results lie in a folder beside them, `.rig/jobs`.
    kept_for : float
        How long a job is kept after its end, s.
    limit : float
        How long one may take, s.
    """

    def __init__(self, place: CatalogueLocation, kept_for: float = KEPT_FOR, limit: float = LIMIT) -> None:
        self.place = place
        self._folder = place.folder / ".rig" / "jobs"
        self._kept_for = kept_for
        self._limit = limit
        self._changed = threading.Condition()
        self._jobs: dict[str, Job] = {}  # in the order in which they were asked for
        self._process = WorkerProcess()
        self._running = ""
        self._thread: threading.Thread | None = None
        self._is_ended = False

    def begin(self, task: Task) -> Job:
        """Take a job on and return it; JobQueueFullError where too many wait."""
        with self._changed:
            self._tidy(room=1)
            unfinished = sum(not job.state.is_final for job in self._jobs.values())
            if self._is_ended or unfinished >= MOST_UNFINISHED:
                raise JobQueueFullError(f"{unfinished} jobs are under way or waiting already")
            job = Job(secrets.token_hex(8), task, JobState.WAITING, time.time())
            self._jobs[job.id] = job
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="jobs", daemon=True)
                self._thread.start()
            self._changed.notify_all()
            return job

    def all(self) -> tuple[Job, ...]:
        """Return all jobs, the one asked for last first."""
        with self._changed:
            self._tidy()
            return tuple(reversed(self._jobs.values()))

    def job(self, job_id: str) -> Job:
        """Return a job; JobNotFoundError where there is none."""
        with self._changed:
            self._tidy()
            if job_id not in self._jobs:
                raise JobNotFoundError(f"job {job_id[:40]!r}: there is none of this id")
            return self._jobs[job_id]

    def remove(self, job_id: str) -> Job:
        """Cancel a job that has not ended, forget it with its result, and return it as it was last."""
        with self._changed:
            job = self.job(job_id)
            del self._jobs[job_id]
            if self._running == job_id:
                self._process.cancel()
            else:
                self._discard(job_id)
        return job.cancelled()

    def stop(self) -> None:
        """Give up what is under way; nothing is begun any more."""
        with self._changed:
            self._is_ended = True
            self._process.cancel()
            self._changed.notify_all()

    def close(self) -> None:
        """Give up what is under way, wait for its end, and leave no result behind."""
        self.stop()
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT)
            self._process.kill()  # where it stands still; else it has ended
            self._thread.join(JOIN_TIMEOUT)
        with self._changed:
            for job_id in self._jobs:
                self._discard(job_id)
            self._jobs.clear()

    def _work(self) -> None:
        """Do one job after the other: the body of the thread."""
        self._sweep()
        while (job := self._next()) is not None:
            self._do(job, self._process)
            with self._changed:
                self._running = ""
                if job.id not in self._jobs:  # it was cancelled, and its process ended with it
                    self._discard(job.id)
                    if not self._is_ended:
                        self._process = WorkerProcess()
        self._process.join()

    def _next(self) -> Job | None:
        """Wait for a job and return it as it begins; None where the service ends."""
        with self._changed:
            while not self._is_ended:
                waiting = [job for job in self._jobs.values() if job.state is JobState.WAITING]
                if waiting:
                    job = replace(waiting[0], state=JobState.RUNNING, started=time.time())
                    self._jobs[job.id] = job
                    self._running = job.id
                    return job
                if not self._changed.wait(TIDYING):
                    self._tidy()
                    self._process.join()  # no use in keeping it; it is started anew for the next job
        return None

    def _do(self, job: Job, process: WorkerProcess) -> None:
        """Do a job and keep how it ended."""

        def told(progress: Progress) -> None:
            self._keep(job.id, progress=progress)

        target = self._folder / job.id / job.task.file
        try:
            target.parent.mkdir(parents=True)
            process.run(job.task.work, (target, *job.task.arguments), self._limit, told)
        except (RigError, RecordingError, ModelError, WorkerStoppedError, OSError, ValueError, LookupError) as error:
            self._keep(job.id, state=JobState.FAILED, ended=time.time(), fault=str(error))
        except Exception as error:  # whatever it is, the next job must be done all the same
            logger.exception("job %s (%s) failed", job.id, job.task.description)
            fault = f"{type(error).__name__}; see the service's log"
            self._keep(job.id, state=JobState.FAILED, ended=time.time(), fault=fault)
        else:
            self._keep(job.id, state=JobState.DONE, ended=time.time(), progress=Progress("done", 1.0), result=target)

    def _keep(self, job_id: str, **changes: object) -> None:
        with self._changed:
            if job_id in self._jobs:
                self._jobs[job_id] = replace(self._jobs[job_id], **changes)  # type: ignore[arg-type]  # names are Job's

    def _tidy(self, room: int = 0) -> None:
        """Forget jobs that ended long ago, and the oldest that ended where they are too many."""
        ended = sorted((job for job in self._jobs.values() if job.state.is_final), key=lambda job: job.ended)
        too_many = len(self._jobs) + room - MOST_KEPT
        for place, job in enumerate(ended):
            if place < too_many or time.time() - job.ended > self._kept_for:
                del self._jobs[job.id]
                self._discard(job.id)

    def _discard(self, job_id: str) -> None:
        shutil.rmtree(self._folder / job_id, ignore_errors=True)

    def _sweep(self) -> None:
        """Throw away what services that were ended by force have left."""
        for folder in self._folder.glob("*"):
            try:
                if time.time() - folder.stat().st_mtime > ABANDONED:
                    shutil.rmtree(folder, ignore_errors=True)
            except OSError:  # another service has been faster
                continue

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()

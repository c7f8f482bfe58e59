"""State that the routes share, the dependencies that give it to them, and bounded thread pools for blocking work."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Path
from fastapi.requests import HTTPConnection

from daq.reports.run_summaries import Summaries
from daq.schemas.live import live_schema
from daq.schemas.snapshot import live_curves_schema
from daq.service.jobs.queue import JobQueue
from daq.service.problem_types import ProblemType
from daq.service.problems import ProblemError
from daq.service.results_reader import ResultsReader
from daq.service.stream import CURVES_INTERVAL, VALUES_INTERVAL, LiveRun, LiveStream, require_ended
from daq.service.uploads import MAX_UPLOAD_SIZE, UploadReceiver, UploadStore
from daq.session.run import RunManager
from recordings.catalogue.catalogue import Catalogue, RunEntry

MAX_RECORDING_SIZE = 64 * 1024**3  # bytes
ResultT = TypeVar("ResultT")
ArgumentTs = TypeVarTuple("ArgumentTs")


class BoundedThreadPool:
    """Runs blocking functions in a bounded number of threads with a bounded queue.

    FastAPI's own threads are shared by all requests: a few slow ones could occupy all of them.

    Parameters
    ----------
    threads : int
        Maximum number of functions that run at once.
    waiting : int
        Maximum number that wait; further ones are rejected.
    """

    def __init__(self, threads: int, waiting: int) -> None:
        self._limiter = CapacityLimiter(threads)
        self._capacity = threads + waiting
        self._pending = 0

    async def run(self, function: Callable[[*ArgumentTs], ResultT], *arguments: *ArgumentTs) -> ResultT:
        """Return the result of a function, run in a thread; ProblemError (busy) if too many are waiting."""
        if self._pending >= self._capacity:
            raise ProblemError(ProblemType.BUSY, f"{self._pending} requests are in progress or waiting already")
        self._pending += 1  # here and not in the limiter, which counts only when the event loop comes round
        try:
            return await to_thread.run_sync(function, *arguments, limiter=self._limiter)
        finally:
            self._pending -= 1


@dataclass(slots=True)
class ServiceState:
    """What the routes share.

    Parameters
    ----------
    catalogue : Catalogue
        The recorded runs.
    live : LiveRun
        The current run.
    summaries : Summaries
        Summaries of the runs.
    results : ResultsReader
        Computes results of the runs.
    jobs : JobQueue
        Runs work that takes longer than a request may.
    run_manager : RunManager or None
        Starts runs; None if the service starts none.
    uploads : UploadStore
        Files of other programs, for import.
    recording_receiver, upload_receiver : UploadReceiver
        Receive recordings and files of other programs.
    values, curves : LiveStream
        Values and curves of the live run for the clients that follow it.
    closing : Event
        Set before shutdown: endless responses end.
    job_followers : int
        Number of clients that follow a job.
    started_at : float
        Start of the service on the monotonic clock, s.
    lookups, summary_threads, result_threads, edits, starts : BoundedThreadPool
        Threads for the catalogue, for summaries, for results, for changes of the data folder and for starts of runs.
    """

    catalogue: Catalogue
    live: LiveRun
    summaries: Summaries
    results: ResultsReader
    jobs: JobQueue
    run_manager: RunManager | None = None
    uploads: UploadStore = field(init=False)
    recording_receiver: UploadReceiver = field(init=False)
    upload_receiver: UploadReceiver = field(init=False)
    values: LiveStream = field(init=False)
    curves: LiveStream = field(init=False)
    closing: threading.Event = field(default_factory=threading.Event)
    job_followers: int = 0
    started_at: float = field(default_factory=time.monotonic)
    lookups: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=4, waiting=64))
    summary_threads: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=2, waiting=16))
    result_threads: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=2, waiting=64))
    edits: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=1, waiting=16))
    starts: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=1, waiting=0))

    def __post_init__(self) -> None:
        self.uploads = UploadStore(self.catalogue.folder)
        self.recording_receiver = UploadReceiver(self.catalogue.free_bytes, MAX_RECORDING_SIZE)
        self.upload_receiver = UploadReceiver(self.catalogue.free_bytes, MAX_UPLOAD_SIZE)
        self.values = LiveStream(self.live, live_schema, VALUES_INTERVAL, self.closing)
        self.curves = LiveStream(self.live, live_curves_schema, CURVES_INTERVAL, self.closing)


def service_state(connection: HTTPConnection) -> ServiceState:
    """Return the state of the application of a request or socket."""
    state: ServiceState = connection.app.state.service
    return state


State = Annotated[ServiceState, Depends(service_state)]
RunId = Annotated[str, Path(description="Id of the run, from /api/v1/runs", examples=["2026-11-24T09-12-07-gj90c"])]


async def ended_run(state: State, run: RunId) -> RunEntry:
    """Return a recorded run; ProblemError if it is still in progress."""
    require_ended(state.live, run)
    return await state.lookups.run(state.catalogue.run, run)


EndedRun = Annotated[RunEntry, Depends(ended_run)]

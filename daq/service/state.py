"""State that the routes share: the live run with its streams, thread pools, and the dependencies of the routes."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from typing import Annotated, Protocol, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Path
from fastapi.requests import HTTPConnection

from daq.reports.run_summaries import Summaries
from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema
from daq.schemas.live import live_schema
from daq.schemas.snapshot import live_curves_schema
from daq.schemas.units import Schema
from daq.service.jobs.queue import JobQueue
from daq.service.problems import ProblemError, ProblemType
from daq.service.results_reader import ResultsReader
from daq.service.uploads import MAX_UPLOAD_SIZE, UploadReceiver, UploadStore
from daq.session.live_update import LiveUpdate
from daq.session.run import RunManager
from recordings.catalogue.catalogue import Catalogue, RunEntry

VALUES_INTERVAL = 0.1  # s
CURVES_INTERVAL = 0.25  # s
MAX_CLIENTS = 64
KEEP_ALIVE_INTERVAL = 15.0  # s without an update until a comment shows that the service is alive


class LiveRun(Protocol):
    """The live run, implemented by the program that starts the service, which the service does not import."""

    def latest(self) -> LiveUpdate | None:
        """Return the latest update without waiting; None if there is no run."""
        ...

    def stop(self) -> str | None:
        """Request the end of the run; return its id, None if no run is in progress."""
        ...

    def add_marker(self, text: str) -> MarkerSchema | None:
        """Add a marker at the current time of the recorded run; None if nothing is being recorded."""
        ...

    def acknowledge(self) -> AcknowledgedAlarmsSchema | None:
        """Acknowledge the alarms of the current run; None if there is no run."""
        ...


def require_ended(live: LiveRun, run: str) -> None:
    """Raise ProblemError if the run with this id is still in progress."""
    update = live.latest()
    if update is not None and update.header.run == run and update.status.state.is_active:
        raise ProblemError(ProblemType.RUN_UNDER_WAY, f"run {run} is still {update.status.state.value}")


class LiveStream:
    """Sends each change of the live run to all clients; a slow client skips updates and delays no other.

    Parameters
    ----------
    live : LiveRun
        The current run.
    schema_of : callable
        Converts an update to the schema that is sent.
    interval : float
        Polling interval, s.
    closing : Event
        Ends the updates of all clients.
    """

    def __init__(
        self, live: LiveRun, schema_of: Callable[[LiveUpdate], Schema], interval: float, closing: threading.Event
    ) -> None:
        self._live = live
        self._schema_of = schema_of
        self._interval = interval
        self._closing = closing
        self._n_clients = 0
        self._update: LiveUpdate | None = None
        self._text = "null"

    async def updates(self) -> AsyncIterator[str]:
        """Yield the current update as JSON, then each change; ``null`` if there is no run.

        An empty text is a keep-alive. Raises ProblemError (busy) if there are too many clients.
        """
        self.require_capacity()
        self._n_clients += 1
        sent, idle_time = "", 0.0
        try:
            while not self._closing.is_set():
                text = self._latest_text()
                if text != sent or idle_time >= KEEP_ALIVE_INTERVAL:
                    yield "" if text == sent else text
                    sent, idle_time = text, 0.0
                await asyncio.sleep(self._interval)
                idle_time += self._interval
        finally:
            self._n_clients -= 1

    def require_capacity(self) -> None:
        """Raise ProblemError (busy) if there are too many clients."""
        if self._n_clients >= MAX_CLIENTS or self._closing.is_set():
            raise ProblemError(ProblemType.BUSY, f"{self._n_clients} clients follow the live run already")

    def _latest_text(self) -> str:
        """Return the latest update as JSON, made once for all clients."""
        update, before = self._live.latest(), self._update
        if update is None or before is None:
            is_same = update is before
        else:
            is_same = update.snapshot is before.snapshot and update.status == before.status
        if not is_same:
            self._update = update
            self._text = "null" if update is None else self._schema_of(update).model_dump_json()
        return self._text


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
        self.recording_receiver = UploadReceiver(MAX_RECORDING_SIZE)
        self.upload_receiver = UploadReceiver(MAX_UPLOAD_SIZE)
        self.values = LiveStream(self.live, live_schema, VALUES_INTERVAL, self.closing)
        self.curves = LiveStream(self.live, live_curves_schema, CURVES_INTERVAL, self.closing)


async def service_state(connection: HTTPConnection) -> ServiceState:  # async: FastAPI runs others in a thread
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

"""State that the routes share: the live run with its streams, thread pools, and the dependencies of the routes."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated, Protocol, TypeVar, TypeVarTuple

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Path, Request, Response
from fastapi.requests import HTTPConnection
from fastapi.responses import StreamingResponse

from daq.reports.run_summaries import Summaries
from daq.schemas.events import AcknowledgedAlarmsSchema, MarkerSchema
from daq.schemas.live import live_schema
from daq.schemas.snapshot import live_curves_schema
from daq.schemas.units import Schema
from daq.service.http_semantics import EVENT_STREAM
from daq.service.jobs.queue import JobQueue
from daq.service.problems import ProblemError, ProblemType
from daq.service.results_reader import ResultsReader
from daq.service.uploads import MAX_RECORDING_SIZE, MAX_UPLOAD_SIZE, UploadReceiver, UploadStore
from daq.session.live_update import LiveUpdate
from daq.session.run import RunManager
from recordings.catalogue.catalogue import Catalogue, RunEntry

VALUES_INTERVAL = 0.1  # s
CURVES_INTERVAL = 0.25  # s
JOB_INTERVAL = 0.2  # s
MAX_LIVE_CLIENTS = 64
MAX_JOB_CLIENTS = 16
MAX_WAITING_LOOKUPS = 64
MAX_WAITING_SUMMARIES = 16
MAX_WAITING_RESULTS = 64
MAX_WAITING_EDITS = 16
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


class ChangeStream:
    """Sends the changes of a text to a limited number of clients; a slow client skips changes and delays no other.

    Parameters
    ----------
    interval : float
        Polling interval, s.
    max_clients : int
        Maximum number of clients.
    closing : Event
        Ends the streams of all clients.
    """

    def __init__(self, interval: float, max_clients: int, closing: threading.Event) -> None:
        self._interval = interval
        self._max_clients = max_clients
        self._closing = closing
        self._n_clients = 0

    def require_capacity(self) -> None:
        """Raise ProblemError (busy) if there are too many clients."""
        if self._n_clients >= self._max_clients or self._closing.is_set():
            raise ProblemError(ProblemType.BUSY, f"{self._n_clients} clients follow; the limit is {self._max_clients}")

    async def changes(self, texts: AsyncIterator[str]) -> AsyncIterator[str]:
        """Yield the first text, then each that differs from the one before; an empty text is a keep-alive.

        Raises
        ------
        ProblemError
            There are too many clients.
        """
        self.require_capacity()
        self._n_clients += 1
        sent, idle_time = "", 0.0
        try:
            async for text in texts:
                if text != sent or idle_time >= KEEP_ALIVE_INTERVAL:
                    yield "" if text == sent else text
                    sent, idle_time = text, 0.0
                await asyncio.sleep(self._interval)
                idle_time += self._interval
                if self._closing.is_set():
                    return
        finally:
            self._n_clients -= 1

    def event_response(self, request: Request, name: str, texts: AsyncIterator[str]) -> Response:
        """Return the changes as server-sent events of a type."""
        self.require_capacity()
        if request.scope.get("rig.head"):
            return Response(media_type=EVENT_STREAM)
        events = self._events(name, texts)
        return StreamingResponse(events, media_type=EVENT_STREAM, headers={"X-Accel-Buffering": "no"})

    async def _events(self, name: str, texts: AsyncIterator[str]) -> AsyncIterator[str]:
        with suppress(ProblemError):  # another client took the last place: the stream ends, the client reconnects
            async for text in self.changes(texts):
                yield f"event: {name}\ndata: {text}\n\n" if text else ": keep-alive\n\n"


class LiveStream(ChangeStream):
    """Sends the latest update of the live run as JSON, made once for all clients.

    Parameters
    ----------
    live : LiveRun
        The current run.
    schema_of : callable
        Converts an update to the schema that is sent.
    interval, closing : float, Event
        As for `ChangeStream`.
    """

    def __init__(
        self, live: LiveRun, schema_of: Callable[[LiveUpdate], Schema], interval: float, closing: threading.Event
    ) -> None:
        super().__init__(interval, MAX_LIVE_CLIENTS, closing)
        self._live = live
        self._schema_of = schema_of
        self._update: LiveUpdate | None = None
        self._text = "null"

    async def texts(self) -> AsyncIterator[str]:
        """Yield the latest update whenever it is requested; ``null`` if there is no run."""
        while True:
            yield self._latest()

    def _latest(self) -> str:
        update, before = self._live.latest(), self._update
        if update is None or before is None:
            is_same = update is before
        else:
            is_same = update.snapshot is before.snapshot and update.status == before.status
        if not is_same:
            self._update = update
            self._text = "null" if update is None else self._schema_of(update).model_dump_json()
        return self._text


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
    job_changes : ChangeStream
        Progress of the jobs for the clients that follow one.
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
    job_changes: ChangeStream = field(init=False)
    started_at: float = field(default_factory=time.monotonic)
    lookups: BoundedThreadPool = field(
        default_factory=lambda: BoundedThreadPool(threads=4, waiting=MAX_WAITING_LOOKUPS)
    )
    summary_threads: BoundedThreadPool = field(
        default_factory=lambda: BoundedThreadPool(threads=2, waiting=MAX_WAITING_SUMMARIES)
    )
    result_threads: BoundedThreadPool = field(
        default_factory=lambda: BoundedThreadPool(threads=2, waiting=MAX_WAITING_RESULTS)
    )
    edits: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=1, waiting=MAX_WAITING_EDITS))
    starts: BoundedThreadPool = field(default_factory=lambda: BoundedThreadPool(threads=1, waiting=0))

    def __post_init__(self) -> None:
        self.uploads = UploadStore(self.catalogue.folder)
        self.recording_receiver = UploadReceiver(MAX_RECORDING_SIZE)
        self.upload_receiver = UploadReceiver(MAX_UPLOAD_SIZE)
        self.values = LiveStream(self.live, live_schema, VALUES_INTERVAL, self.closing)
        self.curves = LiveStream(self.live, live_curves_schema, CURVES_INTERVAL, self.closing)
        self.job_changes = ChangeStream(JOB_INTERVAL, MAX_JOB_CLIENTS, self.closing)


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
